"""Smooth closed curves through points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


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
