"""What lies between two slices: rings matched point to point, and depths carried along with them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel("i8(f8[:,::1], f8[:,::1], i1[:,::1], f8[::1], i8[:,::1])")
def match_rings(
    one: NDArray[np.float64],
    other: NDArray[np.float64],
    steps: NDArray[np.int8],
    costs: NDArray[np.float64],
    pairs: NDArray[np.int64],
) -> int:
    """Match the points of two closed curves, in order, for the least sum of squared distances.

    Dynamic programming (Sakoe & Chiba 1978; for contours: Fuchs, Kedem & Uselton 1977), from the two points that are
    nearest to each other once around to them.

    Parameters
    ----------
    one : (n, 2) float array
    other : (m, 2) float array
        Both turn the same way.
    steps : (n + 1, m + 1) int8 array
    costs : (m + 1,) float array
        Work space.
    pairs : (n + m, 2) int64 array
        Result: the matched points, each of both once at least, the last pair first.

    Returns
    -------
    int
        Number of pairs.
    """
    n, m = len(one), len(other)
    nearest, first, start = np.inf, 0, 0
    for i in range(n):
        for j in range(m):
            away = (one[i, 0] - other[j, 0]) ** 2 + (one[i, 1] - other[j, 1]) ** 2
            if away < nearest:
                nearest, first, start = away, i, j
    for i in range(n + 1):
        p = one[(first + i) % n]
        before = 0.0
        for j in range(m + 1):
            q = other[(start + j) % m]
            least, step = np.inf, 0
            if i > 0 and j > 0:
                least, step = before, 0
            if i > 0 and costs[j] < least:
                least, step = costs[j], 1
            if j > 0 and costs[j - 1] < least:
                least, step = costs[j - 1], 2
            before = costs[j]
            if i == 0 and j == 0:
                least = 0.0
            costs[j] = least + (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2
            steps[i, j] = step
    i, j, count = n, m, 0
    while i > 0 or j > 0:
        pairs[count, 0], pairs[count, 1] = (first + i) % n, (start + j) % m
        count += 1
        step = steps[i, j]
        if step != 2:
            i -= 1
        if step != 1:
            j -= 1
    return count


@kernel("void(f8[:,::1], f8[:,::1], f8[::1], f8, f4[:,::1], f4[:,:,::1])")
def carry_along(
    points: NDArray[np.float64],
    offsets: NDArray[np.float64],
    pixel: NDArray[np.float64],
    reach: float,
    away: NDArray[np.float32],
    carried: NDArray[np.float32],
) -> None:
    """Give pixels the offsets of the point that is nearest to each, as far as a distance.

    Parameters
    ----------
    points : (p, 2) float array
        In pixels (x, y).
    offsets : (p, 4) float array
    pixel : (2,) float array
    reach : float
    away : (J, I) float32 array
        Result: the squared distance to it, reach^2 where there is none.
    carried : (J, I, 4) float32 array
        Result: its offsets, where there is one.
    """
    rows, columns = away.shape
    away[:] = reach * reach
    wide, high = reach / pixel[0], reach / pixel[1]
    for n in range(len(points)):
        x, y = points[n]
        for j in range(max(int(np.ceil(y - high)), 0), min(int(np.floor(y + high)), rows - 1) + 1):
            for i in range(max(int(np.ceil(x - wide)), 0), min(int(np.floor(x + wide)), columns - 1) + 1):
                far = ((i - x) * pixel[0]) ** 2 + ((j - y) * pixel[1]) ** 2
                if far < away[j, i]:
                    away[j, i] = far
                    for a in range(4):
                        carried[j, i, a] = offsets[n, a]


@kernel("void(f4[:,::1], f4[:,::1], f4[:,::1], f4[:,:,::1], f8, f8, f4[:,::1])")
def blend(
    below: NDArray[np.float32],
    above: NDArray[np.float32],
    away: NDArray[np.float32],
    carried: NDArray[np.float32],
    reach: float,
    share: float,
    depth: NDArray[np.float32],
) -> None:
    """Blend the depths of two slices at each pixel, each seen from where the offsets lead.

    Parameters
    ----------
    below, above : (J, I) float32 array
    away : (J, I) float32 array
        Squared distance to the point whose offsets are carried; they fade between a half of `reach` and all of it.
    carried : (J, I, 4) float32 array
        Offsets (x, y) to the slice below and to that above.
    reach : float
    share : float
        Of the way from the slice below to that above.
    depth : (J, I) float32 array
        Result.
    """
    rows, columns = depth.shape
    none = np.float32(reach * reach)  # as `away` holds it, which may be less
    for j in range(rows):
        for i in range(columns):
            low, high = below[j, i], above[j, i]
            if away[j, i] < none:
                weight = min(2.0 - 2.0 * np.sqrt(away[j, i]) / reach, 1.0)
                for side in range(2):
                    x = min(max(i + weight * carried[j, i, 2 * side], 0.0), columns - 1.0)
                    y = min(max(j + weight * carried[j, i, 2 * side + 1], 0.0), rows - 1.0)
                    u, v = min(int(x), columns - 2), min(int(y), rows - 2)
                    p, q = x - u, y - v
                    seen = below if side == 0 else above
                    value = (seen[v, u] * (1 - p) + seen[v, u + 1] * p) * (1 - q) + (
                        seen[v + 1, u] * (1 - p) + seen[v + 1, u + 1] * p
                    ) * q
                    if side == 0:
                        low = value
                    else:
                        high = value
            depth[j, i] = (1.0 - share) * low + share * high
