"""One look for all pictures: colors, scales of colors, and lengths on paper."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]
    Ramp = Callable[[ArrayLike], NDArray[np.uint8]]

DPI = 150
STEPS = 256
"""Colors of a scale."""
INK, MUTED, RULE, WHITE = "#17222b", "#66757f", "#d3dae0", "#ffffff"
SIGNAL, NETWORK, ACCENT = "#b4bfc7", "#0b6b88", "#d9480f"
TRACKS = (NETWORK, "#8a4f9e", "#2e7d4f", "#a8791a", INK)
"""Contours of a slice, by their tracks."""


def dots_of(points: float, dpi: float = DPI) -> float:
    """Return a length in points (1/72 inch) in pixels."""
    return points * dpi / 72


def rgb(color: str) -> Floats:
    """Return red, green and blue of ``"#rrggbb"``, 0 to 255."""
    return np.array([int(color[n : n + 2], 16) for n in (1, 3, 5)], np.float64)


def opaque(color: Any, count: int) -> Floats:
    """Return one color, or (count, 3 or 4) colors from 0 to 255, with their opacity from 0 to 1, (count, 4)."""
    levels = np.atleast_2d(rgb(color) if isinstance(color, str) else np.asarray(color, np.float64))
    if levels.shape[1] == 3:
        levels = np.column_stack([levels, np.ones(len(levels))])
    return np.broadcast_to(levels, (count, 4)).copy()


def ramp(*stops: str) -> Ramp:
    """Return a scale that carries 0 to 1 to colors between evenly spaced stops, (..., 3) from 0 to 255."""
    levels = np.array([rgb(stop) for stop in stops])
    places = np.linspace(0, len(stops) - 1, STEPS)
    table = np.stack([np.interp(places, np.arange(len(stops)), channel) for channel in levels.T], axis=1)
    shades = np.round(table).astype(np.uint8)

    def colors(values: ArrayLike) -> NDArray[np.uint8]:
        return np.asarray(shades[np.rint(np.asarray(values) * (STEPS - 1)).astype(np.intp)])

    return colors


BONE = ramp("#2c2420", "#86735f", "#cdbb9d", "#f7eedd")
BEHIND = ramp("#1f2a33", "#55707f", "#94aebb", "#d3e0e6")
"""The side of a sheet that faces inward."""
HEIGHT = ramp("#12345a", "#0b6b88", "#2fa58e", "#9ccb5b", "#f2c14e")
RELIEF = ramp("#3c6078", "#5a8ea0", "#a9cac8", "#f0e2c2", "#fffaf0")
TINT = ramp("#f6f8f9", "#a9cad4", "#0b6b88", "#0d2b45")
