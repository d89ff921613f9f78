"""Sort points into cubes, so that kernels find the neighbors of a place in a few ranges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ResourceError
from ..kernels.pointcloud.samples import BITS
from ..measure.tree import sort_keys
from ..model.columns import box, cells_at, parts_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

EDGE = 8
"""Cubes along a block. 512 cubes a block: three coordinates of 18 bits and 9 bits in the block are the 63 of a key."""


@dataclass(frozen=True)
class Index:
    """Points in the order of their cubes, block by block (see `tomomesh.kernels.pointcloud.samples`).

    Attributes
    ----------
    order : (p,) int64 array
        Numbers of the points, cube by cube; within a cube as they came.
    groups : (c + 1,) int64 array
        The points of the q-th occupied cube are ``order[groups[q]:groups[q + 1]]``.
    blocks : (b,) int64 array
        Occupied blocks of 8 x 8 x 8 cubes, rising.
    start : (512 b + 1,) int32 array
        The points of cube c of block b are ``order[start[512 b + c]:start[512 b + c + 1]]``.
    frame : (4,) float array
        Lowest corner of cell (0, 0, 0), and the edge of the cubes.
    """

    order: NDArray[np.int64]
    groups: NDArray[np.int64]
    blocks: NDArray[np.int64]
    start: NDArray[np.int32]
    frame: NDArray[np.float64]

    @classmethod
    def of(cls, positions: NDArray[np.float64], edge: float, origin: NDArray[np.float64] | None = None) -> Index:
        """Sort points (p, 3) into cubes of an edge.

        Parameters
        ----------
        positions : (p, 3) float array
        edge : float
        origin : (3,) float array, optional
            Lowest corner of cell (0, 0, 0), not over any point; the lowest corner of their box where not given. Of a
            part of a cloud, that of the whole: then the part's cubes, and their order, are the whole's.

        Raises
        ------
        ResourceError
            Where the points reach farther than cubes can be numbered.
        """
        lowest, highest = box(positions)
        origin = lowest if origin is None else origin
        widest = float((highest - origin).max())
        most = EDGE << BITS
        if widest / edge >= most:
            raise ResourceError(
                "the points lie too far apart for their spacing",
                found=f"extent = {widest:g}",
                expected=f"at most {most * edge:g}",
                hint="leaving far points out",
            )
        room = np.empty((2, len(positions)), np.int64)
        for part in parts_of(len(positions)):
            room[0, part] = _keys_of(cells_at(positions[part], origin, edge))
        order, keys = sort_keys(room), room[0]
        groups = np.append(np.flatnonzero(np.append(True, keys[1:] != keys[:-1])), len(keys))
        cubes = keys[groups[:-1]]
        del room, keys
        blocks, block = _numbered(cubes // EDGE**3)
        count = np.zeros(len(blocks) * EDGE**3 + 1, np.int32)
        count[block * EDGE**3 + cubes % EDGE**3 + 1] = np.diff(groups)
        start = np.cumsum(count, dtype=np.int32)
        return cls(order.astype(np.int64), groups, blocks, start, np.append(origin, edge))

    @property
    def cells(self) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float64]]:
        """What kernels take: blocks, start and frame."""
        return self.blocks, self.start, self.frame


def _keys_of(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return a key for each cube (p, 3) that rises block by block, and within each by z, y and x."""
    x, y, z = cells.T
    local = ((z % EDGE) * EDGE + y % EDGE) * EDGE + x % EDGE
    return np.asarray(((((z // EDGE << BITS) | y // EDGE) << BITS) | x // EDGE) * EDGE**3 + local)


def _numbered(rising: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return each of some rising numbers once, and which of these each is."""
    new = np.append(True, rising[1:] != rising[:-1])
    return rising[new], np.cumsum(new) - 1
