"""Take a mesh back where the fit made it pass through itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..model.columns import any_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ..model.mesh import TriMesh
    from .low_pass import OneRing

    Tangled = Callable[..., NDArray[np.bool_]]

ROUNDS = 24
"""Rounds after which what still passes through itself is left, and reported: (1 - .25)^20 = .003 of the way back is
then left."""
GENTLE = 4
"""Rounds in which the mesh is only smoothed, which undoes most folds; later it also goes back. The region that is
worked on grows by one ring of faces as often. Measured on an MR: half and twice of it leave no other faces and take
back no other vertices."""
BACK = 0.25
"""Share of the way back to where it came from that a vertex takes in a later round. Measured as `GENTLE`: the same."""


def untangle(
    mesh: TriMesh,
    origin: NDArray[np.float64],
    ring: OneRing,
    tangled: Tangled,
    lattice: NDArray[np.float64] | None = None,
) -> tuple[TriMesh, int, NDArray[np.bool_]]:
    """Smooth a mesh where it passes through itself, and take it back towards where it came from.

    Parameters
    ----------
    mesh : TriMesh
    origin : (n, 3) float array
        Its vertices where it does not pass through itself: before the fit.
    ring : OneRing
        The neighbors of its vertices.
    tangled : callable
        Marks the faces (m,) of a mesh that pass through others; told which vertices have moved since it last did.
    lattice : (n, 3) float array, optional
        Its vertices as corners of cubes, for what is left then: a low-pass filter of many passes may make a mesh pass
        through itself before any fit, squares between cubes never do.

    Returns
    -------
    mesh : TriMesh
    taken_back : int
        Vertices that do not lie where the fit had them.
    left : (m,) bool array
        Faces that pass through others all the same.
    """
    moved = np.zeros(len(mesh.vertices), bool)
    marked = tangled(mesh)
    for count in range(ROUNDS):
        if not marked.any():
            break
        region = _around(mesh, marked, 1 + count // GENTLE)
        moved |= region
        vertices = ring.smoothed(mesh.vertices, 2)
        if count >= GENTLE:
            vertices += BACK * (origin - vertices)
        mesh = mesh.moved(np.where(region[:, None], vertices, mesh.vertices))
        marked = tangled(mesh, region)
    for count in range(ROUNDS):
        if lattice is None or not marked.any():
            break
        region = _around(mesh, marked, count)
        moved |= region
        mesh = mesh.moved(np.where(region[:, None], lattice, mesh.vertices))
        marked = tangled(mesh, region)
    return mesh, int(moved.sum()), marked


def _around(mesh: TriMesh, marked: NDArray[np.bool_], steps: int) -> NDArray[np.bool_]:
    """Return the vertices (n,) of some faces and of those around them."""
    region = np.zeros(len(mesh.vertices), bool)
    region[mesh.faces[marked]] = True
    for _ in range(steps):
        region[mesh.faces[any_of(region[mesh.faces])]] = True
    return region
