"""The frames in which meshes and points are written: a study's from LPS millimeters, here and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..model.columns import carried
from ..model.mesh import TriMesh
from ..model.units import MM
from .files.source import suffix_of
from .volumes.nifti_frame import FLIP

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..model.points import PointSet
    from ..model.volume import Grid

RAS_ALONE, LENGTHS = (".gii",), (".gii", ".3mf")
"""Suffixes of meshes that are in RAS whatever is asked, and of those that are in millimeters."""


@dataclass(frozen=True)
class Frame:
    """A frame of coordinates that can be written.

    Attributes
    ----------
    unit, name : str
        As files name them.
    matrix : (4, 4) float array
        Patient millimeters, LPS, or whatever else a mesh is in, to its coordinates.
    """

    unit: str
    name: str
    matrix: NDArray[np.float64]

    def place(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Carry (n, 3) positions."""
        return carried(positions, self.matrix[:3, :3].T, self.matrix[:3, 3])

    def mesh(self, mesh: TriMesh) -> TriMesh:
        """Carry a mesh; where the frame is a mirror, the faces are turned, so that they look outward in it too."""
        turned = slice(None, None, -1 if np.linalg.det(self.matrix[:3, :3]) < 0 else 1)
        return TriMesh(self.place(mesh.vertices), np.ascontiguousarray(mesh.faces[:, turned]))

    def points(self, points: PointSet) -> PointSet:
        """Carry a cloud."""
        return replace(points, positions=self.place(points.positions))


def in_lps(mesh: TriMesh, *, unit: str, frame: str, grid: Grid | None = None) -> TriMesh:
    """Carry a mesh that was read to patient millimeters, LPS.

    Parameters
    ----------
    mesh : TriMesh
    unit, frame : str
        As files name them; counted from a corner, ``local:x,y,z``, it is brought back. Another frame than these, RAS
        and voxel, and a unit that is unknown, are taken for LPS and mm.
    grid : Grid, optional
        How the study keeps its voxels, for a mesh of voxel indices.
    """
    affine = np.diag([*3 * [MM.get(unit, 1.0)], 1.0])
    affine[:3, 3] = affine[0, 0] * _corner(frame)
    if frame == "RAS":
        affine = FLIP @ affine
    elif frame == "voxel" and grid is not None:
        affine = grid.affine
    return Frame("mm", "LPS", affine).mesh(mesh)


def _corner(frame: str) -> NDArray[np.float64]:
    """Return the corner that a frame's coordinates are counted from, (3,)."""
    try:
        corner = np.array(frame.removeprefix("local:").split(","), np.float64)
    except ValueError:
        corner = np.zeros(0)
    return corner if corner.shape == (3,) and np.isfinite(corner).all() else np.zeros(3)


def frame_of_study(name: str, grid: Grid) -> Frame:
    """Return a frame of a study by its name.

    Parameters
    ----------
    name : {"lps", "ras", "voxel"}
        Patient millimeters, or indices (i, j, k) of the voxels as the file stores them: i runs fastest, as NIfTI's
        own; columns, rows and slices of DICOM. A whole index is the center of a voxel.
    grid : Grid
        How the file keeps its voxels.
    """
    if name == "voxel":
        return Frame("voxel", "voxel", np.asarray(np.linalg.inv(grid.affine), np.float64))
    return Frame("mm", name.upper(), FLIP if name == "ras" else np.eye(4))


def frame_in_file(path: str | Path, *, unit: str, frame: str) -> Frame:
    """Return the frame of the numbers in a mesh file, from those of the mesh that is written.

    Parameters
    ----------
    path : path
        The output, whose format may have a frame and a unit of its own.
    unit, frame : str
        Those of the mesh; an unknown unit or frame stays as it is.
    """
    sized, turned = suffix_of(path) in LENGTHS and unit in MM, suffix_of(path) in RAS_ALONE and frame == "LPS"
    affine = np.diag([*3 * [MM[unit] if sized else 1.0], 1.0])
    return Frame("mm" if sized else unit, "RAS" if turned else frame, FLIP @ affine if turned else affine)
