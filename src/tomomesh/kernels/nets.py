"""Loops over the faces of a surface whose vertices each stay in a cell of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

APART = 1e-9
"""Volume over which four points count as turning the right way, in cells: far above what rounding leaves."""


@kernel("void(f8[:,::1], i4[:,::1], f8[:,::1], i8, i8)")
def mean_of(
    values: NDArray[np.float64], members: NDArray[np.int32], means: NDArray[np.float64], start: int, stop: int
) -> None:
    """Average rows of an array over lists of them.

    Parameters
    ----------
    values : (n, 3) float array
    members : (m, s) int32 array
        Rows of `values`, one at least; -1 stands for none.
    means : (m, 3) float array
        Result.
    start, stop : int
        Lists to work on.

    Notes
    -----
    The axes are summed side by side, which takes 0.4 of the time that a loop over them does.
    """
    for m in range(start, stop):
        x = y = z = 0.0
        count = 0
        for s in range(members.shape[1]):
            n = members[m, s]
            if n >= 0:
                x += values[n, 0]
                y += values[n, 1]
                z += values[n, 2]
                count += 1
        share = 1.0 / count
        means[m, 0], means[m, 1], means[m, 2] = x * share, y * share, z * share


@kernel("void(f8[::1], f8[::1], f8[::1], f8[::1])")
def normal_of(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], normal: NDArray[np.float64]
) -> None:
    """Write the normal of a triangle, as long as twice its area."""
    for axis in range(3):
        p, q = (axis + 1) % 3, (axis + 2) % 3
        normal[axis] = (b[p] - a[p]) * (c[q] - a[q]) - (b[q] - a[q]) * (c[p] - a[p])


@kernel("f8(f8[::1], f8[::1], f8[::1], i8, f8)")
def least_side(
    normal: NDArray[np.float64], on: NDArray[np.float64], cross: NDArray[np.float64], axis: int, sign: float
) -> float:
    """Return how far a plane keeps the two voxels of a crossing apart: negative where both lie on one side.

    `sign` is 1 where the outside lies towards the larger coordinate along `axis`, else -1.
    """
    here = 0.0
    for n in range(3):
        here += normal[n] * (cross[n] - on[n])
    low = np.floor(cross[axis]) - cross[axis]
    at_low = here + normal[axis] * low
    at_high = at_low + normal[axis]
    return float(min(-sign * at_low, sign * at_high))


@kernel("void(f8[:,::1], f8[:,::1], i4[:,::1], f8[:,::1], u1[::1], i8[:,:,::1], b1[::1], i8, i8)")
def split_squares(
    positions: NDArray[np.float64],
    placed: NDArray[np.float64],
    quads: NDArray[np.int32],
    crossings: NDArray[np.float64],
    directions: NDArray[np.uint8],
    halves: NDArray[np.int64],
    apart: NDArray[np.bool_],
    start: int,
    stop: int,
) -> None:
    """Split every square by the diagonal that bends it least, among those that keep its two voxels apart.

    Parameters
    ----------
    positions, placed : (n, 3) float arrays
        The vertices, in voxels and in millimeters.
    quads : (q, 4) int32 array
    crossings : (q, 3) float array
        Where each square crosses the line between its two voxels, in voxels.
    directions : (q,) uint8 array
        The direction of that line, from inside to outside.
    halves : (q, 2, 3) int64 array
        Result: two triangles a square.
    apart : (q,) bool array
        Result: whether they keep the voxels apart; where not, neither diagonal does.
    start, stop : int
        Squares to work on.

    Notes
    -----
    The voxels and the four vertices around the line between them make an octahedron. Two triangles lie inside it
    where each has the inner voxel behind it and the outer one before it.
    """
    normals, bends = np.empty((2, 3)), np.empty((2, 3))
    for f in range(start, stop):
        axis, sign = directions[f] >> 1, 1.0 if directions[f] & 1 else -1.0
        best = -2.0
        apart[f] = False
        for turn in range(2):
            least = np.inf
            for half in range(2):
                a, b = quads[f, turn], quads[f, turn + 1 + half]
                c = quads[f, (turn + 2 + half) % 4]
                normal_of(positions[a], positions[b], positions[c], normals[half])
                normal_of(placed[a], placed[b], placed[c], bends[half])
                least = min(least, least_side(normals[half], positions[a], crossings[f], axis, sign))
            together = first = second = 0.0
            for n in range(3):
                together += bends[0, n] * bends[1, n]
                first += bends[0, n] * bends[0, n]
                second += bends[1, n] * bends[1, n]
            flat = together / np.sqrt(max(first * second, 1e-300))
            if least > APART and flat > best:
                best = flat
                apart[f] = True
                for half in range(2):
                    halves[f, half, 0] = quads[f, turn]
                    halves[f, half, 1] = quads[f, turn + 1 + half]
                    halves[f, half, 2] = quads[f, (turn + 2 + half) % 4]
