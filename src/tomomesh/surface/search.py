"""Sort points into cubes, so that kernels find the neighbors of a place in a few ranges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..model.cubes import keys_of

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Index:
    """Points in the order of their cubes.

    Attributes
    ----------
    order : (p,) int64 array
        Numbers of the points, cube by cube; within a cube as they came.
    keys : (c,) int64 array
        Occupied cubes, rising.
    start : (c + 1,) int64 array
        The points of cube q are ``order[start[q]:start[q + 1]]``.
    frame : (4,) float array
        Lowest corner of cell (0, 0, 0), and the edge of the cubes.
    """

    order: NDArray[np.int64]
    keys: NDArray[np.int64]
    start: NDArray[np.int64]
    frame: NDArray[np.float64]

    @classmethod
    def of(cls, positions: NDArray[np.float64], edge: float) -> Index:
        """Sort points (p, 3) into cubes of an edge."""
        origin = positions.min(axis=0)
        keys = keys_of(((positions - origin) / edge).astype(np.int64))
        order = np.argsort(keys, kind="stable")
        keys = keys[order]
        first = np.flatnonzero(np.append(True, keys[1:] != keys[:-1]))
        return cls(order, keys[first], np.append(first, len(keys)), np.append(origin, edge))
