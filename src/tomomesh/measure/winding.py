"""How often a surface goes around a place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..model.mesh import TriMesh
from .links import Links
from .shape import areas_and_volumes

if TYPE_CHECKING:
    from numpy.typing import NDArray


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
    return links.face_pieces, np.bincount(links.face_pieces, volumes, links.pieces).astype(np.float64)


def linings(mesh: TriMesh) -> int:
    """Count the pieces of a closed mesh that line a cavity: those of negative volume that others go around."""
    piece, volumes = pieces_of(mesh)
    count = 0
    for inward in np.flatnonzero(volumes < 0):
        others = TriMesh(mesh.vertices, mesh.faces[piece != inward])
        place = mesh.vertices[mesh.faces[np.argmax(piece == inward), 0]]
        count += winding_number(others, place) > 0.5
    return int(count)
