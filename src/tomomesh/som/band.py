"""How thick a band is that inputs fill: the area that each of them stands for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.lattice import Lattice

    Floats = NDArray[np.float64]

NEIGHBORS = 12
"""Neighbors by whose distance the density of the inputs is told: the pixels within two pixels of one."""
LOOKED_AT = 2_000
"""Inputs at which it is told, at most: the median of so many is known to some percent."""
THIN = 0.25
"""Half width of a band over its mean radius up to which inputs count as one; a filled disc has .35 / .71, one half."""


def area_of_each(inputs: Floats, lattice: Lattice, weights: Floats | None = None) -> float:
    """Estimate the area that an input of a ring's band stands for; 0 where the inputs are no thin band in the plane.

    By the distance r to the k-th neighbor, pi r^2 / (k + 1/2), in the median (Loftsgaarden & Quesenberry 1965; the input
    itself counts whole, the k-th on the rim by half). On a line it falls with the number of inputs, and a filled
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
    reach = float(np.median(cKDTree(places).query(some, k=NEIGHBORS + 1)[0][:, -1]))
    covered = len(places) * np.pi * reach**2 / (NEIGHBORS + 0.5)
    mean_radius = float(np.sqrt(places.var(axis=0).sum()))
    half_width = covered / (4 * np.pi * max(mean_radius, 1e-300))
    return covered / len(shown) if half_width <= THIN * mean_radius else 0.0
