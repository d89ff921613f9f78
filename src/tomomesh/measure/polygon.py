"""Polygons: what closed ones enclose, how long their sides are, what lies inside, places evenly along open ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels.measure.polygons import distance_to_polygon, inside_polygon, step_evenly, turn_lattice
from ..model.columns import for_kernels

if TYPE_CHECKING:
    from numpy.typing import NDArray


def lattice_over(ring: NDArray[np.float64], spacing: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the columns x and the rows y of a square lattice about the middle of a ring, as far as it reaches."""
    low, high = ring.min(axis=0), ring.max(axis=0)
    half = ((high - low) // (2 * spacing)).astype(int)
    x, y = ((low[a] + high[a]) / 2 + spacing * np.arange(-half[a], half[a] + 1) for a in (0, 1))
    return x, y


def inside_lattice(ring: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which places of a lattice lie inside a closed polygon (u, 2), (rows, columns).

    Each side turns what is to the right of it over, in the rows that it crosses: cost grows with these, not with the
    places.

    Parameters
    ----------
    ring : (u, 2) float array
    x, y : (columns,) and (rows,) float arrays
        Rising.
    """
    found = np.zeros((len(y), len(x)), np.bool_)
    turn_lattice(for_kernels(ring, np.float64), for_kernels(x, np.float64), for_kernels(y, np.float64), found)
    return found


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
    """Return the area of a closed polygon (u, 2); below 0 where the inside is on its right."""
    x, y = (ring - ring[0]).T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


def side_lengths(line: NDArray[np.float64], *, closed: bool = True) -> NDArray[np.float64]:
    """Return the lengths of the sides of a line (u, 2), the first from point 0 to point 1."""
    line = np.concatenate([line, line[:1]]) if closed else line
    off = line[1:] - line[:-1]
    return np.asarray(np.sqrt(np.einsum("ua,ua->u", off, off)))


def evenly(line: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Place points at equal steps along a line, its ends kept; one point alone takes the middle."""
    places = np.empty((count if count > 1 else 3, line.shape[1]))
    step_evenly(for_kernels(line, np.float64), places)
    return places if count > 1 else places[1:2]


def along(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of each point of a line (p, d) from its first, along the line."""
    return np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1)))])
