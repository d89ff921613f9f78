"""Exact distances from points to surfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..progress import Progress, silent
from .tree import Tree

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh


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
