"""A flat base, on which a part stands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import EmptyError
from ..model.mesh import TriMesh
from ..settings.printing import SIDES
from .solids import mesh_of, solid_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

AXES = dict(zip(SIDES, ((2, -1), (2, 1), (1, -1), (1, 1), (0, 1), (0, -1)), strict=True))
"""Axis and direction of each side, in LPS."""
SNAP = 1e-9
"""Distance over the size of the part up to which a vertex lies in the plane of a cut. A cut computes a height to some
4e-16 of the size; 32-bit files keep 6e-8 of it, so that nothing that a file tells apart is joined."""


def direction_of(down: str) -> NDArray[np.float64]:
    """Return the unit vector to a side."""
    axis, sign = AXES[down]
    return np.asarray(sign * np.eye(3)[axis])


def stood(mesh: TriMesh, above: float, down: str) -> TriMesh:
    """Cut a mesh by a plane across the way down, and close it there.

    Parameters
    ----------
    mesh : TriMesh
        Closed and 2-manifold.
    above : float
        Distance of the plane from the lowest place.
    down : str
        One of `tomomesh.settings.printing.SIDES`.

    Returns
    -------
    TriMesh
        Closed and 2-manifold; its lowest vertices have the very same coordinate.

    Raises
    ------
    EmptyError
        Where nothing is left above the plane.
    """
    axis, sign = AXES[down]
    heights = -sign * mesh.vertices[:, axis]
    low, high = float(heights.min()), float(heights.max())
    if above >= high - low:
        raise EmptyError(
            "nothing is left above the base",
            found=f"--flat-base = {above:g}",
            expected=f"less than {high - low:g}, the height of the part",
        )
    level = low + above
    cut = mesh_of(solid_of(mesh).trim_by_plane(-direction_of(down), level))
    vertices = cut.vertices.copy()
    vertices[np.abs(-sign * vertices[:, axis] - level) <= SNAP * (high - low), axis] = -sign * level
    return TriMesh(vertices, cut.faces)
