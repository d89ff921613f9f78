"""Smooth closed curves through points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel("void(f8[:,::1], f8[::1], f8[:,::1])")
def _slopes(points: NDArray[np.float64], step: NDArray[np.float64], slope: NDArray[np.float64]) -> None:
    """Solve for the slopes that make second derivatives meet: elimination, the two corners added after it.

    Sherman & Morrison (1950): the matrix is a tridiagonal one plus a product of two vectors.
    """
    u, d = points.shape
    ahead, turned = np.empty(u), np.empty(u)
    first, last = step[0], step[u - 2]
    gamma = -2.0 * (step[u - 1] + step[0])
    for i in range(u):
        before, own = step[i - 1], step[i]
        pivot = 2.0 * (before + own)
        if i == 0:
            pivot -= gamma
        if i == u - 1:
            pivot -= first * last / gamma
        back = own if i > 0 else 0.0
        pivot -= back * ahead[i - 1] if i > 0 else 0.0
        ahead[i] = before / pivot
        corner = gamma if i == 0 else last if i == u - 1 else 0.0
        turned[i] = (corner - (back * turned[i - 1] if i > 0 else 0.0)) / pivot
        for a in range(d):
            here, onward = points[i, a] - points[i - 1, a], points[(i + 1) % u, a] - points[i, a]
            asked = 3.0 * (own * here / before + before * onward / own)
            slope[i, a] = (asked - (back * slope[i - 1, a] if i > 0 else 0.0)) / pivot
    for i in range(u - 2, -1, -1):
        turned[i] -= ahead[i] * turned[i + 1]
        for a in range(d):
            slope[i, a] -= ahead[i] * slope[i + 1, a]
    share = 1.0 + turned[0] + first * turned[u - 1] / gamma
    for a in range(d):
        lacks = (slope[0, a] + first * slope[u - 1, a] / gamma) / share
        for i in range(u):
            slope[i, a] -= lacks * turned[i]


@kernel("void(f8[:,::1], f8[::1], i8[::1], f8[:,::1])")
def draw_closed_spline(
    points: NDArray[np.float64], step: NDArray[np.float64], pieces: NDArray[np.int64], drawn: NDArray[np.float64]
) -> None:
    """Draw the periodic cubic spline through the corners of a closed polygon.

    Parameters
    ----------
    points : (u, d) float array
        Two at least.
    step : (u,) float array
        The parameter's way from each point to the next, over 0.
    pieces : (u,) int array
        Into how many equal pieces of it each side is split.
    drawn : (p, d) float array
        Result: the first point of every piece.
    """
    u, d = points.shape
    slope, n = np.empty((u, d)), 0
    _slopes(points, step, slope)
    for i in range(u):
        j = (i + 1) % u
        for k in range(pieces[i]):
            s = k / pieces[i]
            rest = 1.0 - s
            for a in range(d):
                inner = rest * slope[i, a] - s * slope[j, a]
                outer = rest * rest * (1.0 + 2.0 * s) * points[i, a] + s * s * (3.0 - 2.0 * s) * points[j, a]
                drawn[n, a] = outer + s * rest * step[i] * inner
            n += 1
