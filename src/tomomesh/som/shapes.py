"""Test regions for networks: the paper's square, triangle and cube."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

SHAPES = ("square", "triangle", "cube")
SIDE = {"square": 64, "triangle": 91, "cube": 16}
"""Lattice points along a side: about 4,096 inputs each."""


def shape(name: str) -> tuple[NDArray[np.float64], float]:
    """Fill a region with inputs on a regular lattice; its sides are 1.

    Parameters
    ----------
    name : {"square", "triangle", "cube"}
        The triangle has equal sides.

    Returns
    -------
    inputs : (n, 2) or (n, 3) float array
    pixel_area : float
        Area, or volume, that one input stands for.
    """
    dimensions = 3 if name == "cube" else 2
    axis = (np.arange(SIDE[name]) + 0.5) / SIDE[name]
    lattice = np.stack(np.meshgrid(*[axis] * dimensions, indexing="ij"), axis=-1).reshape(-1, dimensions)
    share = SIDE[name] ** -float(dimensions)
    if name != "triangle":
        return lattice, share
    below = lattice[lattice.sum(axis=1) <= 1]
    return np.asarray(below @ np.array([[1.0, 0.0], [0.5, np.sqrt(3) / 2]])), share * np.sqrt(3) / 2
