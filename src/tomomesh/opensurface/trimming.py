"""Cut a mesh along the line where a height over its vertices is zero."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..model.mesh import TriMesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

LEAST_SCRAP = 0.002
"""Share of the faces under which a piece that was cut off is left out. Chosen: half and twice of it change no case of
benchmarks/constants.py."""


def trimmed(mesh: TriMesh, height: Floats, near: float) -> tuple[TriMesh, Integers]:
    """Keep what lies above zero.

    Parameters
    ----------
    mesh : TriMesh
        A 2-manifold, with borders or without.
    height : (n,) float array
        Finite.
    near : float
        Share of an edge from its end within which that end moves to the line, so that no sliver is cut off.

    Returns
    -------
    mesh : TriMesh
        A 2-manifold with borders.
    source : (m,) int64 array
        The face that each face was part of.
    """
    free = np.ones(len(height), bool)
    while True:
        vertices, side = _snapped(mesh, height, near, free)
        vertices, faces, source = _cut(vertices, mesh.faces, side, height)
        pinched = _pinched(faces, len(vertices))[: len(height)] & (side == 0)
        if not pinched.any():
            break
        free &= ~pinched
    faces, source = _manifold(faces, source, len(vertices))
    kept = _large(faces, len(vertices))
    faces, source, used = faces[kept], source[kept], np.zeros(len(vertices), bool)
    used[faces] = True
    return TriMesh(vertices[used], (np.cumsum(used) - 1)[faces]), source


def rim(faces: Integers) -> Integers:
    """Return the edges of one face, smaller vertex first, (b, 2)."""
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, uses = np.unique(sides, axis=0, return_counts=True)
    return np.asarray(edges[uses == 1])


def _snapped(mesh: TriMesh, height: Floats, near: float, free: NDArray[np.bool_]) -> tuple[Floats, NDArray[np.int8]]:
    """Move free vertices close to the line onto it; return on which side each is: above 1, on it 0, below -1."""
    side = np.where(height < 0, -1, 1).astype(np.int8)
    across = mesh.edges[side[mesh.edges].sum(axis=1) == 0]
    start, end = np.concatenate([across, across[:, ::-1]]).T
    share = height[start] / (height[start] - height[end])
    step = share[:, None] * (mesh.vertices[end] - mesh.vertices[start])
    order = np.lexsort((end, (step**2).sum(axis=1)))
    order = order[(share[order] < near) & free[start[order]]]
    moved, first = np.unique(start[order], return_index=True)
    vertices = mesh.vertices.copy()
    vertices[moved] += step[order[first]]
    side[moved] = 0
    return vertices, side


def _cut(
    vertices: Floats, faces: Integers, side: NDArray[np.int8], height: Floats
) -> tuple[Floats, Integers, Integers]:
    """Put a vertex where an edge still crosses the line, and leave out what lies below.

    Faces are turned so that a comes first, the corner above or the first of two: then (a, ab, ac) remains where only
    a is above, (a, b, bc) and (a, bc, ac) where c alone is below.
    """
    source = np.flatnonzero((side[faces] > 0).any(axis=1))
    above = side[faces[source]] > 0
    first = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (above.argmin(axis=1) + 1) % 3)
    first[(side[faces[source]] >= 0).all(axis=1)] = 0
    a, b, c = faces[source[:, None], (first[:, None] + np.arange(3)) % 3].T
    two = (side[b] > 0) & (side[c] < 0)
    wanted = (a, b, side[b] < 0), (a, c, side[c] < 0), (b, c, two)
    ends = np.concatenate([np.sort(np.stack([u[where], v[where]], axis=1), axis=1) for u, v, where in wanted])
    each, number = np.unique(ends, axis=0, return_inverse=True)
    u, v = each.T
    share = height[u] / (height[u] - height[v])
    placed = np.concatenate([vertices, vertices[u] + share[:, None] * (vertices[v] - vertices[u])])
    pieces = np.split(number.ravel() + len(vertices), np.cumsum([int(where.sum()) for *_, where in wanted])[:-1])
    ab, ac, bc = b.copy(), c.copy(), c.copy()
    ab[side[b] < 0], ac[side[c] < 0], bc[two] = pieces
    one = np.stack([a, ab, np.where(two, bc, ac)], axis=1)
    return placed, np.concatenate([one, np.stack([a, bc, ac], axis=1)[two]]), np.append(source, source[two])


def _manifold(faces: Integers, source: Integers, count: int) -> tuple[Integers, Integers]:
    """Leave out the faces around vertices where two fans meet."""
    while (pinched := _pinched(faces, count)).any():
        kept = ~pinched[faces].any(axis=1)
        faces, source = faces[kept], source[kept]
    return faces, source


def _pinched(faces: Integers, count: int) -> NDArray[np.bool_]:
    """Tell at which vertices, (n,), two fans of faces meet."""
    return np.asarray(np.bincount(rim(faces).ravel(), minlength=count) > 2)


def _large(faces: Integers, count: int) -> NDArray[np.bool_]:
    """Tell which faces (m,) belong to no crumb."""
    pairs = faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    links = scipy.sparse.coo_array((np.ones(len(pairs), bool), pairs.T), shape=(count, count))
    _, label = scipy.sparse.csgraph.connected_components(links, directed=False)
    piece = label[faces[:, 0]]
    return np.asarray(np.bincount(piece)[piece] >= LEAST_SCRAP * len(faces))
