"""A place in each cavity of a mesh in patches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...measure.links import Links
from ...measure.shape import unfolded
from ...measure.winding import LiningFaces, places_before, winding_number
from ...model.mesh import TriMesh
from .nearest import PatchTrees

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .patch import MeshPatch, Patches
    from .seams import Gathered

    Floats = NDArray[np.float64]


def places_in(patches: Patches, whole: Gathered, cavities: int) -> Floats:
    """Return a place in each of so many cavities, (c, 3), as `tomomesh.measure.report.assess` does of a whole mesh.

    Every patch tells its own largest faces of each lining, and how far a place is from it: the least is how far it is
    from the mesh.
    """
    if not cavities:
        return np.empty((0, 3))
    volumes = unfolded(whole.table.volumes)
    found = places_before(_linings(patches, whole, volumes < 0), volumes, PatchTrees.of(patches).reach)
    if len(found) == cavities:
        return found
    return found[[abs(sum(patches.told(_around, [place]))) < 0.5 for place in found]]


def _linings(patches: Patches, whole: Gathered, inward: NDArray[np.bool_]) -> LiningFaces:
    """Return the largest faces of the connected pieces that face inward."""
    sizes = np.array(patches.told(_sizes), np.int64)
    first = np.cumsum(sizes, axis=0) - sizes
    first[:, 1] += sizes[:, 0].sum()
    numbers = np.split(whole.numbers, np.cumsum(whole.pieces)[:-1])
    found: Sequence[LiningFaces] = patches.told(_lining, numbers, [inward], list(first))
    return LiningFaces.joined(found)


def _sizes(patch: MeshPatch) -> tuple[int, int]:
    return patch.halves, len(patch.faces) - patch.halves


def _lining(
    patch: MeshPatch, numbers: NDArray[np.int64], inward: NDArray[np.bool_], first: NDArray[np.int64]
) -> LiningFaces:
    """Return a patch's own, by the numbers of its connected pieces and of its first half and quarter in the whole."""
    found = LiningFaces.of(_mesh(patch), Links(patch).face_pieces, inward[numbers])
    begin = np.where(found.numbers < patch.halves, first[0], first[1] - patch.halves)
    return found._replace(pieces=numbers[found.pieces], numbers=begin + found.numbers)


def _around(patch: MeshPatch, place: Floats) -> float:
    return winding_number(_mesh(patch), place)


def _mesh(patch: MeshPatch) -> TriMesh:
    return TriMesh(patch.vertices, patch.faces.astype(np.int64))
