"""A finer mesh: each triangle divided into three squares."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh


def squares_of(mesh: TriMesh) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Divide each triangle at the middles of its sides and at its own middle.

    Parameters
    ----------
    mesh : TriMesh
        A closed 2-manifold of n vertices, e edges and m faces.

    Returns
    -------
    vertices : (n + e + m, 3) float array
        The mesh's own, the middles of its edges, and those of its faces.
    quads : (3m, 4) int32 array
        As each face turns: a corner, the side after it, the middle, the side before it.
    """
    n, e, m = len(mesh.vertices), len(mesh.edges), len(mesh.faces)
    ends = np.sort(mesh.half_edges, axis=1)
    side = n + np.searchsorted(mesh.edges[:, 0] * n + mesh.edges[:, 1], ends[:, 0] * n + ends[:, 1]).reshape(m, 3)
    middle = np.repeat(n + e + np.arange(m), 3).reshape(m, 3)
    quads = np.stack([mesh.faces, side, middle, np.roll(side, 1, axis=1)], axis=2).reshape(-1, 4)
    places = [mesh.vertices, mesh.vertices[mesh.edges].mean(axis=1), mesh.corners.mean(axis=1)]
    return np.concatenate(places), quads.astype(np.int32)
