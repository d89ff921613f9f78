"""From what files hold to triangles: polygons and strips cut up, equal positions found exactly, seams joined."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...measure.links import Links
from ...measure.topology import first_equals
from ...model.mesh import TriMesh

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    Arrays = tuple[NDArray[np.float64], NDArray[np.int64]]
    """Vertices (n, 3) and faces (m, 3)."""


def weld(positions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return each position once, and where every one of the old ones went.

    Parameters
    ----------
    positions : (n, 3) float array
        Finite.

    Returns
    -------
    unique : (u, 3) float array
        In the order of their first appearance.
    numbers : (n,) int64 array
        ``unique[numbers]`` equals `positions`.
    """
    positions = np.array(positions, np.float64, order="C")
    first = first_equals(positions)
    kept = first == np.arange(len(first))
    return positions[kept], (np.cumsum(kept) - 1)[first]


def joined(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Arrays:
    """Join borders that lie on each other, as writers leave them that give each face its own normals or colors.

    Vertices away from a border stay, whatever their positions; so do all where an edge would get two faces that run
    along it in the same way.
    """
    count, borders = len(vertices), Links(TriMesh(vertices, faces)).borders
    if not len(borders):
        return vertices, faces
    at = np.unique([ends[borders] for ends in _edges(faces)])
    numbers = weld(vertices[at])[1]
    _, first = np.unique(numbers, return_index=True)
    target = np.arange(count)
    target[at] = at[first][numbers]
    after = target[faces]
    if len(first) == len(at) or _repeated(after, count) > _repeated(faces, count):
        return vertices, faces
    kept = target == np.arange(count)
    return vertices[kept], (np.cumsum(kept) - 1)[after]


def _edges(faces: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where the edges of all faces (3m,) begin and end."""
    return faces.ravel(), faces[:, [1, 2, 0]].ravel()


def _repeated(faces: NDArray[np.int64], count: int) -> int:
    """Count the faces that run along an edge as another one does, and edges without a length."""
    tails, heads = _edges(faces)
    return len(tails) - len(np.unique(tails * count + heads)) + int((tails == heads).sum())


def together(meshes: Iterable[Arrays]) -> Arrays:
    """Put meshes beside each other: the vertices of all, and the faces by their numbers among these."""
    parts = list(meshes)
    if len(parts) == 1:
        return parts[0]
    first = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    vertices = [np.empty((0, 3)), *(vertices for vertices, _ in parts)]
    faces = [np.empty((0, 3), np.int64), *(faces + n for (_, faces), n in zip(parts, first, strict=False))]
    return np.concatenate(vertices), np.concatenate(faces)


def fans(corners: NDArray[np.int64], sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Cut polygons into triangles around the first corner of each.

    Parameters
    ----------
    corners : (c,) int64 array
        The corners of all polygons, one after the other.
    sizes : (p,) int64 array
        Corners of each, at least 3.

    Returns
    -------
    (c - 2p, 3) int64 array
    """
    if (sizes == 3).all():
        return corners.reshape(-1, 3)
    first = np.repeat(np.cumsum(sizes) - sizes, sizes - 2)
    step = np.arange(len(first)) - np.repeat(np.cumsum(sizes - 2) - (sizes - 2), sizes - 2)
    return np.asarray(corners[np.stack([first, first + step + 1, first + step + 2], axis=1)])


def strips(corners: NDArray[np.int64], sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Cut strips into triangles, every second of which runs the other way around.

    Parameters
    ----------
    corners : (c,) int64 array
        The corners of all strips, one after the other; -1 ends one too.
    sizes : (p,) int64 array
        Corners of each.

    Returns
    -------
    (m, 3) int64 array
        Without those that turn a strip, of which two corners are one.
    """
    if len(corners) < 3:
        return np.empty((0, 3), np.int64)
    begins = np.zeros(len(corners) + 1, bool)
    begins[np.cumsum(sizes) - sizes] = begins[0] = True
    begins = begins[:-1]
    begins[1:] |= corners[:-1] == -1
    begin = np.maximum.accumulate(np.where(begins, np.arange(len(corners)), 0))
    three = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    odd = (np.arange(len(three)) - begin[:-2]) % 2 == 1
    three[odd] = three[odd][:, ::-1]
    apart = (three != np.roll(three, 1, axis=1)).all(axis=1)
    return np.asarray(three[(begin[:-2] == begin[2:]) & (three >= 0).all(axis=1) & apart])
