"""Loops over the squares of a net, whose vertices each stay in a cell of their own: by which diagonal to split them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

APART = 1e-9
"""Volume over which four points count as turning the right way, in cells: far above what rounding leaves."""
NEITHER, OPEN = 2, 3
"""What is chosen for a square that no diagonal may split, and for one that is still to be split."""


@kernel("void(f8[:,::1], i4[:,::1], i8, i8, i8, f8[::1])")
def half_normal(
    places: NDArray[np.float64], quads: NDArray[np.int32], f: int, turn: int, half: int, normal: NDArray[np.float64]
) -> None:
    """Write the normal of half a square, as long as twice its area.

    Square f (of (q, 4), over places (n, 3)) is split between its corners `turn` and `turn` + 2; half 0 has the corner
    after the first of them.
    """
    a, b, c = quads[f, turn], quads[f, turn + 1 + half], quads[f, (turn + 2 + half) % 4]
    for axis in range(3):
        p, q = (axis + 1) % 3, (axis + 2) % 3
        first = (places[b, p] - places[a, p]) * (places[c, q] - places[a, q])
        normal[axis] = first - (places[b, q] - places[a, q]) * (places[c, p] - places[a, p])


@kernel("void(f8[:,::1], i4[:,::1], f8[:,::1], u1[::1], u1[::1], i8, i8)")
def allow_diagonals(
    positions: NDArray[np.float64],
    quads: NDArray[np.int32],
    crossings: NDArray[np.float64],
    directions: NDArray[np.uint8],
    allowed: NDArray[np.uint8],
    start: int,
    stop: int,
) -> None:
    """Find the diagonals whose two triangles keep the inner voxel of a square behind them, and the outer before.

    Parameters
    ----------
    positions : (n, 3) float array
        The vertices, in voxels.
    quads : (q, 4) int32 array
    crossings : (q, 3) float array
        A place on the line between the two voxels of each square.
    directions : (q,) uint8 array
        The direction of that line, from inside to outside.
    allowed : (q,) uint8 array
        Result: 1 for the diagonal between corners 0 and 2, and 2 for that between 1 and 3, added.
    start, stop : int
        Squares to work on.

    Notes
    -----
    The two voxels and the four vertices around the line between them make an octahedron. Where the triangles keep the
    voxels apart they lie inside it.
    """
    normal = np.empty(3)
    for f in range(start, stop):
        axis, sign = directions[f] >> 1, 1.0 if directions[f] & 1 else -1.0
        low = np.floor(crossings[f, axis]) - crossings[f, axis]
        allowed[f] = 0
        for turn in range(2):
            least = np.inf
            for half in range(2):
                half_normal(positions, quads, f, turn, half, normal)
                here = 0.0
                for n in range(3):
                    here += normal[n] * (crossings[f, n] - positions[quads[f, turn], n])
                here += normal[axis] * low
                least = min(least, -sign * here, sign * (here + normal[axis]))
            if least > APART:
                allowed[f] += 1 << turn


@kernel("void(f8[:,::1], i4[:,::1], f4[:,:,::1], i8, i8)")
def list_normals(
    placed: NDArray[np.float64], quads: NDArray[np.int32], normals: NDArray[np.float32], start: int, stop: int
) -> None:
    """Find the unit normals of the halves of squares, two by the diagonal from corner 0 and two by that from corner 1.

    Parameters
    ----------
    placed : (n, 3) float array
        The vertices in space.
    quads : (q, 4) int32 array
    normals : (q, 4, 3) float32 array
        Result.
    start, stop : int
        Squares to work on.
    """
    own = np.empty(3)
    for f in range(start, stop):
        for n in range(4):
            half_normal(placed, quads, f, n >> 1, n & 1, own)
            share = 1.0 / np.sqrt(max(own[0] * own[0] + own[1] * own[1] + own[2] * own[2], 1e-300))
            normals[f, n, 0], normals[f, n, 1], normals[f, n, 2] = share * own[0], share * own[1], share * own[2]


@kernel("f8(f4[:,:,::1], i8, i8, i8, i8)")
def bend(normals: NDArray[np.float32], f: int, half: int, g: int, other: int) -> float:
    """Return 1 - cos of the angle between two halves of squares, see `list_normals`."""
    one, two = normals[f, half], normals[g, other]
    return float(1.0 - (one[0] * two[0] + one[1] * two[1] + one[2] * two[2]))


@kernel("void(f4[:,:,::1], i4[:,::1], u1[::1], u1[::1], b1[::1], b1, u1[::1], i8, i8)")
def choose_diagonals(
    normals: NDArray[np.float32],
    twins: NDArray[np.int32],
    allowed: NDArray[np.uint8],
    choice: NDArray[np.uint8],
    turns: NDArray[np.bool_],
    alone: bool,
    chosen: NDArray[np.uint8],
    start: int,
    stop: int,
) -> None:
    """Choose the diagonal of some squares by which it bends least, in itself and towards its four neighbors.

    Parameters
    ----------
    normals : (q, 4, 3) float32 array
        Of `list_normals`.
    twins : (q, 4) int32 array
        What is beyond each side, see `tomomesh.kernels.isosurface.voxels.list_fans`; -1 where more than one square is.
    allowed : (q,) uint8 array
        See `allow_diagonals`.
    choice : (q,) uint8 array
        How the squares are split: 0 or 1 for the diagonal from that corner, `NEITHER` or `OPEN`. Neighbors that are
        not split have no say.
    turns : (q,) bool array
        The squares that choose; the others keep what they have.
    alone : bool
        Whether no square is split yet, so that no neighbor has a say.
    chosen : (q,) uint8 array
        Result.
    start, stop : int
        Squares to work on.
    """
    for f in range(start, stop):
        chosen[f] = choice[f]
        if not turns[f] or allowed[f] == 0:
            continue
        first = bend(normals, f, 0, f, 1) if allowed[f] & 1 else np.inf
        second = bend(normals, f, 2, f, 3) if allowed[f] & 2 else np.inf
        for side in range(0 if alone else 4):
            beyond, there = twins[f, side] >> 2, twins[f, side] & 3
            turned = int(choice[beyond]) if beyond >= 0 else NEITHER
            if turned < NEITHER:
                other = 2 * turned + ((there - turned & 3) >> 1)
                first += bend(normals, f, side >> 1, beyond, other)
                second += bend(normals, f, 2 + ((side - 1 & 3) >> 1), beyond, other)
        chosen[f] = second < first


@kernel("void(i4[:,::1], u1[::1], b1, i8[:,:,::1], i8, i8)")
def split_squares(
    quads: NDArray[np.int32], choice: NDArray[np.uint8], outward: bool, halves: NDArray[np.int64], start: int, stop: int
) -> None:
    """Split squares (q, 4) by the diagonals that were chosen into triangles (q, 2, 3), turned over where not outward.

    One that neither splits is split by the first.
    """
    for f in range(start, stop):
        turn = int(choice[f] == 1)
        for half in range(2):
            for corner in range(3):
                place = turn + (half + corner if corner > 0 else 0)
                halves[f, half, corner if outward else 2 - corner] = quads[f, place % 4]
