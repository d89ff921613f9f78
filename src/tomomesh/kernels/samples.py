"""Loops over points and their neighbors, sought row by row among sorted cubes.

The points stand in the order of their cubes, and ``start[q]:start[q + 1]`` are those of cube q. Cubes that follow
each other along x have consecutive keys, so that all points of a row of cubes are one range. A *frame* is the
(4,) array of the lowest corner of cell (0, 0, 0) and the edge of the cubes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

SIDE = 1 << 21
MARGIN = 256
"""As in `tomomesh.model.cubes`, which packs cells into keys."""
SIGHT = 2.5
"""Standard deviations of a Gaussian weight that are looked at."""
MOST = 1024
"""Neighbors that are looked at; more of them, in a cloud of repeated points, change nothing."""
STEEP = 0.35
"""Slope over which a neighbor does not belong to the surface under a plane."""
ALIKE = 0.5
"""Cosine of the angle between normals over which points belong to one sheet."""
BEND = 8.0
"""How fast a neighbor's weight falls with 1 - cosine of the angle between the normals."""


@kernel("i8(i8[::1], i8)")
def first_at_least(keys: Integers, wanted: int) -> int:
    """Return the number of the first key that is not below the one wanted."""
    low, high = 0, len(keys)
    while low < high:
        middle = (low + high) >> 1
        if keys[middle] < wanted:
            low = middle + 1
        else:
            high = middle
    return low


@kernel("void(f8[::1], f8[::1], i8[::1])")
def cell_of(place: Floats, frame: Floats, cell: Integers) -> None:
    """Return the cell (3,) of a place (3,)."""
    for axis in range(3):
        cell[axis] = np.int64(np.floor((place[axis] - frame[axis]) / frame[3]))


@kernel("i8(f8[:,::1], i8[::1], i8[::1], f8[::1], f8[::1], f8, i8[::1])")
def gather(
    points: Floats, keys: Integers, start: Integers, frame: Floats, place: Floats, radius: float, found: Integers
) -> int:
    """List the points (their first three columns) within a radius of a place; return how many, at most `MOST`."""
    cell = np.empty(3, np.int64)
    cell_of(place, frame, cell)
    reach = np.int64(np.ceil(radius / frame[3]))
    count = 0
    for dz in range(-reach, reach + 1):
        for dy in range(-reach, reach + 1):
            row = ((cell[2] + dz + MARGIN) * SIDE + cell[1] + dy + MARGIN) * SIDE + cell[0] + MARGIN
            q = first_at_least(keys, row - reach)
            while q < len(keys) and keys[q] <= row + reach:
                for p in range(start[q], start[q + 1]):
                    squared = 0.0
                    for axis in range(3):
                        squared += (points[p, axis] - place[axis]) ** 2
                    if squared <= radius * radius and count < len(found):
                        found[count] = p
                        count += 1
                q += 1
    return count


@kernel("void(f8[:,::1], i8[::1], i8[::1], f8[::1], f8, f8[::1], i8, i8)")
def local_spacing(
    points: Floats,
    keys: Integers,
    start: Integers,
    frame: Floats,
    radius: float,
    spacing: Floats,
    begin: int,
    end: int,
) -> None:
    """Estimate how far apart the points lie around each of them, from how many there are within a radius.

    Parameters
    ----------
    points : (p, 3) float array
    keys, start, frame : arrays
    radius : float
        Where to begin; it is doubled while it holds fewer than 8 points, and halved while it holds over 64.
    spacing : (p,) float array
        Result: sqrt(pi radius^2 / points), infinite where not even 16 radii hold 8 points.
    begin, end : int
        Points to work on.
    """
    found = np.empty(MOST, np.int64)
    for p in range(begin, end):
        sight = radius
        count = gather(points, keys, start, frame, points[p], sight, found)
        while count < 8 and sight < 16 * radius:
            sight *= 2
            count = gather(points, keys, start, frame, points[p], sight, found)
        while count > 64 and sight > radius / 16:
            sight /= 2
            count = gather(points, keys, start, frame, points[p], sight, found)
        spacing[p] = sight * np.sqrt(np.pi / max(count, 1)) if count >= 8 or sight < radius else np.inf


@kernel("void(f8[:,::1], f8[::1])")
def smallest_axis(matrix: Floats, axis: Floats) -> None:
    """Find the eigenvector (3,) of the smallest eigenvalue of a symmetric (3, 3) matrix by Jacobi's rotations.

    The matrix is overwritten: its smallest diagonal entry becomes that eigenvalue.
    """
    vectors = np.eye(3)
    for _ in range(8):
        off = matrix[0, 1] ** 2 + matrix[0, 2] ** 2 + matrix[1, 2] ** 2
        if off <= 1e-24 * (matrix[0, 0] ** 2 + matrix[1, 1] ** 2 + matrix[2, 2] ** 2):
            break
        for i in range(2):
            for j in range(i + 1, 3):
                if matrix[i, j] == 0.0:
                    continue
                ratio = (matrix[j, j] - matrix[i, i]) / (2 * matrix[i, j])
                t = 1 / (abs(ratio) + np.sqrt(ratio * ratio + 1))
                t = -t if ratio < 0 else t
                c = 1 / np.sqrt(t * t + 1)
                s = t * c
                for k in range(3):
                    a, b = matrix[k, i], matrix[k, j]
                    matrix[k, i], matrix[k, j] = c * a - s * b, s * a + c * b
                for k in range(3):
                    a, b = matrix[i, k], matrix[j, k]
                    matrix[i, k], matrix[j, k] = c * a - s * b, s * a + c * b
                    a, b = vectors[k, i], vectors[k, j]
                    vectors[k, i], vectors[k, j] = c * a - s * b, s * a + c * b
    least = 0
    for i in range(1, 3):
        if matrix[i, i] < matrix[least, least]:
            least = i
    matrix[0, 0] = matrix[least, least]
    for k in range(3):
        axis[k] = vectors[k, least]


@kernel("void(f8[:,::1], i8[::1], i8[::1], f8[::1], f8[::1], f8[:,::1], i8, i8)")
def fit_planes(
    points: Floats,
    keys: Integers,
    start: Integers,
    frame: Floats,
    width: Floats,
    planes: Floats,
    begin: int,
    end: int,
) -> None:
    """Fit a plane to the neighbors of each point, with Gaussian weights (Hoppe et al. 1992).

    Parameters
    ----------
    points : (p, 3) float array
    keys, start, frame : arrays
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
        count = gather(points, keys, start, frame, points[p], SIGHT * width[p], found)
        total = 0.0
        mean[:] = 0.0
        for n in range(count):
            q = found[n]
            squared = 0.0
            for axis in range(3):
                squared += (points[q, axis] - points[p, axis]) ** 2
            weights[n] = np.exp(-0.5 * squared / (width[p] * width[p]))
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


@kernel("b1(f8[:,::1], f8[::1])")
def solve(matrix: Floats, right: Floats) -> bool:
    """Solve a symmetric positive system by Cholesky's factors, in place; tell whether it could be solved."""
    size = len(right)
    for i in range(size):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= matrix[i, k] * matrix[j, k]
            if i == j:
                if rest <= 1e-12:
                    return False
                matrix[i, i] = np.sqrt(rest)
            else:
                matrix[i, j] = rest / matrix[j, j]
    for i in range(size):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
    return True


@kernel("void(f8[::1], f8[:,::1])")
def tangents(normal: Floats, axes: Floats) -> None:
    """Find two unit vectors (2, 3) that are perpendicular to a unit normal (3,) and to each other."""
    least = 0
    for axis in range(1, 3):
        if abs(normal[axis]) < abs(normal[least]):
            least = axis
    length = np.sqrt(1 - normal[least] ** 2)
    one, two = (least + 1) % 3, (least + 2) % 3
    axes[0, least] = 0.0
    axes[0, one], axes[0, two] = -normal[two] / length, normal[one] / length
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        axes[1, axis] = normal[one] * axes[0, two] - normal[two] * axes[0, one]


@kernel("void(f8[:,::1], f8[:,::1], i8[::1], i8[::1], f8[::1], f8[::1], b1[::1], f8[:,::1], i8, i8)")
def settle(
    points: Floats,
    planes: Floats,
    keys: Integers,
    start: Integers,
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
    points : (p, 3) float array
    planes : (p, 5) float array
        From `fit_planes`.
    keys, start, frame : arrays
    width : (p,) float array
        Standard deviation of the weights.
    stray : (p,) bool array
        Points that are not looked at.
    settled : (p, 7) float array
        Result: position, unit normal, and the root mean square distance of the neighbors from the quadratic.
    begin, end : int
        Points to work on.
    """
    found, axes = np.empty(MOST, np.int64), np.empty((2, 3))
    matrix, right, terms, rows = np.empty((6, 6)), np.empty(6), np.empty(6), np.empty((MOST, 4))
    for p in range(begin, end):
        h = width[p]
        tangents(planes[p, :3], axes)
        count = gather(points, keys, start, frame, points[p], SIGHT * h + abs(planes[p, 3]), found)
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
            if abs(same) < ALIKE or abs(height) > 2 * planes[p, 4] + STEEP * np.sqrt(flat):
                continue
            rows[used, 0], rows[used, 1], rows[used, 2] = u / h, v / h, (raw - planes[p, 3]) / h
            rows[used, 3] = np.exp(-0.5 * (flat + height * height) / (h * h) - BEND * (1 - abs(same)))
            used += 1
        matrix[:] = 0.0
        right[:] = 0.0
        total = 0.0
        for n in range(used):
            u, v, w = rows[n, 0], rows[n, 1], rows[n, 3]
            terms[0], terms[1], terms[2], terms[3], terms[4], terms[5] = 1.0, u, v, u * u, u * v, v * v
            total += w
            for i in range(6):
                weighted = w * terms[i]
                right[i] += weighted * rows[n, 2]
                for j in range(i + 1):
                    matrix[i, j] += weighted * terms[j]
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
        length = np.sqrt(1 + right[1] ** 2 + right[2] ** 2)
        for axis in range(3):
            settled[p, axis] = points[p, axis] + (planes[p, 3] + h * right[0]) * planes[p, axis]
            tilt = right[1] * axes[0, axis] + right[2] * axes[1, axis]
            settled[p, 3 + axis] = (planes[p, axis] - tilt) / length
