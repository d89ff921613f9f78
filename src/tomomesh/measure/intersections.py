"""Faces of a mesh that pass through each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels.measure.intersections import mark_intersections
from ..kernels.threads import in_blocks
from ..model.columns import any_of
from ..progress import Progress, silent
from .tree import Tree

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

BLOCK = 2_000
"""Leaves of the tree handled at once: some milliseconds."""
ROOM = 1_000
"""Pairs looked for first: where there are more, room is made. No result depends on it."""


def self_intersections(mesh: TriMesh, *, threads: int = 0, progress: Progress = silent) -> NDArray[np.bool_]:
    """Mark the faces that pass through others.

    Two faces pass through each other where they have a point in common that is inside of one of them at least:
    not on its border, so that neighbors may share a vertex or an edge, and faces of different vertices may touch
    along their sides. Faces in one plane count where they overlap, as a face that is folded onto its neighbor
    does; a face without area passes through nothing. Exact but for positions that differ by rounding, which count
    as touching.

    Parameters
    ----------
    mesh : TriMesh
        Finite vertices.
    threads : int
        0 is one a core.
    progress : callable
        Told how far the work is; what it raises ends the work.

    Returns
    -------
    (m,) bool array

    Notes
    -----
    Cost is proportional to the pairs of faces whose boxes meet: nearly to the faces, but to the square of the faces
    that share one vertex.
    """
    if len(mesh.faces) == 0:
        return np.zeros(0, np.bool_)
    return marked_in(Tree.of_faces(mesh, threads=threads), threads=threads, progress=progress)


class CrossingFaces:
    """Mark the faces that pass through others (see `self_intersections`), again and again as vertices move.

    Under `single` they are judged at positions of 32 bits, as STL holds them: sheets that nearly coincide are pushed
    through each other by rounding (measured: a sphere pressed flat over a skull, 34 faces).
    """

    def __init__(self, threads: int = 0, *, single: bool = False) -> None:
        self._threads, self._single = threads, single
        self._tree: Tree | None = None

    def __call__(self, mesh: TriMesh, moved: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
        """Mark the faces (m,) of a mesh.

        Parameters
        ----------
        mesh : TriMesh
        moved : (n,) bool array, optional
            The vertices that have moved since the last call, all marked ones among them, where nothing else changed.
        """
        if not len(mesh.faces):
            return np.zeros(0, np.bool_)
        if self._single:
            mesh = mesh.moved(mesh.vertices.astype(np.float32).astype(np.float64))
        if self._tree is None or moved is None:
            self._tree = Tree.of_faces(mesh, threads=self._threads)
            return marked_in(self._tree, threads=self._threads)
        self._tree = self._tree.moved(mesh.vertices, threads=self._threads)
        return marked_in(self._tree, any_of(moved[mesh.faces]), threads=self._threads)

    def handed_over(self) -> Tree | None:
        """Return the tree of the mesh that was last looked at, and keep it no longer."""
        tree, self._tree = self._tree, None
        return tree


def crossing_of(mesh: TriMesh, some: NDArray[np.bool_], *, threads: int = 0) -> NDArray[np.bool_]:
    """Mark the faces (m,) of a mesh that pass through `some` of them (m,), and these where they do."""
    return marked_in(Tree.of_faces(mesh, threads=threads), some, threads=threads)


def marked_in(
    tree: Tree, asked: NDArray[np.bool_] | None = None, *, threads: int = 0, progress: Progress = silent
) -> NDArray[np.bool_]:
    """Mark the faces of a tree that pass through others, or through the faces (m,) that are asked for."""
    found, marked = np.zeros((2, len(tree.order)), np.bool_)
    no_pairs = np.empty((0, 2), np.int64)
    nodes = np.ones(2 * tree.leaves, np.bool_) if asked is None else tree.nodes_with(asked)

    def mark(start: int, stop: int) -> None:
        mark_intersections(tree.vertices, tree.simplices, tree.boxes, nodes, found, no_pairs, start, stop)

    def done(count: int) -> None:
        progress("intersections", count, tree.leaves)

    in_blocks(mark, tree.leaves, block=BLOCK, threads=threads, done=done)
    marked[tree.order] = found
    return marked


def intersecting_pairs(mesh: TriMesh) -> NDArray[np.int64]:
    """Return the pairs of faces that pass through each other, the lower number first, sorted, (k, 2)."""
    if len(mesh.faces) == 0:
        return np.empty((0, 2), np.int64)
    tree, count, pairs = Tree.of_faces(mesh), ROOM, np.empty((0, 2), np.int64)
    while count > len(pairs):
        pairs, marked = np.empty((count, 2), np.int64), np.zeros(len(tree.order), np.bool_)
        nodes = np.ones(2 * tree.leaves, np.bool_)
        count = mark_intersections(tree.vertices, tree.simplices, tree.boxes, nodes, marked, pairs, 0, tree.leaves)
    found = np.sort(tree.order[pairs[:count]].astype(np.int64), axis=1)
    return found[np.lexsort(found.T[::-1])]
