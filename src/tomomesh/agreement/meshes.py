"""How near a mesh is to another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import GeometryError
from ..measure.fill import fill_mesh
from ..measure.report import compare
from ..model.volume import Volume
from .voxels import overlap_of

if TYPE_CHECKING:
    from ..model.mesh import TriMesh

NODES = 128
"""Nodes along the longest side of the grid that tells what two meshes have in common. Measured on a ball and the same
ball moved by a tenth of its radius: Dice's coefficient is right within .00004, with half of it .0003, twice .00005."""


def compare_with_mesh(mesh: TriMesh, other: TriMesh, *, threads: int = 0) -> dict[str, Any]:
    """Measure how near a mesh is to another: what they have in common, on a grid of `NODES`, and distances both ways.

    Parameters
    ----------
    mesh, other : TriMesh
        In one frame and unit, which need not be millimeters.
    threads : int
        0 is one a core.

    Returns
    -------
    dict
        ``dice``, None where one of them is not closed, and the keys of `tomomesh.measure.report.compare`.
    """
    grid = _around(mesh, other)
    try:
        dice = overlap_of(mesh, fill_mesh(other, grid), grid)["dice"]
    except GeometryError:
        dice = None
    return {"dice": dice} | compare(mesh, other, threads=threads)


def _around(mesh: TriMesh, other: TriMesh) -> Volume:
    """Return a grid of cubes over the boxes of two meshes; its voxels, all 0, take no memory."""
    both = np.concatenate([mesh.vertices, other.vertices])
    low, sides = both.min(axis=0), np.ptp(both, axis=0)
    step = max(float(sides.max()), 1e-300) / NODES
    affine = np.diag([step, step, step, 1.0])
    affine[:3, 3] = low + step / 2
    shape = np.maximum(np.ceil(sides / step), 1).astype(np.int64)[::-1]
    return Volume.from_stored(np.broadcast_to(np.zeros((), np.uint8), tuple(shape.tolist())), affine)
