"""Rings put back where averaging has drawn them from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Mask = NDArray[np.bool_]


@kernel("f8(f8[:,::1], b1[::1])")
def usual_side(ring: Floats, gaps: Mask) -> float:
    """Return the mean length of the sides of a ring (u, 2) that are no gaps; 0 where there is none."""
    total, count = 0.0, 0
    for i in range(len(ring)):
        if not gaps[i]:
            onward = (i + 1) % len(ring)
            x, y = ring[onward, 0] - ring[i, 0], ring[onward, 1] - ring[i, 1]
            total, count = total + np.sqrt(x * x + y * y), count + 1
    return total / count if count > 0 else 0.0


@kernel("void(f8[:,::1], b1[::1], f8, f8, i8, f8[:,::1])")
def unshrink(ring: Floats, gaps: Mask, averaged: float, half_width: float, stride: int, put: Floats) -> None:
    """Put the points of a ring back outward, by its bend over so many sides each way.

    Parameters
    ----------
    ring : (u, 2) float array
    gaps : (u,) bool array
        Sides near which a point stays.
    averaged : float
        How far averaging has drawn points inward, in squared sides times the curvature.
    half_width : float
        Half the width of the band that was averaged over, whose outer side is the longer one.
    stride : int
    put : (u, 2) float array
        Result.
    """
    count, spacing = len(ring), usual_side(ring, gaps)
    for i in range(count):
        put[i, 0], put[i, 1] = ring[i, 0], ring[i, 1]
    if spacing == 0.0 or count <= 2 * stride:
        return
    inward = (averaged - (half_width / spacing) ** 2 / 3.0) / stride**2
    for i in range(count):
        near = False
        for n in range(-stride, stride):
            near |= gaps[(i + n) % count]
        if not near:
            for axis in range(2):
                bend = ring[i - stride, axis] + ring[(i + stride) % count, axis] - 2.0 * ring[i, axis]
                put[i, axis] -= inward * bend
