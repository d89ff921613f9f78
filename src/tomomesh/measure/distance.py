"""Exact distances from points to surfaces, and between points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels.measure.positions import list_near
from ..progress import Progress, silent
from .tree import Tree

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

SIDE = 2**20
"""Cells along each axis, at most: their numbers are 64-bit integers."""


def distance_to_surface(
    points: NDArray[np.float64], mesh: TriMesh, *, threads: int = 0, progress: Progress = silent
) -> NDArray[np.float64]:
    """Return the distance of each point to the nearest point of a mesh.

    Exact: boxes around more and more faces are searched, the nearest first, until none can hold a nearer face.

    Parameters
    ----------
    points : (n, 3) float array
    mesh : TriMesh
        One face at least.
    threads : int
        0 is one a core.
    progress : callable
        Told how far the work is; what it raises ends the work.

    Returns
    -------
    (n,) float array
    """
    return Tree.of_faces(mesh, threads=threads).nearest(points, threads=threads, progress=progress)[0]


def pairs_within(points: NDArray[np.float64], radius: float) -> NDArray[np.int64]:
    """Return the pairs (p, 2) of points (n, 2 or 3) that are at most as far apart as a radius, the lower number first.

    Examples
    --------
    >>> pairs_within(np.array([[0.0, 0.0], [5.0, 0.0], [0.0, 1.0]]), 1.0).tolist()
    [[0, 2]]
    """
    if len(points) < 2:
        return np.empty((0, 2), np.int64)
    places = np.zeros((len(points), 3))
    places[:, : points.shape[1]] = points - points.min(axis=0)
    width = max(radius * (1 + 1e-9), places.max() / (SIDE - 3)) or 1.0  # rounding leads to no cell but the next
    x, y, z = (places / width).astype(np.int64).T + 1
    cells = (x * SIDE + y) * SIDE + z
    order = np.argsort(cells, kind="stable")
    places, cells = places[order], cells[order]
    pairs = np.empty((len(points), 2), np.int64)
    if (count := list_near(places, cells, SIDE, radius, pairs)) > len(pairs):
        pairs = np.empty((count, 2), np.int64)
        list_near(places, cells, SIDE, radius, pairs)
    return np.sort(order[pairs[:count]], axis=1)


def spread_of(distances: NDArray[np.float64], name: str) -> dict[str, float]:
    """Return mean, percentiles and maximum of distances in millimeters, keyed for a report."""
    if len(distances) == 0:
        return {}
    p50, p95, p99 = np.percentile(distances, [50, 95, 99])
    return {
        f"{name}mean_mm": float(distances.mean()),
        f"{name}p50_mm": float(p50),
        f"{name}p95_mm": float(p95),
        f"{name}p99_mm": float(p99),
        f"{name}max_mm": float(distances.max()),
    }
