"""Walls that are too thin for a printer, made thick enough."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..isosurface.well_composed import without_contacts
from ..measure.thickness import walls_of
from ..measure.tree import Tree
from ..model.mesh import TriMesh
from .depth import Depth, depth_near, level_surface
from .solids import mesh_of, solid_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ..measure.thickness import Thickness
    from ..progress import Progress

STEPS = 2.0
"""Nodes of the grid along half of the thickness."""
ROOM = 1.2
"""Thickness that is made over the one that is asked for: the ball between coarse faces is smaller than between the
round sides that they stand for (docs/printing.md)."""
ROUNDS = 3
"""Most times that thin walls are looked for and added to."""
SPARED = 0.5
"""Area that may stay thin, in squares of the thickness: the verdict lets one be."""
STEP = 8 * float(np.finfo(np.float32).eps)
"""Length over the largest coordinate by which a vertex is moved from another's place: eight steps of 32-bit numbers."""
TILE = 224
"""Nodes along the sides of the boxes that are worked on one after the other. Only memory and time depend on it."""
FLAT = 0.005
"""Share of the thickness by which what is added may move where it is made coarser."""


def thickened(mesh: TriMesh, least: float, *, room: float = ROOM, threads: int, progress: Progress) -> TriMesh:
    """Add to a solid around the middle of its thin walls, so that they are thick enough.

    The faces where the ball inside is smaller than that are moved to the middle of their wall; what lies within half
    of the thickness of these is added to the solid. All else stays as it is. Gaps as narrow as that close.

    Parameters
    ----------
    mesh : TriMesh
        Closed, 2-manifold and outward, but for the linings of cavities.
    least : float
        Thickness.
    room : float
        Thickness that is made over that.
    threads : int
    progress : callable

    Returns
    -------
    TriMesh
        Closed and 2-manifold. The mesh itself where nothing is thin.
    """
    from manifold3d import Manifold, OpType

    for _ in range(ROUNDS):
        walls = walls_of(mesh, near=least, threads=threads, progress=progress)
        if walls.widest_spot(least) <= SPARED * least**2:
            break
        tiles = list(_tiles(_middle(mesh, walls, least, threads), TILE * least / (2 * STEPS)))
        added = []
        for count, tile in enumerate(tiles):
            progress("thicken", count, len(tiles))
            added.append(solid_of(_around(tile, 0.5 * room * least, threads)).simplify(FLAT * least))
        progress("thicken", len(tiles), len(tiles))
        mesh = _apart(mesh_of(Manifold.batch_boolean([solid_of(mesh), *added], OpType.Add)))
    return mesh


def _apart(mesh: TriMesh) -> TriMesh:
    """Move vertices that 32 bits do not keep apart along their normals, by a few of the smallest steps."""
    vertices = mesh.vertices.copy()
    for _ in range(ROUNDS):
        _, first, owner = np.unique(vertices.astype(np.float32), axis=0, return_index=True, return_inverse=True)
        twice = np.flatnonzero(first[owner.reshape(-1)] != np.arange(len(vertices)))
        if not len(twice):
            break
        vertices[twice] -= STEP * np.abs(vertices).max() * mesh.vertex_normals[twice]
    return mesh.moved(vertices)


def _middle(mesh: TriMesh, walls: Thickness, least: float, threads: int) -> TriMesh:
    """Return the thin faces of a mesh, moved to the middle of their walls."""
    thin = walls.widths < least
    under = Tree.of_faces(mesh, threads=threads).nearest(walls.places[thin], threads=threads)[1]
    widths = np.full(len(mesh.vertices), np.inf)
    np.minimum.at(widths, mesh.faces[under].reshape(-1), np.repeat(walls.widths[thin], 3))
    faces = mesh.faces[np.unique(under)]
    inward = np.where(np.isfinite(widths), 0.5 * widths, 0.0)[:, None] * mesh.vertex_normals
    return TriMesh(mesh.vertices - inward, faces)


def _tiles(mesh: TriMesh, side: float) -> Iterator[TriMesh]:
    """Yield the faces of a mesh, those of each cube of space together."""
    middles = mesh.corners.mean(axis=1)
    cube = np.floor((middles - middles.min(axis=0)) / side).astype(np.int64)
    _, owner = np.unique(cube, axis=0, return_inverse=True)
    owner = owner.reshape(-1)
    for number in range(int(owner.max()) + 1):
        yield mesh.only(owner == number)


def _around(tile: TriMesh, radius: float, threads: int) -> TriMesh:
    """Return the surface at a distance from some faces."""
    found = depth_near(
        tile, radius, threads=threads, progress=lambda *_: None, stage="thicken", around=radius, steps=STEPS
    )
    near = Depth(found.low, found.step, -found.values)

    def beyond(nodes: NDArray[np.int32]) -> NDArray[np.float64]:
        return np.asarray(near.values[tuple(nodes.T[::-1])], np.float64)

    return level_surface(near, without_contacts(near.values > -radius, beyond, threads), -radius, threads)
