"""Voxels of thick slices, each divided into a column of thinner ones; and distances within slices.

Axis 0 runs across the slices. The part of a column that is numbered first lies lowest along it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float32]
    Index = NDArray[np.int32]

BESIDE = (0.27406862, 0.45186276, 0.27406862)
"""Weights of three neighbors in a row: a normal density of deviation 1 at -1, 0, 1, over its sum."""
ALONG = (0.05448868, 0.24420134, 0.40261995, 0.24420134, 0.05448868)
"""Weights of five in a row: the same density at -2 to 2, over its sum."""
HALVINGS = 26
"""Halvings of the interval in which a shift is sought: to the last bit of a 32-bit number."""


@kernel("void(f4[:,:,::1], i4[:,::1], f4[::1], f4[::1], i8, i8)")
def ranges_around(values: Values, columns: Index, low: Values, high: Values, start: int, stop: int) -> None:
    """Find the least and the greatest value among the 27 voxels around each column's own.

    Parameters
    ----------
    values : (K, J, I) float32 array
    columns : (m, 3) int32 array
        Voxels, as indices along the three axes.
    low, high : (m,) float32 array
        Results.
    start, stop : int
        Columns to work on.
    """
    for m in range(start, stop):
        k, j, i = columns[m]
        least, most = values[k, j, i], values[k, j, i]
        for a in range(max(k - 1, 0), min(k + 2, values.shape[0])):
            for b in range(max(j - 1, 0), min(j + 2, values.shape[1])):
                for c in range(max(i - 1, 0), min(i + 2, values.shape[2])):
                    least, most = min(least, values[a, b, c]), max(most, values[a, b, c])
        low[m], high[m] = least, most


@kernel("void(f4[:,:,::1], i4[:,:,::1], f4[:,::1], i8, i8, i8, f8[::1])")
def profile_around(values: Values, index: Index, parts: Values, k: int, j: int, i: int, profile: Values) -> None:
    """Average the parts of the 9 columns around one of a slice, and of those in the slices below and above.

    Parameters
    ----------
    values : (K, J, I) float32 array
        What a voxel holds that is not divided.
    index : (K, J, I) int32 array
        The column of each voxel; -1 where it is not divided.
    parts : (m, n) float32 array
    k, j, i : int
        The voxel; beyond the border the last one goes on.
    profile : (3 n,) float array
        Result.
    """
    n = parts.shape[1]
    profile[:] = 0.0
    for a in range(3):
        s = min(max(k + a - 1, 0), values.shape[0] - 1)
        for b in range(3):
            r = min(max(j + b - 1, 0), values.shape[1] - 1)
            for c in range(3):
                t = min(max(i + c - 1, 0), values.shape[2] - 1)
                weight, column = BESIDE[b] * BESIDE[c], index[s, r, t]
                for p in range(n):
                    profile[a * n + p] += weight * (parts[column, p] if column >= 0 else values[s, r, t])


@kernel("void(f4[:,:,::1], i4[:,:,::1], i4[:,::1], f4[::1], f4[::1], f4[:,::1], f8, f4[:,::1], i8, i8)")
def move_within_columns(
    values: Values,
    index: Index,
    columns: Index,
    low: Values,
    high: Values,
    parts: Values,
    sharpness: float,
    moved: Values,
    start: int,
    stop: int,
) -> None:
    """Let the parts of each column follow those around, and keep their mean.

    A part becomes  clip(v + s (g - mean g) + c, low, high):  g are the parts around, averaged, v is the voxel's value,
    s the sharpness, and c is such that the mean of the column is v.

    Parameters
    ----------
    values, index, parts
        As `profile_around` takes them.
    columns : (m, 3) int32 array
        The voxel of each column.
    low, high : (m,) float32 array
        What the parts stay between; the value lies between them too.
    sharpness : float
    moved : (m, n) float32 array
        Result.
    start, stop : int
        Columns to work on.
    """
    n = parts.shape[1]
    profile, part = np.empty(3 * n), np.empty(n)
    for m in range(start, stop):
        k, j, i = columns[m]
        profile_around(values, index, parts, k, j, i, profile)
        mean = 0.0
        for p in range(n):
            part[p] = 0.0
            for q in range(5):
                part[p] += ALONG[q] * profile[n + p + q - 2]
            mean += part[p] / n
        value, least, most = values[k, j, i], low[m], high[m]
        down, up = least - value, most - value
        for p in range(n):
            part[p] = value + sharpness * (part[p] - mean)
            down, up = min(down, least - part[p]), max(up, most - part[p])
        for _ in range(HALVINGS):
            shift, total = 0.5 * (down + up), 0.0
            for p in range(n):
                total += min(max(part[p] + shift, least), most)
            if total < n * value:
                down = shift
            else:
                up = shift
        for p in range(n):
            moved[m, p] = min(max(part[p] + 0.5 * (down + up), least), most)


@kernel("void(b1[:,:,::1], i8, f4[:,:,::1], i8, i8)")
def distances_in_slices(mask: NDArray[np.bool_], reach: int, distances: Values, start: int, stop: int) -> None:
    """Measure in each slice how deep its pixels lie inside, or how far outside as a negative number.

    Distances are those of pixels from the nearest one on the other side, less half a pixel, exact up to `reach` and
    not over it.

    Parameters
    ----------
    mask : (K, J, I) bool array
    reach : int
    distances : (K, J, I) float32 array
        Result, pixels.
    start, stop : int
        Slices to work on.
    """
    rows, columns = mask.shape[1], mask.shape[2]
    along = np.empty((rows, columns), np.int32)
    for k in range(start, stop):
        for i in range(columns):
            run = reach
            for j in range(rows):
                run = min(run + 1, reach) if j == 0 or mask[k, j, i] == mask[k, j - 1, i] else 1
                along[j, i] = run
            run = reach
            for j in range(rows - 1, -1, -1):
                run = min(run + 1, reach) if j == rows - 1 or mask[k, j, i] == mask[k, j + 1, i] else 1
                along[j, i] = min(along[j, i], run)
        for j in range(rows):
            for i in range(columns):
                inside = mask[k, j, i]
                nearest = along[j, i] ** 2
                for step in range(1, reach):
                    if step * step >= nearest:
                        break
                    for c in (i - step, i + step):
                        if 0 <= c < columns:
                            across = 0 if mask[k, j, c] != inside else along[j, c]
                            nearest = min(nearest, step * step + across * across)
                deep = np.sqrt(float(nearest)) - 0.5
                distances[k, j, i] = deep if inside else -deep


@kernel("b1(f4[:,:,::1], i8, i8, i8, i8)")
def lies_between(distances: Values, k: int, s: int, j: int, i: int) -> bool:
    """Tell whether a pixel outside of two slices lies between what is inside of the one and of the other."""
    if distances[k, j, i] > 0 or distances[s, j, i] > 0:
        return False
    before, after = max(j - 1, 0), min(j + 1, distances.shape[1] - 1)
    left, right = max(i - 1, 0), min(i + 1, distances.shape[2] - 1)
    along = (distances[k, after, i] - distances[k, before, i]) * (distances[s, after, i] - distances[s, before, i])
    across = (distances[k, j, right] - distances[k, j, left]) * (distances[s, j, right] - distances[s, j, left])
    return bool(along + across < 0)


@kernel("f8(f4[:,:,::1], i8, i8, i8, f8, f8)")
def shift_between_slices(distances: Values, k: int, j: int, i: int, least: float, most: float) -> float:
    """Return how far the border near a pixel moves over it on the way to the nearer of the next slices.

    Of the slices below and above, those count in which the pixel lies nearer to the other side, or on it. One between
    a part of this slice and a part of the next is passed by a part that moves by more than its own width: there the
    shift is the most. Where the next slice has no border within the most, a part ends, over a quarter of that.
    Elsewhere the border does not come here, and the shift is the least.
    """
    shift, side = np.inf, 1.0 if distances[k, j, i] > 0 else -1.0
    for s in (k - 1, k + 1):
        if 0 <= s < distances.shape[0]:
            nearer = side * (distances[k, j, i] - distances[s, j, i])
            if lies_between(distances, k, s, j, i):
                shift = min(shift, most)
            elif nearer > 0:
                shift = min(shift, nearer if abs(distances[s, j, i]) <= most else 0.25 * most)
    return min(max(shift, least), most) if shift < np.inf else least


@kernel("void(f4[:,:,::1], i4[:,::1], f8, f8, f4[::1], i8, i8)")
def shares_inside(
    distances: Values, columns: Index, least: float, most: float, shares: Values, start: int, stop: int
) -> None:
    """Tell how much of each voxel lies inside, if the border goes on to where it is in the nearer of the next slices.

    Where the border moves sideways by w from slice to slice, the share rises from 0 to 1 over the width w about it.

    Parameters
    ----------
    distances : (K, J, I) float32 array
        Of `distances_in_slices`.
    columns : (m, 3) int32 array
    least, most : float
        What w, averaged over 3 x 3 pixels, stays between, pixels.
    shares : (m,) float32 array
        Result.
    start, stop : int
        Columns to work on.
    """
    rows, across = distances.shape[1:]
    for m in range(start, stop):
        k, j, i = columns[m]
        width, count = 0.0, 0
        for b in range(max(j - 1, 0), min(j + 2, rows)):
            for c in range(max(i - 1, 0), min(i + 2, across)):
                width += shift_between_slices(distances, k, b, c, least, most)
                count += 1
        shares[m] = min(max(0.5 + distances[k, j, i] * count / width, 0.0), 1.0)
