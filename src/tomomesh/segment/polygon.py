"""Closed polygons in the plane of a slice."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

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
    """Tell which points lie inside a closed polygon, by the parity of the edges to their right."""
    a, b = ring, np.roll(ring, -1, axis=0)
    x, y = points[:, :1], points[:, 1:]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(a[:, 1] == b[:, 1], 1.0, b[:, 1] - a[:, 1])
    crossing = a[:, 0] + (y - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    return np.asarray((spans & (x < crossing)).sum(axis=1) % 2 == 1)


def distance(ring: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of points to the line of a closed polygon."""
    a, along = ring, np.roll(ring, -1, axis=0) - ring
    length = np.maximum((along**2).sum(axis=1), 1e-300)
    share = np.clip(((points[:, None] - a) * along).sum(axis=2) / length, 0, 1)
    off = points[:, None] - (a + share[:, :, None] * along)
    return np.asarray(np.sqrt((off**2).sum(axis=2).min(axis=1, initial=np.inf)))


def area(ring: NDArray[np.float64]) -> float:
    """Return the signed area of a closed polygon."""
    x, y = ring.T
    return float(0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
