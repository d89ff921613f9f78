"""Closed polygons in the plane of a slice."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels.som.polygons import distance_to_polygon, inside_polygon

if TYPE_CHECKING:
    from numpy.typing import NDArray


def lattice_inside(ring: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Return the points of a square lattice about the middle of a ring that lie inside it, (n, 2)."""
    low, high = ring.min(axis=0), ring.max(axis=0)
    half = ((high - low) // (2 * spacing)).astype(int)
    x, y = ((low[a] + high[a]) / 2 + spacing * np.arange(-half[a], half[a] + 1) for a in (0, 1))
    lattice = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return lattice[inside(ring, lattice)]


def inside(ring: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which points (n, 2) lie inside a closed polygon (u, 2)."""
    found = np.empty(len(points), bool)
    inside_polygon(np.ascontiguousarray(ring), np.ascontiguousarray(points), found)
    return found


def distance(ring: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of points (n, 2) to the line of a closed polygon (u, 2)."""
    found = np.empty(len(points))
    distance_to_polygon(np.ascontiguousarray(ring), np.ascontiguousarray(points), found)
    return found


def area(ring: NDArray[np.float64]) -> float:
    """Return the signed area of a closed polygon."""
    x, y = ring.T
    return float(0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
