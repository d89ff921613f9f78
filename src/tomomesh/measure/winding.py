"""How often a surface goes around a place; which of its pieces line cavities, and a place in each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..model.mesh import TriMesh
from .links import Links
from .shape import MeshExtent, areas_and_volumes, unfolded
from .tree import Tree

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

TRIES = 16
"""Faces of a lining, its largest, before which a place in the cavity is looked for: one before which there is room is
enough, and the farthest is taken. Chosen: half and twice of it find a place as well, a nearer or a farther one."""
HALVINGS = 40
"""Times that a distance is halved where there is no room: 1e-12 of the cavity's size, below which no face is."""
TOUCHES = 1 - 1e-6
"""Share of a ball's radius within which the face that it touches may be the nearest: what 64 bits leave of it where the
coordinates are a billion times as large."""


def winding_number(mesh: TriMesh, place: NDArray[np.float64]) -> float:
    """Return how often a mesh goes around a place (3,): 1 inside of a closed, outward one, 0 outside.

    The sum of the solid angles of all faces over 4 pi (Jacobson, Kavan & Sorkine-Hornung 2013), each by the formula
    of van Oosterom & Strackee (1983). The place lies on no face.
    """
    a, b, c = (mesh.vertices[mesh.faces[:, n]] - place for n in range(3))
    x, y, z = (np.sqrt((corner**2).sum(axis=1)) for corner in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=1)
    below = x * y * z + (a * b).sum(axis=1) * z + (b * c).sum(axis=1) * x + (c * a).sum(axis=1) * y
    return float(np.arctan2(volume, below).sum() / (2 * np.pi))


def pieces_of(mesh: TriMesh) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Return the number of the connected piece of each face, (m,), and the signed volume of each piece, (c,)."""
    links = Links(mesh)
    volumes = areas_and_volumes(links)[1]
    return links.face_pieces, unfolded(MeshExtent.of(links).volumes(volumes, links.face_pieces, links.pieces))


def linings(mesh: TriMesh) -> int:
    """Count the pieces of a closed mesh that line a cavity: those of negative volume that others go around."""
    piece, volumes = pieces_of(mesh)
    count = 0
    for inward in np.flatnonzero(volumes < 0):
        others = TriMesh(mesh.vertices, mesh.faces[piece != inward])
        place = mesh.vertices[mesh.faces[np.argmax(piece == inward), 0]]
        count += winding_number(others, place) > 0.5
    return int(count)


def places_in_cavities(mesh: TriMesh, *, tree: Tree | None = None, threads: int = 0) -> NDArray[np.float64]:
    """Return a place in each cavity of a mesh, as programs that fill a mesh with finite elements ask for.

    Before faces of its lining balls are laid that touch them, and halved until no other face reaches into them. So each
    ball is empty, and its middle is on the same side as the face that it touches, whatever else lies in the cavity.

    Parameters
    ----------
    mesh : TriMesh
        Closed; its pieces of negative volume line cavities.
    tree : Tree, optional
        That of its faces.
    threads : int
        0 is one a core.

    Returns
    -------
    (c, 3) float array
        In the order of the lowest vertex of each lining; none for one without room for a ball.
    """
    piece, volumes = pieces_of(mesh)
    tree = Tree.of_faces(mesh, threads=threads) if tree is None else tree
    linings = LiningFaces.of(mesh, piece, volumes < 0)
    return places_before(linings, volumes, lambda places: tree.nearest(places, threads=threads)[0])


class LiningFaces(NamedTuple):
    """Faces before which a place is looked for: of each lining the largest, `TRIES` at most and none without area.

    Attributes
    ----------
    pieces : (n,) int array
        The connected piece that each is of.
    areas : (n,) float array
    numbers : (n,) int64 array
        Their own.
    middles, normals : (n, 3) float array
    """

    pieces: NDArray[np.integer[Any]]
    areas: NDArray[np.float64]
    numbers: NDArray[np.int64]
    middles: NDArray[np.float64]
    normals: NDArray[np.float64]

    @classmethod
    def of(cls, mesh: TriMesh, piece: NDArray[np.int32], some: NDArray[np.bool_]) -> LiningFaces:
        """Take them from a mesh whose faces belong to pieces (m,), of which some (c,) are linings."""
        areas = mesh.face_areas
        asked = np.flatnonzero(some[piece] & (areas > 0))
        faces = asked[_largest(piece[asked], areas[asked], asked)]
        middles, normals = mesh.corners[faces].mean(axis=1), mesh.face_vectors[faces]
        return cls(piece[faces], areas[faces], faces, middles, normals / (2 * areas[faces, None]))

    @classmethod
    def joined(cls, parts: Sequence[LiningFaces]) -> LiningFaces:
        """Return those of a mesh, of those of its parts."""
        every = [np.concatenate(column) for column in zip(*parts, strict=True)]
        rows = _largest(*every[:3])
        return cls(*(column[rows] for column in every))


def places_before(
    faces: LiningFaces, volumes: NDArray[np.float64], reach: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Return a place before one face of each lining, see `places_in_cavities`.

    Parameters
    ----------
    faces : LiningFaces
    volumes : (c,) float array
        Of the connected pieces.
    reach : callable
        Returns how far places (n, 3) are from the mesh, (n,).
    """
    middles, normals = faces.middles, faces.normals
    radii, free = np.cbrt(np.abs(volumes[faces.pieces])), np.zeros(len(middles), np.bool_)
    for _ in range(HALVINGS):
        left = np.flatnonzero(~free)
        if not len(left):
            break
        free[left] = reach(middles[left] + radii[left, None] * normals[left]) >= TOUCHES * radii[left]
        radii[left] /= np.where(free[left], 1, 2)
    order = np.lexsort((-radii, ~free, faces.pieces))
    _, first = np.unique(faces.pieces[order], return_index=True)
    taken = order[first][free[order[first]]]
    return np.asarray(middles[taken] + radii[taken, None] * normals[taken])


def _largest(
    pieces: NDArray[np.integer[Any]], areas: NDArray[np.float64], numbers: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the largest of some faces, `TRIES` at most of each piece; of equal ones those that come first."""
    order = np.lexsort((numbers, -areas, pieces))
    first = np.searchsorted(pieces[order], pieces[order], side="left")
    return order[np.arange(len(order)) - first < TRIES]
