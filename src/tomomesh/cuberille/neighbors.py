"""The 26 neighbors of sparse cubes."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.cuberille.cells import find_neighbors
from ..model.cubes import key_step

if TYPE_CHECKING:
    from numpy.typing import NDArray

OFFSETS = tuple((x, y, z) for z, y, x in product((-1, 0, 1), repeat=3))
"""Steps (x, y, z) to the neighbors of a cube, itself in the middle; the columns of every neighbor table."""

DIRECTIONS = ((-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1))
"""Outward normals of a cube's six faces."""

STEPS = np.array([key_step(offset) for offset in OFFSETS])


def column_of(offset: tuple[int, ...]) -> int:
    """Return the column of a neighbor table that holds a step (x, y, z)."""
    x, y, z = offset
    return 9 * (z + 1) + 3 * (y + 1) + x + 1


FACE_COLUMNS = np.array([column_of(direction) for direction in DIRECTIONS])
"""The columns of the six face neighbors."""


def neighbor_table(keys: NDArray[np.int64]) -> NDArray[np.int32]:
    """Return the number of every cube's neighbors, (c, 27), -1 where there is none."""
    table = np.empty((len(keys), 27), np.int32)
    find_neighbors(keys, STEPS, table)
    return table


def dilate(keys: NDArray[np.int64], steps: int) -> NDArray[np.int64]:
    """Add every cube within `steps` of a cube, corners included: one axis after the other."""
    for axis in (key_step((1, 0, 0)), key_step((0, 1, 0)), key_step((0, 0, 1))):
        shifts = [keys + axis * n for n in range(-steps, steps + 1)]
        keys = once_each(np.concatenate(shifts)) if steps else keys
    return keys


def once_each(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """Sort keys and drop repetitions; a stable sort merges the rising runs that the keys consist of."""
    ordered = np.sort(keys, kind="stable")
    return np.asarray(ordered[np.append(True, ordered[1:] != ordered[:-1])])
