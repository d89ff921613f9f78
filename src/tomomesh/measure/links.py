"""How the faces of a mesh hang together: edges, pieces, fans and borders."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.edges import join_borders, join_corners, join_vertices, order_half_edges

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

    Ints = NDArray[np.int32]


class Links:
    """The adjacency of a mesh, each part found on first use.

    Half edge 3 f + k runs from corner k of face f to the next corner; it and that corner share the number.

    Attributes
    ----------
    faces : (m, 3) int32 array
    order : (3 m,) int32 array
        Half edges, those of one undirected edge beside each other.
    first : (e + 1,) int32 array
        The half edges of edge e are ``order[first[e]:first[e + 1]]``.
    """

    def __init__(self, mesh: TriMesh) -> None:
        self.faces = np.ascontiguousarray(mesh.faces, np.int32)
        self._count = len(mesh.vertices)
        self.order = np.empty(self.faces.size, np.int32)
        first = np.empty(self.faces.size + 1, np.int32)
        edges = order_half_edges(self.faces, self._count, self.order, first)
        self.first = first[: edges + 1].copy()

    @cached_property
    def uses(self) -> Ints:
        """Number of faces at each edge, (e,)."""
        uses: Ints = np.diff(self.first)
        return uses

    @cached_property
    def edge_faces(self) -> Ints:
        """The first face at each edge, (e,)."""
        faces: Ints = self.order[self.first[:-1]] // np.int32(3)
        return faces

    @cached_property
    def borders(self) -> Ints:
        """Half edges that have no other beside them, (b,)."""
        return self.order[self.first[:-1][self.uses == 1]]

    @cached_property
    def misoriented(self) -> int:
        """Number of edges that have two faces, and both run through it in the same direction."""
        pairs = self.first[:-1][self.uses == 2]
        start = self.faces.reshape(-1)
        return int((start[self.order[pairs]] == start[self.order[pairs + 1]]).sum())

    @cached_property
    def used(self) -> NDArray[np.bool_]:
        """Vertices that a face uses, (n,)."""
        used = np.zeros(self._count, np.bool_)
        used[self.faces.reshape(-1)] = True
        return used

    @cached_property
    def vertex_pieces(self) -> Ints:
        """Number of the connected piece of each vertex, in the order of their lowest vertex; -1 where unused, (n,)."""
        roots = np.arange(self._count, dtype=np.int32)
        join_vertices(self.faces, roots)
        lowest = self.used & (roots == np.arange(self._count))
        number = np.cumsum(lowest, dtype=np.int32) - np.int32(1)
        return np.where(self.used, number[roots], np.int32(-1))

    @cached_property
    def face_pieces(self) -> Ints:
        """Number of the connected piece of each face, (m,)."""
        return self.vertex_pieces[self.faces[:, 0]]

    @cached_property
    def pieces(self) -> int:
        """Number of connected pieces."""
        return int(self.face_pieces.max(initial=-1)) + 1

    @cached_property
    def fans(self) -> Ints:
        """The lowest corner of the fan that each corner belongs to: faces around a vertex, edge by edge, (3 m,)."""
        roots = np.arange(self.faces.size, dtype=np.int32)
        join_corners(self.faces, self.order, self.first, roots)
        return roots

    @cached_property
    def fan_count(self) -> int:
        """Number of fans around all vertices."""
        return int((self.fans == np.arange(len(self.fans))).sum())

    @cached_property
    def loops(self) -> Ints:
        """One half edge of each closed line of borders, (l,)."""
        if len(self.borders) == 0:
            return self.borders
        roots = self.fans.copy()
        join_borders(self.borders, roots)
        return np.unique(roots[self.borders])
