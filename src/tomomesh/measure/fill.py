"""A mesh filled back to voxels, and how well they agree with those that it was made from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import GeometryError
from ..kernels.measure.fill import add_winding_steps

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh
    from ..model.volume import Volume

    Mask = NDArray[np.bool_]


def fill_mesh(mesh: TriMesh, volume: Volume) -> Mask:
    """Tell which voxels of a grid have their centers inside a closed mesh.

    A ray along the slices through every row and column counts the faces that it passes; cost grows with the surface
    and with the voxels around it.

    Parameters
    ----------
    mesh : TriMesh
        Patient millimeters, LPS. Outward; linings of cavities inward. Where bodies overlap, what lies in any is inside.
    volume : Volume
        The grid; any affine.

    Returns
    -------
    (K, J, I) bool array

    Raises
    ------
    GeometryError
        Where the mesh is not closed.

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh import TriMesh, Volume, fill_mesh
    >>> corner = TriMesh(3.5 * np.eye(4, 3, -1) - 0.25, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    >>> grid = Volume.from_stored(np.zeros((4, 4, 4)), np.eye(4))
    >>> fill_mesh(corner, grid)[:, 0].astype(int)
    array([[1, 1, 1, 0],
           [1, 1, 0, 0],
           [1, 0, 0, 0],
           [0, 0, 0, 0]])
    """
    _require_closed(mesh)
    inside = np.zeros(volume.shape, np.bool_)
    if not len(mesh.faces):
        return inside
    places = volume.to_indices(mesh.vertices)
    box = [_span(places[:, 2 - n], size) for n, size in enumerate(volume.shape)]
    steps = np.zeros([max(0, side.stop - side.start) for side in box], np.int16)
    if steps.size:
        first = np.array([side.start for side in box[::-1]], np.float64)
        add_winding_steps(np.ascontiguousarray(places - first), np.ascontiguousarray(mesh.faces, np.int64), steps)
        np.cumsum(steps, axis=0, out=steps)
        inside[tuple(box)] = steps > 0 if np.linalg.det(volume.affine[:3, :3]) > 0 else steps < 0
    return inside


def overlap(inside: Mask, wanted: Mask, voxel_mm3: float) -> dict[str, Any]:
    """Compare a filled mesh with the voxels that it was made from.

    Returns
    -------
    dict
        ``voxels`` inside, their ``volume_mm3``, those ``wanted``, and ``dice``, twice the common ones over the sum of
        both (Dice 1945).
    """
    counts = [int(np.count_nonzero(one)) for one in (inside, wanted, inside & wanted)]
    return {
        "voxels": counts[0],
        "volume_mm3": counts[0] * voxel_mm3,
        "wanted": counts[1],
        "dice": 2 * counts[2] / max(counts[0] + counts[1], 1),
    }


def _span(places: NDArray[np.float64], size: int) -> slice:
    """Return the indices along an axis between the lowest and the highest place."""
    return slice(int(np.clip(np.ceil(places.min()), 0, size)), int(np.clip(np.floor(places.max()) + 1, 0, size)))


def _require_closed(mesh: TriMesh) -> None:
    start, end = mesh.half_edges.T
    n = max(len(mesh.vertices), 1)
    forth, back = np.sort(start * n + end), np.sort(end * n + start)
    if not np.array_equal(forth, back):
        raise GeometryError(
            "the mesh is not closed, and has no inside", found=f"{len(np.setdiff1d(forth, back))} sides of one face",
            expected="a mesh without borders",
        )  # fmt: skip
