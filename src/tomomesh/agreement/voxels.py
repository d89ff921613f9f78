"""How near a mesh is to the voxels of a window."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

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
    near = Tree.of_points(back, threads=threads).nearest(there, threads=threads)[0]
    to = distance_to_voxels(there, mask, volume, near, threads=threads)
    away = Tree.of_faces(mesh, threads=threads).nearest(back, threads=threads)[0]
    return overlap_of(mesh, mask, volume) | spread_of(to, "") | spread_of(away, "back_")


def distance_to_voxels(places: Floats, mask: Mask, volume: Volume, most: Floats, *, threads: int = 0) -> Floats:
    """Return the distance of places (n, 3), in millimeters, to the boundary of a window, none over `most` (n,).

    Slab after slab, of those that can hold a nearer face, so that the whole boundary is never in memory.
    """
    to_indices = np.linalg.inv(volume.affine[:3, :3])
    slice_mm = 1 / float(np.linalg.norm(to_indices[2]))
    heights, best = volume.to_indices(places)[:, 2], most.copy()
    for sides in sides_in_slabs(mask):
        gap = slice_mm * np.maximum(np.maximum(sides.first - heights, heights - sides.last), 0)
        asked = np.flatnonzero(gap < best)
        if len(asked) and len(sides.middles):
            corners, triangles = sides.triangles()
            tree = Tree.over(volume.to_mm(corners), triangles, threads=threads)
            best[asked] = np.minimum(best[asked], tree.nearest(places[asked], threads=threads)[0])
    return best


def overlap_of(mesh: TriMesh, mask: Mask, volume: Volume) -> dict[str, Any]:
    """Compare the voxels inside of a mesh with those of a window; an open one has no inside."""
    try:
        return overlap(fill_mesh(mesh, volume), mask, volume.voxel_mm3)
    except GeometryError:
        return {"voxels": None, "volume_mm3": None, "wanted": int(np.count_nonzero(mask)), "dice": None}
