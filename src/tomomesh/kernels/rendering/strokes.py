"""Lines and dots, as much of each pixel as they cover."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Bytes = NDArray[np.uint8]


@kernel("void(f8[:,:,::1], f8[::1], f8[:,::1], f8, f8, u1[:,:,:])")
def draw_segments(ends: Floats, widths: Floats, colors: Floats, dash: float, gap: float, pixels: Bytes) -> None:
    """Draw segments with round ends in their order; each begins its own dashes, which are cut off straight.

    Parameters
    ----------
    ends : (n, 2, 2) float array
        To the right and down in pixels, from the outer corner of the first pixel.
    widths : (n,) float array
        In pixels; a line thinner than one covers a share of it.
    colors : (n, 4) float array
        Red, green and blue to 255, and opacity to 1.
    dash, gap : float
        Lengths in pixels; a gap of 0 for none.
    pixels : (rows, columns, 3) uint8 array
        Changed.
    """
    rows, columns, _ = pixels.shape
    for n in range(len(ends)):
        x, y = ends[n, 0, 0], ends[n, 0, 1]
        dx, dy = ends[n, 1, 0] - x, ends[n, 1, 1] - y
        length, half = np.sqrt(dx * dx + dy * dy), 0.5 * widths[n]
        if length > 0.0:
            dx, dy = dx / length, dy / length
        reach = half + 1.0
        top = max(int(np.floor(min(y, ends[n, 1, 1]) - reach)), 0)
        bottom = min(int(np.ceil(max(y, ends[n, 1, 1]) + reach)), rows)
        left = max(int(np.floor(min(x, ends[n, 1, 0]) - reach)), 0)
        right = min(int(np.ceil(max(x, ends[n, 1, 0]) + reach)), columns)
        for j in range(top, bottom):
            for i in range(left, right):
                u, v = i + 0.5 - x, j + 0.5 - y
                along, across = u * dx + v * dy, abs(v * dx - u * dy)
                cover = 1.0
                if gap > 0.0:
                    phase = min(max(along, 0.0), length) % (dash + gap)
                    cover = min(max(min(dash - phase, phase + 0.5) + 0.5, 0.0), 1.0)
                    cover *= min(max(min(along, length - along) + 0.5, 0.0), 1.0)
                else:
                    beyond = max(-along, along - length, 0.0)
                    across = np.sqrt(across * across + beyond * beyond)
                cover *= max(min(across + 0.5, half) - max(across - 0.5, -half), 0.0) * colors[n, 3]
                for channel in range(3):
                    under = float(pixels[j, i, channel])
                    pixels[j, i, channel] = np.uint8(under + cover * (colors[n, channel] - under) + 0.5)


@kernel("void(f8[:,::1], f8[::1], f8[:,::1], i8, f8, u1[:,:,:])")
def draw_dots(places: Floats, radii: Floats, colors: Floats, shape: int, rim: float, pixels: Bytes) -> None:
    """Draw dots in their order, or rims alone.

    Parameters
    ----------
    places : (n, 2) float array
        To the right and down in pixels, from the outer corner of the first pixel.
    radii : (n,) float array
        In pixels; a dot smaller than one covers a share of it.
    colors : (n, 4) float array
        Red, green and blue to 255, and opacity to 1.
    shape : int
        0 for discs, 1 for squares, 2 for squares that stand on a corner.
    rim : float
        Width of the rim that is drawn in place of the dot, in pixels; 0 for the dot.
    pixels : (rows, columns, 3) uint8 array
        Changed.
    """
    rows, columns, _ = pixels.shape
    for n in range(len(places)):
        x, y, radius = places[n, 0], places[n, 1], max(radii[n], 0.5)
        share = colors[n, 3] * min(4.0 * radii[n] * radii[n], 1.0)
        reach = radius + 0.5 * rim + 1.0
        for j in range(max(int(np.floor(y - reach)), 0), min(int(np.ceil(y + reach)), rows)):
            for i in range(max(int(np.floor(x - reach)), 0), min(int(np.ceil(x + reach)), columns)):
                u, v = abs(i + 0.5 - x), abs(j + 0.5 - y)
                away = max(u, v) if shape == 1 else (u + v) * np.sqrt(0.5) if shape == 2 else np.sqrt(u * u + v * v)
                beyond = away - radius
                if rim > 0.0:
                    beyond = abs(beyond) - 0.5 * rim
                cover = share * min(max(0.5 - beyond, 0.0), 1.0)
                for channel in range(3):
                    under = float(pixels[j, i, channel])
                    pixels[j, i, channel] = np.uint8(under + cover * (colors[n, channel] - under) + 0.5)
