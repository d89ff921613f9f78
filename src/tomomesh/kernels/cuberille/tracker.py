"""The surface tracker of Gordon and Udupa (1989): from face to face of a set of cubes (see `bitmasks` and `faces`).

Around the z axis every face toward x or y has one successor: the next face of the closed line along which a plane
across z cuts the surface. Around the x axis every face toward y or z has one, likewise. So a face toward x or z lies
on one such cycle, is entered once and left once, and need not be remembered; a face toward y lies on two, and is
entered twice. Only these are marked when they are met, and passed over when they are met again.

A cycle is closed and runs along two axes, so each has faces toward y, where it meets a cycle of the other kind; and
the cycles reach all of a surface. For let two of its faces share an edge along y, over which no cycle leads. Around
an end of that edge the surface's faces stand in one ring. If they share no further edge along y, cycles lead over all
other edges of that ring, and so from one face to the other; if they do, the same holds for the pair across that edge,
one vertex further on, and a bounded surface ends somewhere.

A cube is one integer, 512 block + 64 z + 8 y + x; a face is 8 cube + direction, for -x, +x, -y, +y, -z and +z.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .bitmasks import ONE, ZERO, neighbor, popcount

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .bitmasks import Bitmask, Table


@kernel("i8(i4[:,::1], i8, i8, i8, i8)")
def cube_beside(table: Table, cube: int, dx: int, dy: int, dz: int) -> int:
    """Return the cube at (x + dx, y + dy, z + dz), steps of -1, 0 or 1, from one in a block with a row of neighbors."""
    x, y, z = (cube & 7) + dx, ((cube >> 3) & 7) + dy, ((cube >> 6) & 7) + dz
    block = table[cube >> 9, 13 + (x >> 3) + 3 * (y >> 3) + 9 * (z >> 3)]
    return 512 * int(block) + 64 * (z & 7) + 8 * (y & 7) + (x & 7)


@kernel("b1(u8[:,::1], i8)")
def contains(bitmask: Bitmask, cube: int) -> bool:
    """Tell whether a cube is in a set."""
    word = bitmask[cube >> 9, (cube >> 6) & 7]
    return bool((word >> np.uint64(cube & 63)) & ONE != ZERO)


@kernel("void(u8[:,::1], i8)")
def insert(bitmask: Bitmask, cube: int) -> None:
    """Add a cube to a set."""
    bitmask[cube >> 9, (cube >> 6) & 7] |= ONE << np.uint64(cube & 63)


@kernel("i8(u8[:,::1], i4[:,::1], i8, i8)")
def next_face(solid: Bitmask, table: Table, face: int, around: int) -> int:
    """Return the successor of a face on its cycle around an axis.

    With n the face's normal and t = axis x n, the way on leads up the cube before the face on the side of t, where
    there is one; else straight on over the cube beside; else down the side of the face's own cube.
    """
    cube, direction = face >> 3, face & 7
    axis, side = direction >> 1, direction & 1
    across = 3 - around - axis
    turn = side if across == (axis + 1) % 3 else 1 - side
    n, t = 2 * side - 1, 2 * turn - 1
    dx, dy, dz = t * (across == 0), t * (across == 1), t * (across == 2)
    beside = cube_beside(table, cube, dx, dy, dz)
    before = cube_beside(table, cube, dx + n * (axis == 0), dy + n * (axis == 1), dz + n * (axis == 2))
    if contains(solid, before):
        return 8 * before + 2 * across + 1 - turn
    return 8 * beside + direction if contains(solid, beside) else 8 * cube + 2 * across + turn


@kernel("void(i4[:,::1], i8, u8[:,:,::1], u8[:,::1])")
def visit(table: Table, face: int, exposed: NDArray[np.uint64], corners: Bitmask) -> None:
    """Add a face to the faces found, and its four corners to the vertices."""
    cube, direction = face >> 3, face & 7
    axis, side = direction >> 1, direction & 1
    insert(exposed[direction], cube)
    for one in range(2):
        for other in range(2):
            x = side if axis == 0 else one
            y = side if axis == 1 else (one if axis == 0 else other)
            insert(corners, cube_beside(table, cube, x, y, side if axis == 2 else other))


@kernel("i8(u8[:,::1], i4[:,::1], i8, u8[:,:,::1], u8[:,::1])")
def track_surface(solid: Bitmask, table: Table, seed: int, exposed: NDArray[np.uint64], corners: Bitmask) -> int:
    """Follow one surface from a face toward y, over its cycles, to all of its faces.

    Parameters
    ----------
    solid : (b + s, 8) uint64 array
        Well composed: of four cubes around an edge, those across a diagonal are never solid alone.
    table : (b, 27) int32 array
    seed : int
        A face toward -y or +y.
    exposed, corners : arrays
        As in `faces.scan_faces`, of the surfaces that were followed before. Result: of this one, too.

    Returns
    -------
    int
        Times that a face was entered.

    Notes
    -----
    Faces wait on a stack. Marks are never taken off, as they are in the paper, whose marks are a list that must be
    short to be searched: a bit is found at once, and what is marked is the result.
    """
    waiting = np.empty(64, np.int64)
    waiting[0], count, entered = seed, 1, 0
    visit(table, seed, exposed, corners)
    while count:
        count -= 1
        face = waiting[count]
        for around in (0, 2):
            if (face & 7) >> 1 == around:
                continue
            there = next_face(solid, table, face, around)
            entered += 1
            if (there & 7) >> 1 == 1 and contains(exposed[there & 7], there >> 3):
                continue
            visit(table, there, exposed, corners)
            if count == len(waiting):
                longer = np.empty(2 * count, np.int64)
                for n in range(count):
                    longer[n] = waiting[n]
                waiting = longer
            waiting[count] = there
            count += 1
    return entered


@kernel("i8(u8[:,::1], i4[:,::1], u8[:,:,::1], u8[:,::1])")
def track_faces(solid: Bitmask, table: Table, exposed: NDArray[np.uint64], corners: Bitmask) -> int:
    """Follow every surface of a set of cubes, each from its first face toward -y.

    Parameters
    ----------
    solid, table, exposed, corners : arrays
        As in `track_surface`; the last two are empty on entry.

    Returns
    -------
    int
        Times that a face was entered: once for each toward x or z, twice for each toward y.
    """
    entered = 0
    for b in range(len(table)):
        for z in range(8):
            seeds = solid[b, z] & ~neighbor(solid, table, b, z, 0, -1, 0) & ~exposed[2, b, z]
            while seeds != ZERO:
                bit = popcount((seeds & (~seeds + ONE)) - ONE)
                entered += track_surface(solid, table, 8 * (512 * b + 64 * z + bit) + 2, exposed, corners)
                seeds &= ~exposed[2, b, z]
    return entered
