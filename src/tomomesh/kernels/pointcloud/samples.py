"""Loops over points and their neighbors, sought among cubes that are sorted into blocks of 8 x 8 x 8.

The points stand in the order of their blocks, and within a block of their cubes along x, then y, then z. *Blocks*
are the keys of the occupied ones, rising; the points of cube c of block b are ``start[512 b + c]`` up to
``start[512 b + c + 1]``. A *frame* is the (4,) array of the lowest corner of cell (0, 0, 0) and the edge of the
cubes. `tomomesh.pointcloud.search` makes all three.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .linear_algebra import smallest_axis, solve, tangents

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

BITS = 18
"""Bits of a block's key for each axis. Three of them and 9 for a cube in its block fill a signed key of 64."""
SIGHT = 2.5
"""Standard deviations of a Gaussian weight that are looked at. The weight there is 4 % of the middle's, and all beyond
have 4 % of the whole. Chosen: with half of it a thin disk leaks, twice of it changes the distance by +46 %."""
MOST = 1024
"""Neighbors that are looked at; more of them, in a cloud of repeated points, change nothing. Chosen: half of it changes
the distance by +0.4 %, twice nothing."""
ENOUGH, TRIES, WIDER = 9, 3, 1.25
"""Neighbors that a quadratic, which has 6 terms, needs, how often it looks for them, and how much farther each time.
Chosen: half of each changes the distance by +14, +14 and +30 %, twice by +5, +0 and +9 %."""
STEEP = 0.35
"""Slope over which a neighbor does not belong to the surface under a plane. Chosen: half of it changes the distance by
+7.9 %, twice by -4.0 %."""
SAME_SIDE = 0.5
"""Cosine of the angle between normals over which points belong to one sheet. Chosen: half of it changes the distance by
-1.0 %, with twice of it no two points do (+202 %)."""
BEND = 8.0
"""How fast a neighbor's weight falls with 1 - cosine of the angle between the normals. Chosen: half of it changes the
distance by -10 %, twice by +21 %."""


@kernel("i8(i8[::1], i8)")
def block_number(blocks: Integers, wanted: int) -> int:
    """Return the number of a block among the rising ones, -1 where it is not there."""
    low, high = 0, len(blocks)
    while low < high:
        middle = (low + high) >> 1
        if blocks[middle] < wanted:
            low = middle + 1
        else:
            high = middle
    return low if low < len(blocks) and blocks[low] == wanted else -1


@kernel("i8(f8, f8, f8)")
def cell_at(place: float, low: float, edge: float) -> int:
    """Return the number of the cell along an axis that holds a place; 0 where it lies below all."""
    return int(np.floor(max((place - low) / edge, 0.0)))


@kernel("i8(f8[:,::1], i8[::1], i4[::1], f8[::1], f8[::1], f8, i8[::1])")
def gather(
    points: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    place: Floats,
    radius: float,
    found: Integers,
) -> int:
    """List the points (their first three columns) within a radius of a place; return how many, at most all of `found`.

    Notes
    -----
    Cubes that follow each other along x within a block are one range of points.
    """
    x, y, z, edge, squares = place[0], place[1], place[2], frame[3], radius * radius
    x0, x1 = cell_at(x - radius, frame[0], edge), cell_at(x + radius, frame[0], edge)
    y0, y1 = cell_at(y - radius, frame[1], edge), cell_at(y + radius, frame[1], edge)
    z0, z1 = cell_at(z - radius, frame[2], edge), cell_at(z + radius, frame[2], edge)
    count, room = 0, len(found)
    for bz in range(z0 >> 3, (z1 >> 3) + 1):
        for by in range(y0 >> 3, (y1 >> 3) + 1):
            for bx in range(x0 >> 3, (x1 >> 3) + 1):
                block = block_number(blocks, (((bz << BITS) | by) << BITS) | bx)
                if block < 0:
                    continue
                first, last = max(x0 - 8 * bx, 0), min(x1 - 8 * bx, 7)
                for cz in range(max(z0, 8 * bz), min(z1, 8 * bz + 7) + 1):
                    for cy in range(max(y0, 8 * by), min(y1, 8 * by + 7) + 1):
                        row = 512 * block + 64 * (cz - 8 * bz) + 8 * (cy - 8 * by)
                        for p in range(start[row + first], start[row + last + 1]):
                            squared = (points[p, 0] - x) ** 2 + (points[p, 1] - y) ** 2 + (points[p, 2] - z) ** 2
                            if squared <= squares and count < room:
                                found[count] = p
                                count += 1
    return count


@kernel("void(f8[:,::1], i8[::1], i4[::1], f8[::1], f8[::1], f8[:,::1], i8, i8)")
def fit_planes(
    points: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    width: Floats,
    planes: Floats,
    begin: int,
    end: int,
) -> None:
    """Fit a plane to the neighbors of each point, with Gaussian weights (Hoppe et al. 1992).

    Parameters
    ----------
    points : (p, 4) float array
        Position and mass.
    blocks, start, frame : arrays
    width : (p,) float array
        Standard deviation of the weights; points where it is 0 are passed over.
    planes : (p, 5) float array
        Result: unit normal of either sign, height of the plane over the point along it, and the root mean square
        distance of the neighbors from the plane.
    begin, end : int
        Points to work on.
    """
    found, weights = np.empty(MOST, np.int64), np.empty(MOST)
    spread, mean = np.empty((3, 3)), np.empty(3)
    for p in range(begin, end):
        if width[p] == 0.0:
            continue
        count = gather(points, blocks, start, frame, points[p], SIGHT * width[p], found)
        total = 0.0
        mean[:] = 0.0
        for n in range(count):
            q = found[n]
            squared = 0.0
            for axis in range(3):
                squared += (points[q, axis] - points[p, axis]) ** 2
            weights[n] = points[q, 3] * np.exp(-0.5 * squared / (width[p] * width[p]))
            total += weights[n]
            for axis in range(3):
                mean[axis] += weights[n] * (points[q, axis] - points[p, axis])
        for axis in range(3):
            mean[axis] /= total
        spread[:] = 0.0
        for n in range(count):
            q = found[n]
            for i in range(3):
                for j in range(i + 1):
                    a = points[q, i] - points[p, i] - mean[i]
                    b = points[q, j] - points[p, j] - mean[j]
                    spread[i, j] += weights[n] * a * b
        for i in range(3):
            for j in range(i):
                spread[j, i] = spread[i, j]
        smallest_axis(spread, planes[p, :3])
        planes[p, 3] = mean[0] * planes[p, 0] + mean[1] * planes[p, 1] + mean[2] * planes[p, 2]
        planes[p, 4] = np.sqrt(max(spread[0, 0], 0.0) / total)


@kernel("f8(f8[:,::1], i8, f8[:,::1], f8[::1])")
def add_terms(rows: Floats, used: int, matrix: Floats, right: Floats) -> float:
    """Add up the normal equations of a quadratic 1, u, v, u^2, u v, v^2 over rows of u, v, height and weight.

    Only the lower half of the (6, 6) matrix is written. Returns the sum of the weights. One number a moment: they stay
    in registers.
    """
    total = wu = wv = wuu = wuv = wvv = wuuu = wuuv = wuvv = wvvv = 0.0
    wuuuu = wuuuv = wuuvv = wuvvv = wvvvv = wh = wuh = wvh = wuuh = wuvh = wvvh = 0.0
    for n in range(used):
        u, v, h, w = rows[n, 0], rows[n, 1], rows[n, 2], rows[n, 3]
        uu, uv, vv = u * u, u * v, v * v
        a, b, c, d, e = w * u, w * v, w * uu, w * uv, w * vv
        total, wu, wv, wuu, wuv, wvv = total + w, wu + a, wv + b, wuu + c, wuv + d, wvv + e
        wuuu, wuuv, wuvv, wvvv = wuuu + c * u, wuuv + c * v, wuvv + e * u, wvvv + e * v
        wuuuu, wuuuv, wuuvv = wuuuu + c * uu, wuuuv + c * uv, wuuvv + c * vv
        wuvvv, wvvvv = wuvvv + e * uv, wvvvv + e * vv
        wh, wuh, wvh = wh + w * h, wuh + a * h, wvh + b * h
        wuuh, wuvh, wvvh = wuuh + c * h, wuvh + d * h, wvvh + e * h
    right[0], right[1], right[2], right[3], right[4], right[5] = wh, wuh, wvh, wuuh, wuvh, wvvh
    matrix[0, 0], matrix[1, 0], matrix[1, 1] = total, wu, wuu
    matrix[2, 0], matrix[2, 1], matrix[2, 2] = wv, wuv, wvv
    matrix[3, 0], matrix[3, 1], matrix[3, 2], matrix[3, 3] = wuu, wuuu, wuuv, wuuuu
    matrix[4, 0], matrix[4, 1], matrix[4, 2], matrix[4, 3], matrix[4, 4] = wuv, wuuv, wuvv, wuuuv, wuuvv
    matrix[5, 0], matrix[5, 1], matrix[5, 2], matrix[5, 3], matrix[5, 4] = wvv, wuvv, wvvv, wuuvv, wuvvv
    matrix[5, 5] = wvvvv
    return float(total)


@kernel("void(f8[:,::1], f8[:,::1], i8[::1], i4[::1], f8[::1], f8[::1], b1[::1], f8[:,::1], i8, i8)")
def settle(
    points: Floats,
    planes: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    width: Floats,
    stray: NDArray[np.bool_],
    settled: Floats,
    begin: int,
    end: int,
) -> None:
    """Move each point onto a quadratic fitted to the heights of its neighbors over its plane.

    Which neighbors count, and how much, is told by their own planes, so that another sheet nearby or the far side
    of an edge has no say; what they say are their measured positions.

    Parameters
    ----------
    points : (p, 4) float array
        Position and mass.
    planes : (p, 5) float array
        From `fit_planes`.
    blocks, start, frame : arrays
    width : (p,) float array
        Standard deviation of the weights.
    stray : (p,) bool array
        Points that are not looked at.
    settled : (p, 8) float array
        Result: position, unit normal, the root mean square distance of the neighbors from the quadratic, and half of
        its Laplacian: how fast it rises along the normal, 1 / length.
    begin, end : int
        Points to work on.
    """
    found, axes = np.empty(MOST, np.int64), np.empty((2, 3))
    matrix, right, rows = np.empty((6, 6)), np.empty(6), np.empty((MOST, 4))
    for p in range(begin, end):
        h = width[p]
        tangents(planes[p, :3], axes)
        used = 0
        for _ in range(TRIES):
            count = gather(points, blocks, start, frame, points[p], SIGHT * h + abs(planes[p, 3]), found)
            used = 0
            for n in range(count):
                q = found[n]
                if stray[q]:
                    continue
                same = height = raw = u = v = 0.0
                for axis in range(3):
                    normal = planes[p, axis]
                    moved = points[q, axis] + planes[q, 3] * planes[q, axis] - points[p, axis] - planes[p, 3] * normal
                    same += normal * planes[q, axis]
                    height += normal * moved
                    raw += normal * (points[q, axis] - points[p, axis])
                    u += axes[0, axis] * moved
                    v += axes[1, axis] * moved
                flat = u * u + v * v
                if abs(same) < SAME_SIDE or abs(height) > 2 * planes[p, 4] + STEEP * np.sqrt(flat):
                    continue
                rows[used, 0], rows[used, 1], rows[used, 2] = u / h, v / h, (raw - planes[p, 3]) / h
                bent = 0.5 * (flat + height * height) / (h * h) + BEND * (1 - abs(same))
                rows[used, 3] = points[q, 3] * np.exp(-bent)
                used += 1
            if used >= ENOUGH:
                break
            h *= WIDER
        h = h / WIDER if used < ENOUGH else h
        total = add_terms(rows, used, matrix, right)
        # a millionth of the weights on the diagonal: neighbors on a line leave some of the six terms open
        for i in range(6):
            matrix[i, i] += 1e-6 * total
        if used < 8 or not solve(matrix, right):
            right[:] = 0.0
        squares = 0.0
        for n in range(used):
            u, v = rows[n, 0], rows[n, 1]
            bend = right[3] * u * u + right[4] * u * v + right[5] * v * v
            squares += rows[n, 3] * (rows[n, 2] - right[0] - right[1] * u - right[2] * v - bend) ** 2
        settled[p, 6] = h * np.sqrt(squares / max(total, 1e-300))
        settled[p, 7] = (right[3] + right[5]) / h
        length = np.sqrt(1 + right[1] ** 2 + right[2] ** 2)
        for axis in range(3):
            settled[p, axis] = points[p, axis] + (planes[p, 3] + h * right[0]) * planes[p, axis]
            tilt = right[1] * axes[0, axis] + right[2] * axes[1, axis]
            settled[p, 3 + axis] = (planes[p, axis] - tilt) / length
