"""Pieces and handles, of a mesh and of the voxels that it was made of, dust left out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import binary_closing, generate_binary_structure, label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.model.mesh import TriMesh

    Mask = NDArray[np.bool_]

DUST = 20
"""Voxels, below which a piece or a cavity is dust, in a mesh as in its window."""


def pieces_of_mesh(mesh: TriMesh, dust_mm3: float) -> tuple[int, int]:
    """Count the outward pieces of a mesh, and its handles, dust left out."""
    count, part = connected_components(
        coo_array((np.ones(len(mesh.edges), bool), mesh.edges.T), (len(mesh.vertices),) * 2), directed=False
    )
    of_face = part[mesh.faces[:, 0]]
    volumes = np.bincount(of_face, mesh.face_volumes, count)
    corners, sides, faces = (np.bincount(which, minlength=count) for which in (part, part[mesh.edges[:, 0]], of_face))
    kept = np.abs(volumes) >= dust_mm3
    return int((kept & (volumes > 0)).sum()), int((1 - (corners - sides + faces)[kept] // 2).sum())


def pieces_of_labels(mask: Mask) -> list[tuple[int, int]]:
    """Return the fewest and the most pieces and handles that a mask may be said to have.

    Voxels hang together through faces alone, or through edges and corners too; and holes through it that are at most
    two pixels wide in their slice, which a closing by one pixel fills, are dust or not.
    """
    closed = binary_closing(np.pad(mask, 2), np.ones((1, 3, 3), bool))
    counts = [pieces_of_voxels(solid, links=links) for solid in (mask, closed) for links in (1, 3)]
    return [(min(each), max(each)) for each in zip(*counts, strict=True)]


def pieces_of_voxels(mask: Mask, *, links: int) -> tuple[int, int]:
    """Count the pieces and the handles of voxels that hang together through faces alone (1), or corners too (3)."""
    from skimage.measure import euler_number

    solid = without_dust(np.pad(mask, 1), links)
    solid = ~without_dust(~solid, 4 - links)
    pieces = label(solid, generate_binary_structure(3, links))[1]
    cavities = label(~solid, generate_binary_structure(3, 4 - links))[1] - 1
    return pieces, pieces + cavities - int(euler_number(solid, connectivity=links))


def without_dust(mask: Mask, links: int) -> Mask:
    parts = label(mask, generate_binary_structure(3, links))[0]
    return np.asarray((np.bincount(parts.ravel()) >= DUST)[parts] & mask)
