"""Distances of neighbors among points that are sorted along an axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel("void(f8[:,::1], i8, i8, i8, f8[::1], i8, i8)")
def neighbor_distances(
    points: NDArray[np.float64],
    axis: int,
    neighbors: int,
    stride: int,
    distances: NDArray[np.float64],
    begin: int,
    end: int,
) -> None:
    """Find how far away the k-th neighbor of some points is.

    Parameters
    ----------
    points : (n, 3) float array
        More than k, rising along the axis.
    axis, neighbors : int
    stride : int
        Every so manieth point is looked at.
    distances : (m,) float array
        Result, for points 0, stride, 2 stride, ...
    begin, end : int
        Which of those to work on.

    Notes
    -----
    Goes from each point both ways along the axis, until that way alone is longer than the distance found: some
    hundred points of a surface.
    """
    nearest = np.empty(neighbors)
    for m in range(begin, end):
        p = m * stride
        nearest[:] = np.inf
        low, high = p - 1, p + 1
        while True:
            below = points[p, axis] - points[low, axis] if low >= 0 else np.inf
            above = points[high, axis] - points[p, axis] if high < len(points) else np.inf
            if min(below, above) ** 2 >= nearest[neighbors - 1]:
                break
            other = low if below <= above else high
            low, high = low - int(below <= above), high + int(below > above)
            squared = 0.0
            for k in range(3):
                squared += (points[other, k] - points[p, k]) ** 2
            rank = neighbors
            while rank > 0 and nearest[rank - 1] > squared:
                rank -= 1
            for k in range(neighbors - 1, rank, -1):
                nearest[k] = nearest[k - 1]
            if rank < neighbors:
                nearest[rank] = squared
        distances[m] = np.sqrt(nearest[neighbors - 1])
