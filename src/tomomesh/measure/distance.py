"""Exact distances from points to surfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from ..kernels.triangles import nearest_triangle

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

FIRST_TRY = 16
"""Faces looked at for each point before the search widens."""
BLOCK = 20_000
"""Points handled together, which bounds the memory."""


def distance_to_surface(points: NDArray[np.float64], mesh: TriMesh) -> NDArray[np.float64]:
    """Return the distance of each point to the nearest point of a mesh.

    Faces are tried in the order of their centers. A face whose center is farther than the best distance so far
    plus the largest face's radius cannot be nearer, so the result is exact.

    Parameters
    ----------
    points : (n, 3) float array
    mesh : TriMesh
        One face at least.

    Returns
    -------
    (n,) float array
    """
    centers = mesh.corners.mean(axis=1)
    radius = float(np.sqrt(((mesh.corners - centers[:, None]) ** 2).sum(axis=2).max()))
    tree = cKDTree(centers)
    found = [_search(points[n : n + BLOCK], mesh, tree, radius) for n in range(0, len(points), BLOCK)]
    return np.concatenate(found) if found else np.empty(0)


def _search(points: NDArray[np.float64], mesh: TriMesh, tree: cKDTree, radius: float) -> NDArray[np.float64]:
    best = np.full(len(points), np.inf)
    left, count = np.arange(len(points)), min(FIRST_TRY, len(mesh.faces))
    while len(left):
        reach, face = (np.asarray(a) for a in tree.query(points[left], k=np.arange(1, count + 1), workers=-1))
        found = np.empty(len(left))
        nearest_triangle(points[left], mesh.corners, face.astype(np.int64), reach, radius, found)
        best[left] = found
        left = left[(reach[:, -1] < best[left] + radius) & (count < len(mesh.faces))]
        count = min(2 * count, len(mesh.faces))
    return best


def spread_of(distances: NDArray[np.float64], name: str) -> dict[str, float]:
    """Return mean, 95th percentile and maximum of distances in millimeters, keyed for a report."""
    if len(distances) == 0:
        return {}
    return {
        f"{name}mean_mm": float(distances.mean()),
        f"{name}p95_mm": float(np.percentile(distances, 95)),
        f"{name}max_mm": float(distances.max()),
    }
