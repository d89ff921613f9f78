"""Holes are capped by a membrane: each vertex where nothing was measured lies in the middle of its neighbors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh


def capped(mesh: TriMesh, free: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Span the border of what was measured by a membrane.

    Parameters
    ----------
    mesh : TriMesh
        Closed.
    free : (n,) bool array
        Vertices that are to lie on the membrane. A piece of the mesh without others keeps its place.

    Returns
    -------
    (n, 3) float array
        Where each free vertex is the mean of its neighbors, so that the cap of a flat border is flat (Floater 1997);
        the others stay.
    """
    count, (a, b) = len(free), mesh.edges.T
    one_way = sparse.coo_array((np.ones(len(a)), (a, b)), shape=(count, count))
    links = sparse.csr_array(one_way + one_way.T)
    _, piece = connected_components(links, directed=False)
    held = np.bincount(piece, ~free) > 0
    moving = np.flatnonzero(free & held[piece])
    if len(moving) == 0:
        return mesh.vertices
    fixed = np.ones(count, np.bool_)
    fixed[moving] = False
    rows = links[moving]
    system = sparse.diags_array(rows.sum(axis=1)) - rows[:, moving]
    vertices = mesh.vertices.copy()
    vertices[moving] = splu(sparse.csc_array(system)).solve(rows[:, np.flatnonzero(fixed)] @ mesh.vertices[fixed])
    return vertices
