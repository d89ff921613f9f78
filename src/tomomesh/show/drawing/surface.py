"""Polygons in space on a grid of pixels: what is nearer hides what is behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...kernels.rendering.triangles import NEAREST, STEPS, keep_nearest, mean_of_samples
from ...kernels.threads import in_blocks
from .style import INK, rgb

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

SAMPLES = 3
"""Samples of a pixel, across and down: 10 levels along an outline; with 2 steps are seen there, 4 take 1.7 times as
long."""
BAND = 16
"""Rows of pixels that one call draws at least, so that their samples stay in the cache: with 64 it takes 1.6 times as
long. Each call looks at all faces, so that many faces have wider bands: two million in bands of 16 take four times."""
A_ROW = 4000
"""Faces for which a band is one row wider."""


def draw_polygons(
    pixels: NDArray[np.uint8],
    corners: Floats,
    polygons: NDArray[np.int64],
    colors: NDArray[np.uint8],
    *,
    smooth: bool = False,
    line: float = 0.0,
    ink: str = INK,
) -> None:
    """Draw convex polygons, the nearest in front, whichever come first.

    Parameters
    ----------
    pixels : (rows, columns, 3) uint8 array
        Changed.
    corners : (n, 3) float array
        To the right and down in pixels, from the outer corner of the first, and toward the viewer in any unit.
    polygons : (m, 3 or more) int array
        Counterclockwise where they face the viewer.
    colors : (2, n or m, 3) uint8 array
        Of the corners where `smooth`, else of the polygons, from the front and from behind.
    line : float
        Width of the lines along their sides, in pixels.
    ink : str
        Color of these.
    """
    low = np.clip(np.floor(corners[:, :2].min(axis=0, initial=np.inf)), 0, pixels.shape[1::-1]).astype(int)
    high = np.clip(np.ceil(corners[:, :2].max(axis=0, initial=-np.inf)), low, pixels.shape[1::-1]).astype(int)
    part = pixels[low[1] : high[1], low[0] : high[0]]
    if not len(polygons) or not part.size:
        return
    placed, color = _snapped(corners, low), rgb(ink).astype(np.uint8)
    sides, shades = np.ascontiguousarray(polygons), np.ascontiguousarray(colors)
    half = 0.5 * line * SAMPLES * STEPS

    def work(start: int, stop: int) -> None:
        nearest = np.zeros(((stop - start) * SAMPLES, part.shape[1] * SAMPLES), np.int64)
        keep_nearest(placed, sides, shades, smooth, half, color, start * SAMPLES, nearest)
        mean_of_samples(nearest, part[start:stop])

    in_blocks(work, len(part), block=max(BAND, len(polygons) // A_ROW))


def _snapped(corners: Floats, first: NDArray[np.int_]) -> NDArray[np.int64]:
    """Lay corners on the grid of steps from a first pixel, and their depths between 0 and the largest."""
    depth = corners[:, 2]
    low, high = float(depth.min()), float(depth.max())
    span = high - low
    placed = np.empty(corners.shape, np.int64)
    placed[:, :2] = np.round((corners[:, :2] - first) * (SAMPLES * STEPS))
    placed[:, 2] = (depth - low) / (span if span > 0 else 1.0) * NEAREST
    return placed
