"""Cut a mesh along the line where a function of its vertices is zero."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..model.mesh import TriMesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

NEAR = 0.3
"""Share of an edge from its end within which that end moves to the line, rather than the edge being cut."""


def trimmed(mesh: TriMesh, height: Floats) -> tuple[TriMesh, NDArray[np.int64]]:
    """Keep what lies above zero.

    Parameters
    ----------
    mesh : TriMesh
    height : (n,) float array
        Finite.

    Returns
    -------
    mesh : TriMesh
    source : (m,) int64 array
        The face that each face was part of.
    """
    vertices, sign = _snapped(mesh, height)
    vertices, faces, source = _clipped(vertices, mesh.faces, sign, height)
    faces, source = _without_pinches(faces, source, len(vertices))
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    return TriMesh(vertices[used], (np.cumsum(used) - 1)[faces]), source


def _snapped(mesh: TriMesh, height: Floats) -> tuple[Floats, NDArray[np.int8]]:
    """Move the vertices that are close to the line onto it; return on which side the others are."""
    sign = np.where(height < 0, -1, 1).astype(np.int8)
    crossing = mesh.edges[sign[mesh.edges].sum(axis=1) == 0]
    ends = np.concatenate([crossing, crossing[:, ::-1]])
    share = height[ends[:, 0]] / (height[ends[:, 0]] - height[ends[:, 1]])
    step = share[:, None] * (mesh.vertices[ends[:, 1]] - mesh.vertices[ends[:, 0]])
    order = np.lexsort((ends[:, 1], (step**2).sum(axis=1)))
    order = order[share[order] < NEAR]
    moved, first = np.unique(ends[order, 0], return_index=True)
    vertices = mesh.vertices.copy()
    vertices[moved] += step[order[first]]
    sign[moved] = 0
    return vertices, sign


def _clipped(vertices, faces, sign, height):
    """Cut the edges that still cross the line, and leave out what lies below it."""
    signs = sign[faces]
    source = np.flatnonzero((signs > 0).any(axis=1))
    # turn each face so that its corner above (or, of two above, the one followed by the other) comes first
    above = signs[source] > 0
    first = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (np.argmin(above, axis=1) + 1) % 3)
    turned = faces[source[:, None], (first[:, None] + np.arange(3)) % 3]
    a, b, c = turned.T
    sa, sb, sc = sign[turned].T
    cut = {}
    edges = np.concatenate([np.stack(pair, axis=1)[where] for pair, where in (
        ((a, b), sb < 0), ((a, c), sc < 0), ((b, c), (sb > 0) & (sc < 0)))])
    keys = np.sort(edges, axis=1)
    each, number = np.unique(keys, axis=0, return_inverse=True)
    number = number.ravel() + len(vertices)
    u, v = each.T
    t = (height[u] / (height[u] - height[v]))[:, None]
    new = vertices[u] + t * (vertices[v] - vertices[u])
    n1, n2 = int((sb < 0).sum()), int((sc < 0).sum())
    ab, ac, bc = b.copy(), c.copy(), c.copy()
    ab[sb < 0] = number[:n1]
    ac[sc < 0] = number[n1:n1 + n2]
    two = (sb > 0) & (sc < 0)
    bc[two] = number[n1 + n2:]
    # one above: (a, ab, ac); two above and one below: (a, b, bc), (a, bc, ac); none below: as it is
    one = np.stack([a, ab, np.where(two, bc, ac)], axis=1)
    rest = np.stack([a, bc, ac], axis=1)[two]
    return np.concatenate([vertices, new]), np.concatenate([one, rest]), np.concatenate([source, source[two]])


def _without_pinches(faces, source, count):
    """Leave out the faces around vertices where two fans meet."""
    while True:
        half = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        keys, uses = np.unique(np.sort(half, axis=1), axis=0, return_counts=True)
        pinched = np.bincount(keys[uses == 1].ravel(), minlength=count) > 2
        kept = ~pinched[faces].any(axis=1)
        if kept.all():
            return faces, source
        faces, source = faces[kept], source[kept]
