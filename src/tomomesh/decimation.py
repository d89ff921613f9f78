"""Make a finished mesh coarser, and keep what is promised of it."""

from __future__ import annotations

import math
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import GeometryError, UsageError
from .measure.intersections import self_intersections
from .measure.topology import distinct_positions, topology
from .measure.tree import Tree
from .model.mesh import TriMesh

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

PACKAGE = "fast_simplification"
HASTES = (2, 3, 4, 5, 7, 10)
"""How fast the cost that is accepted of a collapse grows. Slow growth keeps the shape best, but may stop above the
number that was asked for; each goes on from where the one before stopped."""
LEAST_STEP = 0.9
"""Faces after a step over those before it: smaller steps are not tried."""


def require_decimation(most: int | None) -> None:
    """Refuse a number of faces where the package for it is not installed.

    Raises
    ------
    UsageError
        Naming it.
    """
    if most is not None and find_spec(PACKAGE) is None:
        raise UsageError(
            "a mesh is made coarser by a package that is not installed",
            found=f"--target-faces = {most}",
            expected="fast-simplification",
            hint='pip install "tomomesh[decimate]"',
        )


def decimate(mesh: TriMesh, most: int, *, cavities: int = 0, threads: int = 0) -> TriMesh:
    """Collapse edges until a mesh has no more faces than asked for.

    Edges collapse where the squared distances to the planes of the faces around stay least (Garland & Heckbert
    1997), by the package fast-simplification. The same mesh gives the same result.

    Parameters
    ----------
    mesh : TriMesh
        Closed, manifold and outward.
    most : int
    cavities : int
        Components that line a cavity.
    threads : int

    Returns
    -------
    TriMesh
        Closed, manifold and outward, of as many components and handles. Faces pass through others only where no
        other way was found.

    Raises
    ------
    GeometryError
        Where the shape cannot be kept with so few faces; names how many it takes.
    """
    wanted, least = _shape(mesh, cavities), len(mesh.faces)
    for allowed in (_crossing(mesh, threads), least):

        def good(found: TriMesh, allowed: int = allowed) -> bool:
            return _shape(found, cavities) == wanted and _crossing(found, threads) <= allowed

        best = mesh
        for haste in HASTES:
            best = _approached(best, most, haste, good)
        if len(best.faces) <= most:
            return best
        least = min(least, len(best.faces))
    raise GeometryError(
        "the mesh cannot be kept closed and manifold with so few faces",
        found=f"--target-faces = {most}",
        expected=f"about {least} or more",
        hint="more faces, or larger cubes (--cell)",
    )


def faces_under(coarse: TriMesh, fine: TriMesh) -> NDArray[np.int32]:
    """Return the face of a fine mesh that lies nearest to the middle of each face of a coarse one, (m,)."""
    return Tree.of_faces(fine).nearest(coarse.corners.mean(axis=1))[1]


def _approached(mesh: TriMesh, most: int, haste: int, good: Callable[[TriMesh], bool]) -> TriMesh:
    """Collapse as many edges as the mesh stays good for: at once, or in ever smaller steps, as other edges come first.

    A collapse joins what must stay apart where two vertices have a neighbor in common beside their faces' own, and
    the package does not look for that (the link condition; Dey et al. 1999).
    """
    goal = most
    while len(mesh.faces) > most and (goal == most or goal < LEAST_STEP * len(mesh.faces)):
        found = _collapsed(mesh, goal, haste)
        if not good(found):
            goal = math.isqrt(goal * len(mesh.faces))
        elif len(found.faces) > goal:
            return found
        else:
            mesh, goal = found, most
    return mesh


def _collapsed(mesh: TriMesh, most: int, haste: int) -> TriMesh:
    """Collapse the edges of a mesh in a box of edge 2, so that its unit and place change nothing."""
    from fast_simplification import simplify

    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    center, scale = 0.5 * (low + high), 0.5 * float((high - low).max())
    vertices: Any = (mesh.vertices - center) / scale
    vertices, faces = simplify(vertices, mesh.faces.astype(np.int32), target_count=most, agg=haste)
    return TriMesh(np.asarray(vertices, np.float64) * scale + center, np.asarray(faces, np.int64).reshape(-1, 3))


def _crossing(mesh: TriMesh, threads: int) -> int:
    return int(self_intersections(mesh, threads=threads).sum())


def _shape(mesh: TriMesh, cavities: int) -> tuple[bool, int, int]:
    """Return whether a mesh is what is promised, its components, and its Euler number."""
    if len(mesh.faces) == 0:
        return False, 0, 0
    found = topology(mesh, cavities=cavities)
    apart = distinct_positions(mesh, np.float64) == len(mesh.vertices)
    return found.sound and apart and bool(np.isfinite(mesh.vertices).all()), found.components, found.euler_number
