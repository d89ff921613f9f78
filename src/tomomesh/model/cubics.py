"""Cubics between values of given slopes, and slopes for which nothing between the values overshoots."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

Array = TypeVar("Array", "NDArray[np.float64]", "NDArray[np.float32]")

LIMIT = 3.0
"""Slopes are at most this many times the smaller change: then nothing overshoots (Fritsch & Carlson 1980). Chosen: half
of it changes the distance of stacks by +0.1 % and of rings by -0.3 %, twice by -0.4 % and +0.3 %."""


def cubic(t: float, step: float, f: Array, g: Array, start: Array, stop: Array) -> Array:
    """Interpolate between two values of given slopes (Hermite), at a share t of a step."""
    u = 1 - t
    moved = u * u * (1 + 2 * t) * f + t * t * (1 + 2 * u) * g + step * t * u * (u * start - t * stop)
    return np.asarray(moved, f.dtype)


def parabolic(earlier: Array, later: Array, before: float = 1.0, after: float = 1.0) -> Array:
    """Return the slope of the parabola through three values, from the changes before and after the middle one."""
    slope = (after * earlier + before * later) / (before + after)
    return np.asarray(slope, earlier.dtype)


def limited(earlier: Array, later: Array, before: float = 1.0, after: float = 1.0) -> Array:
    """Return that slope, limited so that the values between do not overshoot."""
    most = LIMIT * np.minimum(np.abs(earlier), np.abs(later))
    slope = np.clip(parabolic(earlier, later, before, after), -most, most)
    return np.asarray(np.where(earlier * later > 0, slope, 0), earlier.dtype)
