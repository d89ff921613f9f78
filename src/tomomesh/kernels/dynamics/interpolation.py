"""A loop that looks straight down on a surface which goes through its samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from ..pointcloud.linear_algebra import solve, tangents
from ..pointcloud.samples import gather

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

NEAREST, FEWEST = 10, 6
"""Samples that a surface goes through around a place, and with how few there is none: a plane takes three. With eight
as the fewest that are asked for, half of the gain is lost (fandisk, torus)."""
BESIDE = -0.5
"""Least barycentric coordinate of a place among the samples: beyond it lies beside all of them, and is a guess."""
LEAST_COSINE = 0.7
"""Cosine of the angle between a sample's normal and the one at the place over which the surface goes through it: with
less, the far side of a sharp edge bends what is flat."""
SMOOTH = 1e-3
"""What is added to the diagonal: two samples in one place say no more than their mean."""


@kernel("i8(f8[:,::1], i8[::1], i4[::1], f8[::1], f8[::1], f8[::1], f8, i8[::1], f8[:,::1])")
def nearest_facing(
    samples: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    place: Floats,
    normal: Floats,
    reach: float,
    found: Integers,
    near: Floats,
) -> int:
    """List the samples nearest to a place that face as a normal there; return how many.

    Parameters
    ----------
    samples, blocks, start, frame, place, normal, reach : arrays and float
        See `tomomesh.kernels.dynamics.projections.project`.
    found : (m,) int64 array
        Room to work in.
    near : (NEAREST, 4) float array
        Result, the nearest first: the samples' coordinates along the two tangents and the normal, counted from the
        place, and their squared distance.
    """
    count, kept = gather(samples, blocks, start, frame, place, reach, found), 0
    order = np.empty(NEAREST, np.int64)
    for n in range(count):
        p = found[n]
        facing = squared = 0.0
        for axis in range(3):
            facing += normal[axis] * samples[p, 3 + axis]
            squared += (samples[p, axis] - place[axis]) ** 2
        if facing < LEAST_COSINE or (kept == NEAREST and squared >= near[kept - 1, 3]):
            continue
        at = min(kept, NEAREST - 1)
        while at > 0 and near[at - 1, 3] > squared:
            near[at, 3], order[at] = near[at - 1, 3], order[at - 1]
            at -= 1
        near[at, 3], order[at] = squared, p
        kept = min(kept + 1, NEAREST)
    axes = np.empty((2, 3))
    tangents(normal, axes)
    for n in range(kept):
        near[n, 0] = near[n, 1] = near[n, 2] = 0.0
        for axis in range(3):
            step = samples[order[n], axis] - place[axis]
            near[n, 0] += axes[0, axis] * step
            near[n, 1] += axes[1, axis] * step
            near[n, 2] += normal[axis] * step
    return kept


@kernel("void(f8[:,::1], i8)")
def widest_first(near: Floats, count: int) -> None:
    """Put three points that span a wide triangle in front: the farthest, the farthest from it, and from their line."""
    for corner in range(3):
        widest, most = corner, -1.0
        for n in range(corner, count):
            if corner == 0:
                wide = near[n, 0] ** 2 + near[n, 1] ** 2
            elif corner == 1:
                wide = (near[n, 0] - near[0, 0]) ** 2 + (near[n, 1] - near[0, 1]) ** 2
            else:
                wide = abs(
                    (near[1, 0] - near[0, 0]) * (near[n, 1] - near[0, 1])
                    - (near[1, 1] - near[0, 1]) * (near[n, 0] - near[0, 0])
                )
            if wide > most:
                widest, most = n, wide
        for column in range(3):
            near[corner, column], near[widest, column] = near[widest, column], near[corner, column]


@kernel("f8(f8[:,::1], i8)")
def height_between(near: Floats, count: int) -> float:
    """Return how high the smoothest surface through some points lies over the origin; not a number where none does.

    Parameters
    ----------
    near : (m, 4) float array
        Two coordinates and a height of each point; changed in place.
    count : int
        Points that are looked at.

    Notes
    -----
    A plane and a sum of cubed distances: of all linear estimates the one of least error for surfaces that bend along
    lines anywhere, in any direction (the slope jumps there, so that the square of a wave number k is k^-5 in the
    spectrum; Matheron 1973; Duchon 1977), and the same for points twice as far apart. What three points that span the
    plane say is taken from all others, which leaves a system that is positive.
    """
    widest_first(near, count)
    ax, ay = near[1, 0] - near[0, 0], near[1, 1] - near[0, 1]
    bx, by = near[2, 0] - near[0, 0], near[2, 1] - near[0, 1]
    area, size = ax * by - ay * bx, np.sqrt(ax * ax + ay * ay)
    if abs(area) < 0.05 * size * size:
        return np.nan
    shares, cubes = np.empty((NEAREST + 1, 3)), np.empty((NEAREST + 1, NEAREST + 1))
    near_u, near_v = np.empty(NEAREST + 1), np.empty(NEAREST + 1)
    for n in range(count + 1):  # the last one is the origin
        x = near[n, 0] if n < count else 0.0
        y = near[n, 1] if n < count else 0.0
        near_u[n], near_v[n] = x / size, y / size
        x, y = x - near[0, 0], y - near[0, 1]
        shares[n, 1], shares[n, 2] = (x * by - y * bx) / area, (ax * y - ay * x) / area
        shares[n, 0] = 1.0 - shares[n, 1] - shares[n, 2]
        for m in range(n):
            squared = (near_u[n] - near_u[m]) ** 2 + (near_v[n] - near_v[m]) ** 2
            cubes[n, m] = squared * np.sqrt(squared)
            cubes[m, n] = cubes[n, m]
        cubes[n, n] = 0.0
    for n in range(3, count + 1):  # what the three say is taken from the rows ...
        for m in range(count + 1):
            for b in range(3):
                cubes[n, m] -= shares[n, b] * cubes[b, m]
    if min(shares[count, 0], shares[count, 1], shares[count, 2]) < BESIDE:
        return np.nan
    rest = count - 3
    matrix, right = np.empty((NEAREST, NEAREST)), np.empty(NEAREST)
    for n in range(rest):
        row = 3 + n
        right[n] = near[row, 2]
        for b in range(3):
            right[n] -= shares[row, b] * near[b, 2]
        for m in range(n + 1):  # ... and the columns
            column = 3 + m
            matrix[n, m] = cubes[row, column]
            for b in range(3):
                matrix[n, m] -= shares[column, b] * cubes[row, b]
        matrix[n, n] += SMOOTH
    if not solve(matrix, right[:rest]):
        return np.nan
    height = 0.0
    for b in range(3):
        height += shares[count, b] * near[b, 2]
    for n in range(rest):
        column = 3 + n
        say = cubes[count, column]
        for b in range(3):
            say -= shares[column, b] * cubes[count, b]
        height += right[n] * say
    return height
