"""Signed distances of pixels to closed polygons."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel("void(f8[:,::1], i8[::1], f8[::1], f8, f4[:,::1], i4[:,::1])")
def draw_rings(
    corners: NDArray[np.float64],
    onward: NDArray[np.int64],
    pixel: NDArray[np.float64],
    reach: float,
    depth: NDArray[np.float32],
    turns: NDArray[np.int32],
) -> None:
    """Measure how deep pixels lie inside of closed polygons, as far as a distance.

    Cost grows with the length of the polygons times `reach`, not with the pixels, but for one pass over them.

    Parameters
    ----------
    corners : (p, 2) float array
        Corners (x, y) in pixels, whose middles are whole numbers; the inside lies on the left where x runs to the
        right and y up. May lie beyond the pixels.
    onward : (p,) int64 array
        The corner after each.
    pixel : (2,) float array
        Edges (x, y) of a pixel.
    reach : float
        In the unit of `pixel`.
    depth : (J, I) float32 array
        Result, from -reach to reach: over 0 where a polygon winds around the pixel, once more than others do back.
    turns : (J, I) int32 array
        Work space.
    """
    rows, columns = depth.shape
    depth[:] = reach * reach
    turns[:] = 0
    wide, high = reach / pixel[0], reach / pixel[1]
    for n in range(len(corners)):
        x, y = corners[n]
        u, v = corners[onward[n]]
        first, last = max(int(np.ceil(min(x, u) - wide)), 0), min(int(np.floor(max(x, u) + wide)), columns - 1)
        low, top = max(int(np.ceil(min(y, v) - high)), 0), min(int(np.floor(max(y, v) + high)), rows - 1)
        across, along = (u - x) * pixel[0], (v - y) * pixel[1]
        length = across * across + along * along
        for j in range(low, top + 1):
            for i in range(first, last + 1):
                p, q = (i - x) * pixel[0], (j - y) * pixel[1]
                share = min(max((p * across + q * along) / length, 0.0), 1.0) if length > 0.0 else 0.0
                p, q = p - share * across, q - share * along
                depth[j, i] = min(depth[j, i], p * p + q * q)
        way = 1 if v > y else -1
        for j in range(max(int(np.floor(min(y, v))) + 1, 0), min(int(np.floor(max(y, v))), rows - 1) + 1):
            at = int(np.floor(x + (j - y) / (v - y) * (u - x))) + 1
            if at < columns:
                turns[j, max(at, 0)] -= way
    for j in range(rows):
        around = 0
        for i in range(columns):
            around += turns[j, i]
            away = np.sqrt(depth[j, i])
            depth[j, i] = away if around > 0 else -away
