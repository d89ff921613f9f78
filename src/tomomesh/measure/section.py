"""Where a plane cuts a mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh


def section(mesh: TriMesh, height: float) -> NDArray[np.float64]:
    """Cut a mesh with the plane z = height, exactly.

    Parameters
    ----------
    mesh : TriMesh
        In any frame whose third coordinate is the height, as voxel indices (i, j, k).
    height : float

    Returns
    -------
    (s, 2, 2) float array
        Both ends (x, y) of the segment in every face that has corners above the plane and others on it or below; the
        segments of a closed mesh form closed lines.
    """
    above = mesh.vertices[:, 2] > height
    cut = mesh.faces[above[mesh.faces].any(axis=1) & ~above[mesh.faces].all(axis=1)]
    sides = above[cut]
    alone = np.argmax(sides == (sides.sum(axis=1) == 1)[:, None], axis=1)
    corners = np.take_along_axis(cut, (alone[:, None] + np.arange(3)) % 3, axis=1)
    tip, others = mesh.vertices[corners[:, :1]], mesh.vertices[corners[:, 1:]]
    share = (height - tip[..., 2:]) / (others[..., 2:] - tip[..., 2:])
    return np.asarray((tip + share * (others - tip))[..., :2])
