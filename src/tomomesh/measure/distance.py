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
    plus its radius cannot be nearer, so the result is exact. Faces of like size are searched together, or one
    large face would widen the search for all.

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
    radii = np.sqrt(((mesh.corners - centers[:, None]) ** 2).sum(axis=2).max(axis=1))
    size = np.round(np.log2(np.maximum(radii, 1e-300)) / 2)
    best = np.full(len(points), np.inf)
    for one in np.unique(size):
        alike = np.flatnonzero(size == one)
        tree, radius, corners = cKDTree(centers[alike]), float(radii[alike].max()), mesh.corners[alike]
        for n in range(0, len(points), BLOCK):
            _search(points[n : n + BLOCK], corners, tree, radius, best[n : n + BLOCK])
    return best


def _search(
    points: NDArray[np.float64], corners: NDArray[np.float64], tree: cKDTree, radius: float, best: NDArray[np.float64]
) -> None:
    """Lower the best distances (n,) to those of some faces, looking at more and more until none can be nearer."""
    left, count = np.arange(len(points)), min(FIRST_TRY, len(corners))
    while len(left):
        reach, face = (np.asarray(a) for a in tree.query(points[left], k=np.arange(1, count + 1), workers=-1))
        found = np.empty(len(left))
        nearest_triangle(points[left], corners, face.astype(np.int64), reach, radius, found)
        best[left] = np.minimum(best[left], found)
        left = left[(reach[:, -1] < best[left] + radius) & (count < len(corners))]
        count = min(2 * count, len(corners))


def spread_of(distances: NDArray[np.float64], name: str) -> dict[str, float]:
    """Return mean, 95th percentile and maximum of distances in millimeters, keyed for a report."""
    if len(distances) == 0:
        return {}
    return {
        f"{name}mean_mm": float(distances.mean()),
        f"{name}p95_mm": float(np.percentile(distances, 95)),
        f"{name}max_mm": float(distances.max()),
    }
