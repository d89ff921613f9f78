"""Pieces and cavities that are left out of a part."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..measure.winding import pieces_of, winding_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh


def largest_piece(mesh: TriMesh) -> TriMesh:
    """Return the piece of the largest volume, with the cavities inside of the box around it that are its own.

    Others that lie in such a cavity are left out with all the rest.
    """
    piece, volumes = pieces_of(mesh)
    largest = int(np.argmax(volumes))
    inside = _inside(mesh.only(piece == largest), mesh, piece, np.flatnonzero(volumes < 0))
    return mesh.only(np.isin(piece, [largest, *inside]))


def without_cavities(mesh: TriMesh) -> TriMesh:
    """Return a mesh whose cavities are filled, and what floats in them with them."""
    piece, volumes = pieces_of(mesh)
    linings = np.flatnonzero(volumes < 0)
    if not len(linings):
        return mesh
    filled = mesh.only(~np.isin(piece, linings))
    piece, volumes = pieces_of(filled)
    floating = [
        number for number in range(len(volumes))
        if _inside(filled.only(piece != number), filled, piece, np.array([number]))
    ]  # fmt: skip
    return filled.only(~np.isin(piece, floating))


def _inside(solid: TriMesh, mesh: TriMesh, piece: NDArray[np.int32], numbers: NDArray[np.int64]) -> list[int]:
    """Return those pieces of a mesh, among some, that a solid goes around."""
    if not len(solid.faces):
        return []
    first = [mesh.vertices[mesh.faces[np.argmax(piece == number), 0]] for number in numbers]
    return [int(n) for n, place in zip(numbers, first, strict=True) if winding_number(solid, place) > 0.5]
