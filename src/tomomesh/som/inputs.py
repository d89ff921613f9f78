"""What a training is shown: checked inputs and their weights, laid out for its loops."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from ..errors import UsageError
from ..kernels.som.search import BLOCK, sort_into_blocks
from ..kernels.som.search import best_matching_units as match_in_blocks
from .products import WIDE, best_matching_units
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
class SortedInputs:
    """Inputs as `tomomesh.kernels.som.search.sort_into_blocks` lays them out.

    Attributes
    ----------
    count : int
        Inputs n; the last is repeated to fill the last block.
    order : (b * BLOCK,) int array
        Which input stands where.
    places : (d, b * BLOCK) float array
    boxes : (2, d, b) float array
    """

    count: int
    order: NDArray[np.uint32]
    places: NDArray[np.float64]
    boxes: NDArray[np.float64]

    @classmethod
    def of(cls, by_axis: NDArray[np.float64], box: NDArray[np.float64]) -> SortedInputs:
        """Sort inputs (d, n), d > 1, that lie in a box (2, d)."""
        d, n = by_axis.shape
        blocks = -(-n // BLOCK)
        found = cls(n, np.empty(blocks * BLOCK, np.uint32), np.empty((d, blocks * BLOCK)), np.empty((2, d, blocks)))
        sort_into_blocks(by_axis, box, found.order, found.places, found.boxes)
        return found

    def match(self, codebook: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Return the winner of each input and the squared distance to it (eq. 1), for neurons (d, u)."""
        winners, squared = np.empty(len(self.order), np.int32), np.empty(len(self.order), np.float32)
        match_in_blocks(codebook, self.places, self.boxes, winners, squared)
        found = np.empty(self.count, np.int32), np.empty(self.count, np.float32)
        for values, own in zip((winners, squared), found, strict=True):
            own[self.order] = values
        return found

    def filled(self, weights: NDArray[np.float64] | None) -> NDArray[np.float64]:
        """Return weights (n,), or 1 each, in the order of the blocks; what fills the last block has none."""
        shown = np.ones(len(self.order)) if weights is None else weights[self.order]
        shown[self.count :] = 0.0
        return shown


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
        return self.rows.T if self.wide else np.ascontiguousarray(self.inputs.T)

    @cached_property
    def amounts(self) -> NDArray[np.float64]:
        """The weights, written out."""
        return np.ones(len(self)) if self.weights is None else self.weights

    @cached_property
    def box(self) -> NDArray[np.float64]:
        """Lowest and highest input along each axis, (2, d)."""
        return np.stack([self.by_axis.min(axis=1), self.by_axis.max(axis=1)])

    @cached_property
    def blocks(self) -> SortedInputs:
        """The inputs in blocks of near ones, of `products.WIDE` dimensions at most."""
        return SortedInputs.of(self.by_axis, self.box)

    @cached_property
    def filled(self) -> NDArray[np.float64]:
        """The weights in the order of the blocks."""
        return self.blocks.filled(self.weights)

    @property
    def wide(self) -> bool:
        """Whether they go through matrix products."""
        return bool(self.inputs.shape[1] > WIDE)

    def match(self, codebook: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Return the winner of each input and the squared distance to it (eq. 1), for neurons (d, u)."""
        return best_matching_units(codebook.T, self.inputs) if self.wide else self.blocks.match(codebook)

    @cached_property
    def spread(self) -> Moments:
        """Mean and covariance."""
        return moments(self.by_axis, self.weights)


def match(codebook: NDArray[np.float64], inputs: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return the winner of each input (n, d) among neurons (u, d), and the squared distance to it (eq. 1)."""
    return Shown.of(inputs, None).match(np.ascontiguousarray(flat(codebook).T))


def median(values: NDArray[Any], weights: NDArray[np.float64] | None = None) -> float:
    """Return the median of weighted values (n,), none NaN: that of values repeated as often as they weigh.

    NumPy's own takes three times as long on the sides of a ring.
    """
    if weights is None:
        middle = [(len(values) - 1) // 2, len(values) // 2]
        return float(np.partition(values, middle)[middle].mean())
    order = np.argsort(values, kind="stable")
    steps = np.cumsum(weights[order])
    ends = np.searchsorted(steps, steps[-1] / 2, side="left"), np.searchsorted(steps, steps[-1] / 2, side="right")
    return float(values[order[np.minimum(ends, len(order) - 1)]].mean())


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
