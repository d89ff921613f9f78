"""Distance from points to triangles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel("f8(f8[::1], f8[:,::1], f8, f8)")
def squared_to(point: NDArray[np.float64], corners: NDArray[np.float64], s: float, t: float) -> float:
    """Return the squared distance from a point (3,) to a + s (b - a) + t (c - a) of a triangle (3, 3)."""
    squared = 0.0
    for axis in range(3):
        a = corners[0, axis]
        squared += (point[axis] - a - s * (corners[1, axis] - a) - t * (corners[2, axis] - a)) ** 2
    return squared


@kernel("f8(f8[::1], f8[:,::1])")
def squared_distance(point: NDArray[np.float64], corners: NDArray[np.float64]) -> float:
    """Return the squared distance from a point (3,) to a triangle (3, 3).

    Notes
    -----
    Minimizes |p - a - s (b - a) - t (c - a)|^2: at the foot on the plane where that lies in the triangle, and on
    one of the three sides otherwise. A side of no length counts by its end.
    """
    bb = bc = cc = bp = cp = 0.0
    for axis in range(3):
        b = corners[1, axis] - corners[0, axis]
        c = corners[2, axis] - corners[0, axis]
        p = point[axis] - corners[0, axis]
        bb += b * b
        bc += b * c
        cc += c * c
        bp += b * p
        cp += c * p
    area = bb * cc - bc * bc
    s, t = cc * bp - bc * cp, bb * cp - bc * bp
    foot = np.inf
    if area > 0.0 and s >= 0.0 and t >= 0.0 and s + t <= area:
        foot = squared_to(point, corners, s / area, t / area)
    tiny = 1e-300
    s = min(max(bp / max(bb, tiny), 0.0), 1.0)
    t = min(max(cp / max(cc, tiny), 0.0), 1.0)
    far = min(max((cp - bp + bb - bc) / max(bb - 2.0 * bc + cc, tiny), 0.0), 1.0)
    sides = min(squared_to(point, corners, s, 0.0), squared_to(point, corners, 0.0, t))
    return min(foot, sides, squared_to(point, corners, 1.0 - far, far))


@kernel("void(f8[:,::1], f8[:,:,::1], i8[:,::1], f8[:,::1], f8, f8[::1])")
def nearest_triangle(
    points: NDArray[np.float64],
    corners: NDArray[np.float64],
    candidates: NDArray[np.int64],
    reach: NDArray[np.float64],
    radius: float,
    distance: NDArray[np.float64],
) -> None:
    """Find the distance from each point to the nearest of its candidate triangles.

    Parameters
    ----------
    points : (n, 3) float array
    corners : (m, 3, 3) float array
    candidates : (n, c) int64 array
        Numbers of triangles, the nearest center first.
    reach : (n, c) float array
        Distance of their centers.
    radius : float
        No triangle reaches farther from its center; the search ends where no later candidate can be nearer.
    distance : (n,) float array
        Result.
    """
    for n in range(len(points)):
        best = np.inf
        for c in range(candidates.shape[1]):
            if reach[n, c] - radius > best:
                break
            best = min(best, np.sqrt(squared_distance(points[n], corners[candidates[n, c]])))
        distance[n] = best
