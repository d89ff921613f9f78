"""The surface before, over which the vertices of a mesh in the making move."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.remeshing.ground import gather_fans, link
from ..kernels.remeshing.links import KEPT
from ..measure.links import Links
from .creases import find_creases
from .sizes import wanted_sizes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Ground:
    """A surface and what is known of it.

    Attributes
    ----------
    mesh : TriMesh
    faces : (m, 3) int32 array
    normals : (m, 3) float array
        Unit normals of the faces, 0 where a face has no area.
    twins : (3 m,) int32 array
        The half edge that runs the other way; -1 at a border.
    valence : (n,) int32 array
        Edges at each vertex.
    first, fans : (n + 1,), (3 m,) int32 arrays
        The faces around vertex v are ``fans[first[v]:first[v + 1]]``.
    pieces : (m,) int32 array
        The connected piece of each face.
    sizes : (n,) float array
        Length that edges should have at each vertex.
    creases : (3 m,) bool array
        Half edges along creases.
    kinds : (n,) uint8 array
        Where a vertex may go. See `tomomesh.kernels.remeshing.links`.
    """

    mesh: TriMesh
    faces: Ints
    normals: Floats
    twins: Ints
    valence: Ints
    first: Ints
    fans: Ints
    pieces: Ints
    sizes: Floats
    creases: NDArray[np.bool_]
    kinds: NDArray[np.uint8]

    @classmethod
    def of(cls, mesh: TriMesh, edge: float) -> Ground:
        """Look at a mesh that is to have edges of about a length."""
        links = Links(mesh)
        faces, count = links.faces, len(mesh.vertices)
        twins, outs = np.empty(faces.size, np.int32), np.empty(count, np.int32)
        valence, first, fans = np.zeros(count, np.int32), np.zeros(count + 1, np.int32), np.empty_like(twins)
        link(faces.reshape(-1), *links.edges, twins, outs, valence)
        gather_fans(faces, first, fans)
        normals = mesh.face_vectors / np.maximum(2 * mesh.face_areas, np.finfo(float).tiny)[:, None]
        creases, kinds = find_creases(mesh, twins, normals, edge)
        sizes = wanted_sizes(mesh, faces, edge)
        return cls(mesh, faces, normals, twins, valence, first, fans, links.face_pieces, sizes, creases, kinds)

    @property
    def ends(self) -> Ints:
        """The vertex that each half edge runs to, (3 m,)."""
        return self.faces[:, [1, 2, 0]].reshape(-1)

    def scaled(self, share: float) -> Ground:
        """Return the same with other lengths of edges."""
        return replace(self, sizes=self.sizes * share)

    def with_specks(self, few: int, least: float) -> Ground:
        """Return the same with shorter edges where a component would have fewer faces, about.

        Such a component is kept as it is where it is less round than `least`: 36 pi V^2 / A^3, which is 1 for a ball.
        """
        volume, area = (np.bincount(self.pieces, each) for each in (self.mesh.face_volumes, self.mesh.face_areas))
        piece = np.empty(len(self.sizes), np.int32)
        piece[self.faces] = self.pieces[:, None]
        short = np.sqrt(area / (EVEN * few))[piece]
        flat = (36 * np.pi * volume**2 < least * area**3)[piece] & (short < self.sizes)
        kinds = np.where(flat, np.uint8(KEPT), self.kinds)
        return replace(self, sizes=np.minimum(self.sizes, short), kinds=kinds)

    def forecast(self) -> float:
        """Return about how many faces a mesh of even triangles has with these lengths of edges."""
        return float((self.mesh.face_areas / self.sizes[self.faces].mean(axis=1) ** 2).sum()) / EVEN


EVEN = 0.25 * 3**0.5
"""Area of an equilateral triangle over the square of its side."""


def even_edge(mesh: TriMesh, faces: float) -> float:
    """Return the length of the edges of so many equilateral triangles that together are as large as a mesh."""
    return float(np.sqrt(mesh.face_areas.sum() / (EVEN * faces)))
