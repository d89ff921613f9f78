"""Sparse cubes in space: integer cells, and the points that each holds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIDE = 1 << 21
"""Cells along each axis that a key can tell apart. Three of 21 bits fill a signed key of 64."""
MARGIN = 256
"""Cells kept free below zero, so that closing and tracking never leave the range of the keys. Four times the widest
closing, 64 cubes, which dilates, floods and tracks a cube beyond each time."""


def keys_of(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pack (c, 3) cells (x, y, z) into one integer each, ordered by z, then y, then x."""
    x, y, z = (cells + MARGIN).T
    return np.asarray((z * SIDE + y) * SIDE + x)


def cells_of(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """Unpack keys into (c, 3) cells (x, y, z)."""
    return np.stack([keys % SIDE, keys // SIDE % SIDE, keys // (SIDE * SIDE)], axis=1) - MARGIN


def key_step(offset: tuple[int, int, int]) -> int:
    """Return what a step of (x, y, z) cells adds to a key."""
    return (offset[2] * SIDE + offset[1]) * SIDE + offset[0]


@dataclass(frozen=True)
class CubeGrid:
    """Cubes of the space partition.

    Attributes
    ----------
    keys : (c,) int64 array
        The cubes of the shell, rising (see `keys_of`).
    origin : (3,) float array
        Lower corner of cell (0, 0, 0).
    cell_mm : (3,) float array
        Edge along x, y and z.
    order : (n,) int64 array
        Numbers of the points, cube by cube.
    start : (c + 1,) int64 array
        The points of cube q are ``order[start[q]:start[q + 1]]``; none in a cube that was added.
    """

    keys: NDArray[np.int64]
    origin: NDArray[np.float64]
    cell_mm: NDArray[np.float64]
    order: NDArray[np.int64]
    start: NDArray[np.int64]

    @property
    def cells(self) -> NDArray[np.int64]:
        """Integer positions (x, y, z), (c, 3)."""
        return cells_of(self.keys)

    @property
    def occupied(self) -> NDArray[np.bool_]:
        """Which cubes hold points, (c,)."""
        return np.diff(self.start) > 0

    def with_cubes(self, keys: NDArray[np.int64]) -> CubeGrid:
        """Return the same partition over a larger set of cubes, which must hold all of the present ones."""
        count = np.zeros(len(keys), np.int64)
        count[np.searchsorted(keys, self.keys)] = np.diff(self.start)
        return replace(self, keys=keys, start=np.concatenate([[0], np.cumsum(count)]))
