"""A cavity in a solid, which leaves a wall of one thickness around it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import EmptyError
from ..isosurface.well_composed import without_contacts
from ..model.mesh import TriMesh
from ..model.units import length_in_words
from .depth import deep_inside, deepest, depth_near, level_surface
from .solids import mesh_of, solid_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..progress import Progress
    from .depth import Depth

SIMPLER = 0.005
"""Distance over the thickness of the wall by which the inner side may move where it is made coarser. Chosen: half of it
changes the distance by -0.5 %, twice by +0.1 %."""


def hollowed(mesh: TriMesh, wall: float, *, threads: int, progress: Progress) -> TriMesh:
    """Take out of a solid what lies deeper than its wall is thick.

    The inner side is where the distance to the nearest face is that of the wall: on a grid of a third of it, between
    whose nodes the distances are interpolated. It cannot pass through itself, as a surface whose vertices are moved
    along their normals does wherever the solid is thinner than two walls.

    Parameters
    ----------
    mesh : TriMesh
        Closed, 2-manifold and outward, but for the linings of cavities.
    wall : float
    threads : int
    progress : callable

    Returns
    -------
    TriMesh
        The faces of `mesh`, and those of the cavities. A cavity of less volume than a cube of a wall's edge is not
        made.

    Raises
    ------
    EmptyError
        Where the solid is nowhere thicker than two walls.
    ResourceError
        Where the wall is too thin for the size of the part.
    """
    depth = depth_near(mesh, wall, threads=threads, progress=progress)
    deep = deep_inside(depth, mesh, wall, wall**3)
    if not deep.any():
        raise EmptyError(
            "there is no room for a cavity",
            found=f"--hollow = {wall:g}",
            expected="a wall thinner than half of the part where that is thickest",
            hint="a thinner wall, or a larger --scale; "
            f"the deepest place is about {length_in_words(deepest(mesh, threads), digits=3)} from a face",
        )
    inner = _coarser(_inner_side(depth, deep, wall, threads), wall)
    progress("hollow", 1, 1)
    faces = np.concatenate([mesh.faces, inner.faces[:, ::-1] + len(mesh.vertices)])
    return TriMesh(np.concatenate([mesh.vertices, inner.vertices]), faces)


def _inner_side(depth: Depth, deep: NDArray[np.bool_], wall: float, threads: int) -> TriMesh:
    """Return the surface around the deep nodes, outward from them."""

    def beyond(nodes: NDArray[np.int32]) -> NDArray[np.float64]:
        return np.asarray(depth.values[tuple(nodes.T[::-1])], np.float64)

    # contacts are closed by the wall and not by the cavity, or the wall would be thinner there
    return level_surface(depth, ~without_contacts(~deep, beyond, threads), wall, threads)


def _coarser(inner: TriMesh, wall: float) -> TriMesh:
    """Collapse edges of an inner side where that moves it by next to nothing."""
    return mesh_of(solid_of(inner).simplify(SIMPLER * wall))
