"""Smooth closed curves through points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Mask = NDArray[np.bool_]


@kernel("void(f8[::1], f8[:,::1], f8[:,::1])")
def closed_slopes(steps: Floats, ring: Floats, slopes: Floats) -> None:
    """Find the slopes of a periodic cubic spline at its knots, of which no second derivative jumps.

    Parameters
    ----------
    steps : (u,) float array
        From each knot to the next, above 0; three at least.
    ring : (u, 2) float array
        The curve at the knots.
    slopes : (u, 2) float array
        Result.

    Notes
    -----
    Of row i of the cyclic system,  n s[i-1] + 2 (n + l) s[i] + l s[i+1] = 3 (n d[i-1] + l d[i]),  l is the step before
    and n the one after, d the differences over the steps. The first unknown is taken out, and what is left is solved
    by elimination (Thomas 1949) for the ring's two columns and for what the first one adds.
    """
    count = len(steps)
    diagonal, rest = np.empty(count), np.empty((count, 3))
    for i in range(count):
        last, onward = steps[i - 1], steps[i]
        diagonal[i], rest[i, 2] = 2.0 * (last + onward), 0.0
        for axis in range(2):
            here, there = ring[i, axis], ring[(i + 1) % count, axis]
            rest[i, axis] = 3.0 * (onward * (here - ring[i - 1, axis]) / last + last * (there - here) / onward)
    rest[1, 2] -= steps[1]
    rest[count - 1, 2] -= steps[count - 2]
    for i in range(2, count):
        share = steps[i] / diagonal[i - 1]
        diagonal[i] -= share * steps[i - 2]
        for column in range(3):
            rest[i, column] -= share * rest[i - 1, column]
    for i in range(count - 1, 0, -1):
        for column in range(3):
            after = steps[i - 1] * rest[i + 1, column] if i < count - 1 else 0.0
            rest[i, column] = (rest[i, column] - after) / diagonal[i]
    whole = diagonal[0] + steps[0] * rest[count - 1, 2] + steps[count - 1] * rest[1, 2]
    for axis in range(2):
        first = (rest[0, axis] - steps[0] * rest[count - 1, axis] - steps[count - 1] * rest[1, axis]) / whole
        slopes[0, axis] = first
        for i in range(1, count):
            slopes[i, axis] = rest[i, axis] + first * rest[i, 2]


@kernel("void(f8[:,::1], f8[:,:,::1])")
def draw_closed(ring: Floats, fine: Floats) -> None:
    """Draw a periodic cubic spline through the points of a ring, over the roots of the chords (Lee 1989).

    Parameters
    ----------
    ring : (u, 2) float array
        Three points at least.
    fine : (u, p, 2) float array
        Result: each side in p pieces, its first point first.
    """
    count, pieces = fine.shape[0], fine.shape[1]
    steps, slopes = np.empty(count), np.empty((count, 2))
    longest = 1e-300
    for i in range(count):
        x, y = ring[(i + 1) % count, 0] - ring[i, 0], ring[(i + 1) % count, 1] - ring[i, 1]
        steps[i] = np.sqrt(x * x + y * y)
        longest = max(longest, steps[i])
    for i in range(count):
        # a millionth of the longest chord at least: points at one place get knots of their own
        steps[i] = np.sqrt(max(steps[i], 1e-6 * longest))
    closed_slopes(steps, ring, slopes)
    for i in range(count):
        onward = (i + 1) % count
        for axis in range(2):
            rise = ring[onward, axis] - ring[i, axis]
            here, there = steps[i] * slopes[i, axis], steps[i] * slopes[onward, axis]
            for p in range(pieces):
                t = p / pieces
                bend = 3.0 * rise - 2.0 * here - there + t * (here + there - 2.0 * rise)
                fine[i, p, axis] = ring[i, axis] + t * (here + t * bend)


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
    put[:] = ring
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
