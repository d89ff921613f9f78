"""What a training is shown: checked inputs and their weights, laid out for its loops."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..errors import UsageError
from .products import WIDE
from .starts import moments

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.lattice import Lattice
    from .starts import Moments

NEIGHBORS = 12
"""Neighbors by whose distance the density of the inputs is told: the pixels within two pixels of one."""
LOOKED_AT = 2_000
"""Inputs at which it is told, at most: the median of so many is known to some percent."""
THIN = 0.25
"""Half width of a band over its mean radius up to which inputs count as one; a filled disc has .35 / .71, one half."""


@dataclass(frozen=True)
class Shown:
    """Inputs and how much each counts.

    Attributes
    ----------
    inputs : (n, d) float array
        With a second axis of zeros where they have one alone, for the kernels want two.
    weights : (n,) float array or None
        All over 0; None where all are 1.
    axes : int
        How many axes the inputs came with.
    """

    inputs: NDArray[np.float64]
    weights: NDArray[np.float64] | None
    axes: int

    @classmethod
    def of(cls, inputs: NDArray[np.float64], weights: NDArray[np.float64] | None) -> Shown:
        """Check the weights, and leave out what has none."""
        places = flat(np.asarray(inputs, np.float64))
        if weights is None:
            return cls(places, None, inputs.shape[1])
        weights = np.ascontiguousarray(weights, np.float64)
        if (
            weights.shape != (len(places),)
            or not np.isfinite(weights).all()
            or (weights < 0).any()
            or not weights.any()
        ):
            raise UsageError(
                "the weights do not fit the inputs", found=f"shape = {weights.shape}",
                expected=f"({len(places)},), finite, none negative, not all 0",
            )  # fmt: skip
        return cls(places, weights, inputs.shape[1]).only(weights > 0)

    def only(self, kept: NDArray[np.bool_]) -> Shown:
        """Leave the others out."""
        if kept.all():
            return self
        return Shown(self.inputs[kept], None if self.weights is None else self.weights[kept], self.axes)

    def __len__(self) -> int:
        return len(self.inputs)

    @cached_property
    def rows(self) -> NDArray[np.float64]:
        """The inputs, contiguous."""
        return np.ascontiguousarray(self.inputs)

    @cached_property
    def by_axis(self) -> NDArray[np.float64]:
        """The inputs, one row an axis, (d, n): contiguous unless they go through matrix products."""
        return self.rows.T if self.inputs.shape[1] > WIDE else np.ascontiguousarray(self.inputs.T)

    @cached_property
    def amounts(self) -> NDArray[np.float64]:
        """The weights, written out."""
        return np.ones(len(self)) if self.weights is None else self.weights

    @cached_property
    def box(self) -> NDArray[np.float64]:
        """Lowest and highest input along each axis, (2, d)."""
        return np.stack([self.by_axis.min(axis=1), self.by_axis.max(axis=1)])

    @cached_property
    def spread(self) -> Moments:
        """Mean and covariance."""
        return moments(self.by_axis, self.weights)


def flat(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give places (n, 1) a second axis of zeros; leave others."""
    return np.pad(places, ((0, 0), (0, 1))) if places.shape[1] == 1 else places


def area_of_each(inputs: NDArray[np.float64], lattice: Lattice, weights: NDArray[np.float64] | None = None) -> float:
    """Estimate the area that an input of a ring's band stands for; 0 where the inputs are no thin band in the plane.

    By the distance r to the k-th neighbor, pi r^2 / (k + 1/2), in the median (Loftsgaarden & Quesenberry 1965; the
    input itself counts whole, the k-th on the rim by half). On a line it falls with the number of inputs, and a filled
    region, through which a ring winds, is no band. What is shown twice, or
    weighs (n,) twice as much, covers no more.
    """
    if lattice.name != "ring" or inputs.shape[1] != 2:
        return 0.0
    shown = inputs if weights is None else inputs[weights > 0]
    places = np.unique(shown, axis=0)
    if len(places) <= NEIGHBORS:
        return 0.0
    some = places[:: -(-len(places) // LOOKED_AT)]
    apart, _ = scipy.spatial.cKDTree(places).query(some, k=NEIGHBORS + 1)
    reach = float(np.median(np.asarray(apart)[:, -1]))
    covered = len(places) * np.pi * reach**2 / (NEIGHBORS + 0.5)
    mean_radius = float(np.sqrt(places.var(axis=0).sum()))
    half_width = covered / (4 * np.pi * max(mean_radius, 1e-300))
    return covered / len(shown) if half_width <= THIN * mean_radius else 0.0
