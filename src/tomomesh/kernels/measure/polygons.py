"""Points and closed polygons in a plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel("void(f8[:,::1], f8[:,::1], b1[::1])")
def inside_polygon(ring: NDArray[np.float64], points: NDArray[np.float64], inside: NDArray[np.bool_]) -> None:
    """Tell which points lie inside a polygon, by the parity of the sides that a ray along +x crosses.

    Parameters
    ----------
    ring : (u, 2) float array
    points : (n, 2) float array
    inside : (n,) bool array
        Result.
    """
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        inside[n] = False
        last = len(ring) - 1
        for i in range(len(ring)):
            if (ring[i, 1] > y) != (ring[last, 1] > y):
                share = (y - ring[i, 1]) / (ring[last, 1] - ring[i, 1])
                if x < ring[i, 0] + share * (ring[last, 0] - ring[i, 0]):
                    inside[n] = not inside[n]
            last = i


@kernel("void(f8[:,::1], f8[:,::1], f8[::1])")
def distance_to_polygon(ring: NDArray[np.float64], points: NDArray[np.float64], distance: NDArray[np.float64]) -> None:
    """Find the distance of points to the line of a polygon.

    Parameters
    ----------
    ring : (u, 2) float array
    points : (n, 2) float array
    distance : (n,) float array
        Result.
    """
    for n in range(len(points)):
        best = np.inf
        last = len(ring) - 1
        for i in range(len(ring)):
            length = along = 0.0
            for axis in range(2):
                side = ring[last, axis] - ring[i, axis]
                length += side * side
                along += side * (points[n, axis] - ring[i, axis])
            share = min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0
            squared = 0.0
            for axis in range(2):
                nearest = ring[i, axis] + share * (ring[last, axis] - ring[i, axis])
                squared += (points[n, axis] - nearest) ** 2
            best = min(best, squared)
            last = i
        distance[n] = np.sqrt(best)
