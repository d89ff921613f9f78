"""The surface before, over which the vertices of a mesh in the making move."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.remeshing.links import KEPT
from ..kernels.remeshing.surface import face_normals, gather_fans, link
from ..kernels.threads import in_blocks
from ..measure.links import Links
from ..measure.shape import areas_and_volumes
from ..model.columns import mean_over
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
    twins : (3 m,) int32 array
        The half edge that runs the other way; -1 at a border.
    valence : (n,) int32 array
        Edges at each vertex.
    first, fans : (n + 1,), (3 m,) int32 arrays
        The faces around vertex v are ``fans[first[v]:first[v + 1]]``.
    pieces : (m,) int32 array
        The connected piece of each face.
    areas : (m,) float array
    volumes : (p,) float array
        Signed volume of each piece.
    sizes : (n,) float array
        Length that edges should have at each vertex.
    creases : (3 m,) bool array
        Half edges along creases.
    kinds : (n,) uint8 array
        Where a vertex may go. See `tomomesh.kernels.remeshing.links`.
    """

    mesh: TriMesh
    faces: Ints
    twins: Ints
    valence: Ints
    first: Ints
    fans: Ints
    pieces: Ints
    areas: Floats
    volumes: Floats
    sizes: Floats
    creases: NDArray[np.bool_]
    kinds: NDArray[np.uint8]

    @classmethod
    def of(cls, mesh: TriMesh, edge: float, threads: int = 0) -> Ground:
        """Look at a mesh that is to have edges of about a length."""
        links = Links(mesh)
        faces, count = links.faces, len(mesh.vertices)
        first, fans = np.zeros(count + 1, np.int32), np.empty(faces.size, np.int32)
        gather_fans(faces, first, fans)
        twins, valence = np.empty_like(fans), np.empty(count, np.int32)
        in_blocks(
            lambda start, stop: link(faces.reshape(-1), first, fans, twins, valence, start, stop),
            count, block=BLOCK, threads=threads,
        )  # fmt: skip
        normals = np.empty((len(faces), 3))
        in_blocks(
            lambda start, stop: face_normals(mesh.vertices, faces, normals, start, stop),
            len(faces), block=BLOCK, threads=threads,
        )  # fmt: skip
        areas, under = areas_and_volumes(links, threads=threads)
        volumes = np.asarray(np.bincount(links.face_pieces, under), np.float64)
        creases, kinds = find_creases(mesh, twins, normals, edge)
        sizes = wanted_sizes(mesh.vertices, faces, normals, areas, edge)
        return cls(
            mesh, faces, twins, valence, first, fans, links.face_pieces, areas, volumes, sizes, creases, kinds
        )  # fmt: skip

    def scaled(self, share: float) -> Ground:
        """Return the same with other lengths of edges."""
        return replace(self, sizes=self.sizes * share)

    def scaled_at(self, faces: Ints, share: float) -> Ground:
        """Return the same with other lengths of edges around some of its faces."""
        sizes = self.sizes.copy()
        sizes[np.unique(self.faces[faces])] *= share
        return replace(self, sizes=sizes)

    def with_specks(self, few: int, least: float) -> Ground:
        """Return the same with shorter edges where a component would have fewer faces, about.

        Such a component is kept as it is where it is less round than `least`: 36 pi V^2 / A^3, which is 1 for a ball.
        """
        area, volume = np.bincount(self.pieces, self.areas), self.volumes
        short = np.sqrt(area / (EVEN * few))
        if short.min() >= self.sizes.max():
            return self
        piece = np.empty(len(self.sizes), np.int32)
        piece[self.faces] = self.pieces[:, None]
        flat = (36 * np.pi * volume**2 < least * area**3)[piece] & (short[piece] < self.sizes)
        kinds = np.where(flat, np.uint8(KEPT), self.kinds)
        return replace(self, sizes=np.minimum(self.sizes, short[piece]), kinds=kinds)

    def forecast(self) -> float:
        """Return about how many faces a mesh of even triangles has with these lengths of edges."""
        return float((self.areas / mean_over(self.sizes, self.faces) ** 2).sum()) / (EVEN * LONGER**2)


BLOCK = 20_000
"""Faces or vertices handled at once: some milliseconds. No result depends on it."""
EVEN = 0.25 * 3**0.5
"""Area of an equilateral triangle over the square of its side."""
LONGER = 1.05
"""Usual length of edges over what is wanted, which lies between those that are split and those that collapse: measured,
1.05 to 1.08."""


def even_edge(area: float, faces: float) -> float:
    """Return the length of the edges of so many equilateral triangles that together have an area."""
    return float(np.sqrt(area / (EVEN * faces)))


def area_of(mesh: TriMesh, threads: int = 0) -> float:
    """Return the area of a mesh."""
    return float(areas_and_volumes(Links(mesh), threads=threads)[0].sum())


def usual_edge(mesh: TriMesh, threads: int = 0) -> float:
    """Return the length of the edge of an equilateral triangle of the mean area of the faces of a mesh."""
    return even_edge(area_of(mesh, threads), len(mesh.faces))
