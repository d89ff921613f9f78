"""Triangles with their adjacency."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ResourceError
from .columns import for_kernels, parts_of

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class TriMesh:
    """A triangle mesh: two arrays, and whatever follows from them on first use.

    Arrays of any type and order of memory are taken, lists too; a copy is made where they are not as below.

    Attributes
    ----------
    vertices : (n, 3) float array
        Positions (x, y, z).
    faces : (m, 3) int64 array
        Vertex numbers, counter-clockwise seen from outside.

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh import TriMesh
    >>> corner = TriMesh(np.eye(4, 3, -1), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    >>> round(6 * float(corner.face_volumes.sum()), 9), len(corner.edges)
    (1.0, 6)
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", for_kernels(self.vertices, np.float64))
        object.__setattr__(self, "faces", for_kernels(self.faces, np.int64))

    def moved(self, vertices: NDArray[np.float64]) -> TriMesh:
        """Return the same faces over other positions."""
        return replace(self, vertices=vertices)

    def only(self, kept: NDArray[np.bool_]) -> TriMesh:
        """Return some of the faces (m,), and the vertices that they use, in the order that they had."""
        faces, used = self.faces[kept], np.zeros(len(self.vertices), np.bool_)
        used[faces] = True
        return TriMesh(self.vertices[used], (np.cumsum(used) - 1)[faces])

    @property
    def corners(self) -> NDArray[np.float64]:
        """Positions of the three corners of every face, (m, 3, 3); not kept, for they are four times the mesh."""
        return self.vertices[self.faces]

    @property
    def face_vectors(self) -> NDArray[np.float64]:
        """Outward normals whose length is twice the face's area, (m, 3); not kept: they are as large as it."""
        found = np.empty((len(self.faces), 3))
        for part in parts_of(len(found)):
            a, b, c = (self.vertices[corner] for corner in self.faces[part].T)
            found[part] = np.cross(b - a, c - a)
        return found

    @cached_property
    def face_areas(self) -> NDArray[np.float64]:
        """Areas of the faces, (m,)."""
        return np.asarray(0.5 * np.sqrt((self.face_vectors**2).sum(axis=1)))

    @cached_property
    def face_volumes(self) -> NDArray[np.float64]:
        """Signed volume under each face, (m,); their sum is the volume of a closed mesh."""
        center = self.vertices.mean(axis=0) if len(self.vertices) else np.zeros(3)
        return np.asarray(((self.vertices[self.faces[:, 0]] - center) * self.face_vectors).sum(axis=1) / 6)

    @property
    def half_edges(self) -> NDArray[np.int64]:
        """Directed edges, three a face, (3m, 2); not kept, for they are twice the faces."""
        return self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)

    @cached_property
    def edges(self) -> NDArray[np.int64]:
        """Undirected edges, smaller vertex first, sorted, each once, (e, 2)."""
        return _once_each(self.half_edges, len(self.vertices))

    @cached_property
    def vertex_normals(self) -> NDArray[np.float64]:
        """Unit normals at the vertices, area-weighted, (n, 3)."""
        columns = self.face_vectors.T
        total = np.stack(
            [np.bincount(self.faces.ravel(), np.repeat(column, 3), len(self.vertices)) for column in columns], axis=1
        )
        length = np.sqrt((total**2).sum(axis=1, keepdims=True))
        return total / np.where(length > 0, length, 1.0)

    def to_pyvista(self) -> Any:
        """Return PyVista's ``PolyData`` of the same vertices and faces, in arrays of its own.

        Raises
        ------
        ResourceError
            Where PyVista is not installed.
        """
        return _package("pyvista").PolyData.from_regular_faces(self.vertices.copy(), self.faces.copy())

    def to_trimesh(self) -> Any:
        """Return trimesh's ``Trimesh`` of the same vertices and faces, in arrays of its own; none is merged or dropped.

        Examples
        --------
        >>> import numpy as np
        >>> from tomomesh import TriMesh
        >>> corner = TriMesh(np.eye(4, 3, -1), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
        >>> corner.to_trimesh().is_watertight
        True
        """
        return _package("trimesh").Trimesh(self.vertices.copy(), self.faces.copy(), process=False)


@dataclass(frozen=True)
class QuadMesh:
    """A cuberille: square faces on the lattice of cubes.

    Attributes
    ----------
    vertices : (n, 3) float array
        Positions (x, y, z).
    quads : (q, 4) int64 array
        Vertex numbers, counter-clockwise seen from outside.
    """

    vertices: NDArray[np.float64]
    quads: NDArray[np.int64]

    @cached_property
    def edges(self) -> NDArray[np.int64]:
        """Undirected sides of the squares, each once, (e, 2)."""
        return _once_each(self.quads[:, [0, 1, 1, 2, 2, 3, 3, 0]].reshape(-1, 2), len(self.vertices))

    def triangulated(self) -> TriMesh:
        """Split each square by its diagonal 0-2 (the paper's systematic triangulation, Fig. 8b)."""
        return TriMesh(self.vertices, self.quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))


def _once_each(directed: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Return the undirected edges under directed ones (h, 2) of so many vertices, sorted, (e, 2)."""
    n = max(count, 1)
    keys = np.unique(directed.min(axis=1) * n + directed.max(axis=1))
    return np.stack([keys // n, keys % n], axis=1)


def _package(name: str) -> Any:
    """Import a program's package that a mesh is handed to.

    Raises
    ------
    ResourceError
        Where it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise ResourceError(
            "the mesh cannot be handed on", found=f"{name} = not installed", hint=f"pip install {name}"
        ) from None
