"""How near a mesh is to the voxels of a window."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from ..errors import GeometryError
from ..measure.distance import spread_of
from ..measure.fill import fill_mesh, overlap
from ..measure.report import SAMPLES, area_samples
from ..measure.tree import Tree
from .sides import samples_of, sides_in_slabs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh
    from ..model.volume import Volume

    Floats = NDArray[np.float64]
    Mask = NDArray[np.bool_]

BLOCK = 8
"""Voxels along a side of the blocks in which faces near a place are looked for. Only speed depends on it."""


def compare_with_voxels(mesh: TriMesh, mask: Mask, volume: Volume, *, threads: int = 0) -> dict[str, Any]:
    """Measure how near a mesh is to the voxels of a window, whose boundary are the faces of the voxels.

    A smooth surface that is right lies up to some half a voxel off that boundary, a quarter on average.

    Parameters
    ----------
    mesh : TriMesh
        Patient millimeters, LPS.
    mask : (K, J, I) bool array
        Not empty.
    volume : Volume
        The grid of `mask`.
    threads : int
        0 is one a core.

    Returns
    -------
    dict
        The keys of `tomomesh.measure.fill.overlap`, None where the mesh is not closed, and distances to the boundary of
        the voxels and, prefixed with ``back_``, from it.
    """
    there = area_samples(mesh, SAMPLES)
    back = samples_of(mask, volume, SAMPLES)
    to = distance_to_voxels(there, mask, volume, threads=threads)
    away = Tree.of_faces(mesh, threads=threads).nearest(back, threads=threads)[0]
    return overlap_of(mesh, mask, volume) | spread_of(to, "") | spread_of(away, "back_")


def distance_to_voxels(places: Floats, mask: Mask, volume: Volume, *, threads: int = 0) -> Floats:
    """Return the distance of places (n, 3), in millimeters, to the boundary of a window that is not empty.

    Only faces in blocks of voxels near the places are looked at, slab after slab, so that the boundary is never in
    memory as a whole; then those twice as far off, for places that may have a nearer face there.
    """
    indices, sizes = volume.to_indices(places), -(-np.array(mask.shape[::-1]) // BLOCK) + 1
    blocks = np.clip(np.floor(indices / BLOCK), 0, sizes - 1).astype(np.int64)
    step = 1 / float(np.linalg.norm(np.linalg.inv(volume.affine[:3, :3]), axis=1).max())
    heights = indices[:, 2].clip(0, len(mask) - 1)
    best, left, reach = np.full(len(places), np.inf), np.arange(len(places)), 1
    while len(left):
        near = np.zeros(sizes, np.uint8)
        near[tuple(blocks[left].T)] = 1
        near = scipy.ndimage.maximum_filter(near, 2 * reach + 1, mode="constant")
        for sides in sides_in_slabs(mask):
            part = sides.taking(near[tuple((sides.middles // BLOCK).clip(0).astype(np.int64).T)] > 0)
            off = np.maximum(sides.first - heights[left], heights[left] - sides.last)
            asked = left[off <= reach * BLOCK]
            if len(asked) and len(part.middles):
                corners, triangles = part.triangles()
                tree = Tree.over(volume.to_mm(corners), triangles, threads=threads)
                best[asked] = np.minimum(best[asked], tree.nearest(places[asked], threads=threads)[0])
        # what was not looked at is farther off; a face reaches half a voxel beyond its middle
        known = best[left] <= (reach * BLOCK - 0.5) * step
        left, reach = left[~known & (reach <= sizes.max())], 2 * reach
    return best


def overlap_of(mesh: TriMesh, mask: Mask, volume: Volume) -> dict[str, Any]:
    """Compare the voxels inside of a mesh with those of a window; an open one has no inside."""
    try:
        return overlap(fill_mesh(mesh, volume), mask, volume.voxel_mm3)
    except GeometryError:
        return {"voxels": None, "volume_mm3": None, "wanted": int(np.count_nonzero(mask)), "dice": None}
