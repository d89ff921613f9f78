"""Numbers that color a mesh: how far it is from its data, how thick it is, what was filled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import UsageError
from ..html.scene import Values
from ..measure.thickness import walls_of
from ..measure.tree import Tree
from ..progress import silent

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ..model.mesh import TriMesh
    from ..progress import Progress
    from ..results import Surface
    from .session import Session

    Floats = NDArray[np.float64]

COLORS = ("distance", "thickness", "filled")


def values_of(session: Session, mesh: TriMesh, name: str, progress: Progress = silent) -> Mapping[str, Values]:
    """Return the numbers of a name at the vertices of a mesh, which are measured once.

    Raises
    ------
    UsageError
        For a name that there is not, or where nothing is known of it.
    """
    _, found = session.colors.of((name, id(mesh)), lambda: (mesh, _measured(session, mesh, name, progress)))
    return {name: found}


def is_measured(session: Session, mesh: TriMesh, name: str) -> bool:
    """Tell whether the numbers of a name are there without waiting."""
    try:
        session.colors.known((name, id(mesh)))
    except LookupError:
        return False
    return True


def _measured(session: Session, mesh: TriMesh, name: str, progress: Progress) -> Values:
    made = session.made.get("reconstruct")
    surface: Surface | None = None if made is None or session.opened.mesh is not None else made.value
    if name == "thickness":
        return Values(_thickness(mesh, progress), "thickness of the wall", "mm")
    if name == "distance" and surface is not None:
        return Values(_distance(surface), "distance to the points", "mm")
    if name == "filled" and surface is not None:
        return Values(_filled(surface), "filled, not measured")
    raise UsageError("the mesh has no such colors", found=name, expected=" | ".join(COLORS))


def _thickness(mesh: TriMesh, progress: Progress) -> Floats:
    """Return at each vertex the width of the nearest place where the wall was measured; NaN where it has none."""
    walls = walls_of(mesh, progress=progress)
    widths = np.where(np.isfinite(walls.widths), walls.widths, np.nan)
    return np.asarray(widths[Tree.of_points(walls.places).nearest(mesh.vertices)[1]])


def _distance(surface: Surface) -> Floats:
    """Return how far each vertex is from the nearest of what the mesh rests on."""
    places = surface.points.positions if surface.rests_on is None else surface.rests_on
    if not len(places):
        return np.full(len(surface.mesh.vertices), np.nan)
    return np.asarray(Tree.of_points(places).nearest(surface.mesh.vertices)[0])


def _filled(surface: Surface) -> Floats:
    """Return 1 at the corners of faces that no data has measured, 0 elsewhere."""
    filled = np.zeros(len(surface.mesh.faces), np.bool_) if surface.filled is None else surface.filled
    if surface.segmentation is not None:
        filled = filled | surface.cap_faces
    found = np.zeros(len(surface.mesh.vertices))
    found[surface.mesh.faces[filled]] = 1.0
    return found
