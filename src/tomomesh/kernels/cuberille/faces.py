"""Loops that find the square faces between the cubes of a bitmask and empty ones, and list them (see `bitmasks`).

The faces of a set are six bitmasks, (6, b + s, 8): the cubes that have a face toward -x, +x, -y, +y, -z and +z.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .bitmasks import ALL, ONE, ZERO, neighbor, popcount

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .bitmasks import Bitmask, Table


@kernel("u8(u8[:,::1], i4[:,::1], i8, i8)")
def mixed_corners(solid: Bitmask, table: Table, b: int, z: int) -> np.uint64:
    """Return which cubes of a word have solid and empty ones around their lowest corner."""
    some, every = ZERO, ALL
    for dz in (-1, 0):
        for dy in (-1, 0):
            for dx in (-1, 0):
                word = neighbor(solid, table, b, z, dx, dy, dz)
                some |= word
                every &= word
    return some & ~every


@kernel("void(u8[:,::1], i4[:,::1], u8[:,:,::1], u8[:,::1])")
def scan_faces(solid: Bitmask, table: Table, exposed: NDArray[np.uint64], corners: Bitmask) -> None:
    """Find every face between solid cubes and empty ones, looking at all cubes.

    Parameters
    ----------
    solid : (b + s, 8) uint64 array
    table : (b, 27) int32 array
    exposed : (6, b + s, 8) uint64 array
        Result: the faces.
    corners : (b + s, 8) uint64 array
        Result: the cubes whose lowest corner is a vertex.
    """
    for b in range(len(table)):
        for z in range(8):
            corners[b, z] = mixed_corners(solid, table, b, z)
            for direction in range(6):
                axis, step = direction >> 1, 2 * (direction & 1) - 1
                dx, dy, dz = step * (axis == 0), step * (axis == 1), step * (axis == 2)
                exposed[direction, b, z] = solid[b, z] & ~neighbor(solid, table, b, z, dx, dy, dz)


@kernel("i8(u8[:,::1], i4[:,::1], i8[:,::1], i8, i8, i8, i8)")
def corner_number(corners: Bitmask, table: Table, before: NDArray[np.int64], b: int, x: int, y: int, z: int) -> int:
    """Return the number of the vertex at a corner (x, y, z), 0 to 8, of a block."""
    there = table[b, 13 + (x >> 3) + 3 * (y >> 3) + 9 * (z >> 3)]
    mask = (ONE << np.uint64(8 * (y & 7) + (x & 7))) - ONE
    return int(before[there, z & 7]) + popcount(corners[there, z & 7] & mask)


@kernel("void(u8[:,:,::1], i4[:,::1], u8[:,::1], i8[:,::1], i8[:,:,::1], i4[:,::1], i4[:,::1])")
def list_faces(
    exposed: NDArray[np.uint64],
    table: Table,
    corners: Bitmask,
    before: NDArray[np.int64],
    squares: NDArray[np.int64],
    quads: NDArray[np.int32],
    cubes: NDArray[np.int32],
) -> None:
    """List the square faces of the surface, counter-clockwise seen from the empty side, block by block.

    Parameters
    ----------
    exposed, corners : arrays
        From `scan_faces` or `tracker.track_faces`.
    table : (b, 27) int32 array
    before : (b, 8) int64 array
        Vertices before each word of `corners`.
    squares : (6, 4, 3) int64 array
        Corners of the unit cube's faces, for the directions -x, +x, -y, +y, -z, +z.
    quads : (q, 4) int32 array
        Result: vertex numbers.
    cubes : (q, 2) int32 array
        Result: block, and place within the block, of the cube behind each face.
    """
    n = 0
    for b in range(len(table)):
        for z in range(8):
            for direction in range(6):
                word = exposed[direction, b, z]
                while word != ZERO:
                    bit = popcount((word & (~word + ONE)) - ONE)
                    for corner in range(4):
                        x = (bit & 7) + squares[direction, corner, 0]
                        y = (bit >> 3) + squares[direction, corner, 1]
                        quads[n, corner] = corner_number(
                            corners, table, before, b, x, y, z + squares[direction, corner, 2]
                        )
                    cubes[n, 0], cubes[n, 1] = b, 64 * z + bit
                    word &= word - ONE
                    n += 1


@kernel("i8(i4[:,::1], i4[::1])")
def label_quads(quads: NDArray[np.int32], labels: NDArray[np.int32]) -> int:
    """Label the vertices of squares by the connected surface that they belong to.

    Parameters
    ----------
    quads : (q, 4) int32 array
        Vertex numbers.
    labels : (n,) int32 array
        Result: number of the surface, in the order of its first vertex.

    Returns
    -------
    int
        Number of surfaces.

    Notes
    -----
    A forest in which every vertex points to an earlier one, or to itself at a root; paths are halved as they are
    walked.
    """
    for v in range(len(labels)):
        labels[v] = v
    for q in range(len(quads)):
        for corner in range(3):
            a, b = quads[q, corner], quads[q, corner + 1]
            while labels[a] != a:
                labels[a] = labels[labels[a]]
                a = labels[a]
            while labels[b] != b:
                labels[b] = labels[labels[b]]
                b = labels[b]
            labels[max(a, b)] = min(a, b)
    count = 0
    for v in range(len(labels)):
        if labels[v] == v:
            labels[v] = -1 - count
            count += 1
        else:
            labels[v] = labels[labels[v]]
    for v in range(len(labels)):
        labels[v] = -1 - labels[v]
    return count
