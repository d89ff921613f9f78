"""How the faces of a mesh hang together: edges, pieces, fans and borders."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..kernels.measure.edges import count_misoriented, join_borders, join_corners, join_vertices, order_half_edges
from ..model.columns import for_kernels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Ints = NDArray[np.int32]


class Triangles(Protocol):
    """What has vertices (n, 3) and faces (m, 3): a mesh, or a part of one."""

    @property
    def vertices(self) -> NDArray[np.float64]:
        """Positions."""

    @property
    def faces(self) -> NDArray[np.integer[Any]]:
        """Vertex numbers."""


class Links:
    """A mesh as the kernels take it, and its adjacency, each part found on first use.

    Half edge 3 f + k runs from corner k of face f to the next corner; it and that corner share the number.

    Attributes
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int32 array
    """

    def __init__(self, mesh: Triangles) -> None:
        self.vertices = for_kernels(mesh.vertices, np.float64)
        self.faces = for_kernels(mesh.faces, np.int32)

    @cached_property
    def edges(self) -> tuple[Ints, Ints]:
        """Half edges, those of one undirected edge beside each other, (3 m,); and where each edge begins, (e + 1,)."""
        order = np.empty(self.faces.size, np.int32)
        first = np.empty(self.faces.size + 1, np.int32)
        count = order_half_edges(self.faces, len(self.vertices), order, first, np.empty_like(order))
        return order, first[: count + 1].copy()

    @cached_property
    def uses(self) -> Ints:
        """Number of faces at each edge, (e,)."""
        uses: Ints = np.diff(self.edges[1])
        return uses

    @cached_property
    def borders(self) -> Ints:
        """Half edges that have no other beside them, (b,)."""
        order, first = self.edges
        borders: Ints = order[first[:-1][self.uses == 1]]
        return borders

    @cached_property
    def misoriented(self) -> int:
        """Number of edges that have two faces, and both run through it in the same direction."""
        return int(count_misoriented(self.faces, *self.edges))

    @cached_property
    def used(self) -> NDArray[np.bool_]:
        """Vertices that a face uses, (n,)."""
        used = np.zeros(len(self.vertices), np.bool_)
        used[self.faces.reshape(-1)] = True
        return used

    @cached_property
    def vertex_pieces(self) -> Ints:
        """Number of the connected piece of each vertex, in the order of their lowest vertex; -1 where unused, (n,)."""
        own = np.arange(len(self.vertices), dtype=np.int32)
        roots = own.copy()
        join_vertices(self.faces, roots)
        number = np.cumsum(self.used & (roots == own), dtype=np.int32) - np.int32(1)
        return np.where(self.used, number[roots], np.int32(-1))

    @cached_property
    def face_pieces(self) -> Ints:
        """Number of the connected piece of each face, (m,)."""
        return self.vertex_pieces[self.faces[:, 0]]

    @cached_property
    def edge_pieces(self) -> Ints:
        """Number of the connected piece of each edge, (e,)."""
        order, first = self.edges
        if self.pieces == 1:
            return np.zeros(len(first) - 1, np.int32)
        return self.vertex_pieces[self.faces.reshape(-1)[order[first[:-1]]]]

    @cached_property
    def pieces(self) -> int:
        """Number of connected pieces."""
        return int(self.vertex_pieces.max(initial=-1)) + 1

    @property
    def touching(self) -> NDArray[np.intp]:
        """Vertices at which several fans meet."""
        roots = np.arange(self.faces.size, dtype=np.int32)
        join_corners(self.faces, *self.edges, roots)
        fans = np.bincount(self.faces.reshape(-1)[np.unique(roots)], minlength=len(self.vertices))
        return np.flatnonzero(fans > 1)

    @cached_property
    def fans_and_loops(self) -> tuple[int, Ints]:
        """Number of fans, which are faces around a vertex edge by edge, and one half edge of each line of borders."""
        roots = np.arange(self.faces.size, dtype=np.int32)
        fans = join_corners(self.faces, *self.edges, roots)
        if len(self.borders):
            join_borders(self.borders, roots)
        return fans, np.unique(roots[self.borders])
