"""The peers of slabs.py: each makes a surface of slabs, a level, and the number of thin slices of a slab."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import distance_transform_edt

from tomomesh.model.mesh import TriMesh
from voxels import padded

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tomomesh import Volume

    Floats = NDArray[Any]
    Peer = Callable[[Volume, float, int], TriMesh]

ITK_PACKAGE = "itk-morphologicalcontourinterpolation"
"""Not in ``.[bench]``: it is large."""
ITK_JOB = """
import os, sys, numpy, itk
found = itk.morphological_contour_interpolator(itk.image_from_array(numpy.load(sys.argv[1])), axis=2)
numpy.save(sys.argv[2], itk.array_from_image(found))
os._exit(0)
"""
"""Run in a process of its own, left without tidying up: at its end ITK frees what it has not taken, and aborts."""


def cubes(slabs: Volume, level: float, thick: int) -> TriMesh:
    """Run scikit-image's marching cubes."""
    return marched(slabs, slabs.voxels, level, 1)


def marched(slabs: Volume, levels: Floats, level: float, steps: int) -> TriMesh:
    """Run scikit-image's marching cubes on slices of which so many make one slab; caps lie half a slab out."""
    from skimage.measure import marching_cubes

    places, faces, _, _ = marching_cubes(padded(replace(slabs, voxels=levels), level), level)
    heights = np.concatenate([[-1.0], _heights(len(slabs.voxels), steps), [len(slabs.voxels)]])
    k = np.interp(places[:, 0], np.arange(len(heights)), heights)
    return TriMesh(slabs.to_mm(np.column_stack([places[:, 2] - 1.0, places[:, 1] - 1.0, k])), faces)


def _heights(slabs: int, steps: int) -> NDArray[np.float64]:
    return np.arange((slabs - 1) * steps + 1) / steps


def _between(levels: Floats, steps: int, degree: int) -> Floats:
    """Interpolate between slices along the stack by a spline."""
    spline = make_interp_spline(np.arange(len(levels)), levels, k=degree)
    return np.asarray(spline(_heights(len(levels), steps)), np.float32)


def cubic(slabs: Volume, level: float, thick: int) -> TriMesh:
    """Interpolate the gray levels to the thin slices' distance by a cubic spline, then march."""
    return marched(slabs, _between(slabs.voxels, thick, 3), level, thick)


def distances(degree: int) -> Peer:
    """Interpolate signed distances to each slice's outline (Raya and Udupa 1990; Herman et al. 1992), then march."""

    def run(slabs: Volume, level: float, thick: int) -> TriMesh:
        return marched(slabs, _between(_signed(slabs, level), thick, degree), 0.0, thick)

    return run


def _signed(slabs: Volume, level: float) -> Floats:
    """Return distances to the outline within each slice, inside positive.

    A slice without one lies outside by as much as the nearest slice with one is inside or outside: caps are flat and
    lie half a slab out.
    """
    x, y, _ = slabs.spacing_mm
    mask, half = slabs.voxels > level, min(x, y) / 2
    found = np.stack([distance_transform_edt(plane, (y, x)) - distance_transform_edt(~plane, (y, x)) for plane in mask])
    found -= np.copysign(half, found)
    filled = np.array([bool(plane.any()) for plane in mask])
    nearest = np.abs(np.arange(len(mask))[:, None] - np.flatnonzero(filled)).argmin(axis=1)
    return np.where(filled[:, None, None], found, -np.abs(found[filled][nearest]))


def sinc(slabs: Volume, level: float, thick: int) -> TriMesh:
    """March, then smooth as 3D Slicer does, which itself marches on the mask alone."""
    return smoothed(cubes(slabs, level, thick))


def smoothed(mesh: TriMesh) -> TriMesh:
    """Smooth by VTK's windowed sinc as 3D Slicer does at its default smoothing factor of 0.5."""
    from vtkmodules.vtkFiltersCore import vtkWindowedSincPolyDataFilter

    smooth = vtkWindowedSincPolyDataFilter()
    smooth.SetInputData(_polydata(mesh))
    smooth.SetNumberOfIterations(20)
    smooth.SetPassBand(10 ** (-4 * 0.5))
    smooth.BoundarySmoothingOff()
    smooth.FeatureEdgeSmoothingOff()
    smooth.NonManifoldSmoothingOn()
    smooth.NormalizeCoordinatesOn()
    smooth.Update()
    return _mesh(smooth.GetOutput())


def nets(slabs: Volume, level: float, thick: int) -> TriMesh:
    """Run VTK's surface nets, smoothed, on the mask."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkFiltersCore import vtkSurfaceNets3D

    mask = np.pad(slabs.voxels > level, 1).astype(np.uint8)
    image, spacing = vtkImageData(), np.array(slabs.spacing_mm)
    image.SetDimensions(*mask.shape[::-1])
    image.SetSpacing(*spacing)
    image.GetPointData().SetScalars(numpy_to_vtk(mask.ravel(), deep=True))
    found = vtkSurfaceNets3D()
    found.SetInputData(image)
    found.SetValue(0, 1)
    found.SmoothingOn()
    found.SetOutputMeshTypeToTriangles()
    found.Update()
    mesh = _mesh(found.GetOutput())
    return mesh.moved(slabs.to_mm(mesh.vertices / spacing - 1))


def _polydata(mesh: TriMesh) -> Any:
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    points, polygons, found = vtkPoints(), vtkCellArray(), vtkPolyData()
    points.SetData(numpy_to_vtk(mesh.vertices, deep=True))
    polygons.SetData(3, numpy_to_vtkIdTypeArray(mesh.faces.ravel(), deep=True))
    found.SetPoints(points)
    found.SetPolys(polygons)
    return found


def _mesh(found: Any) -> TriMesh:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    faces = vtk_to_numpy(found.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return TriMesh(vtk_to_numpy(found.GetPoints().GetData()).astype(np.float64), faces.astype(np.int64))


def morphological(slabs: Volume, level: float, thick: int) -> TriMesh:
    """Interpolate the mask by ITK's morphological contour interpolation (Albu et al. 2008), then march."""
    mask = np.zeros(((len(slabs.voxels) - 1) * thick + 1, *slabs.shape[1:]), np.uint8)
    mask[::thick] = slabs.voxels > level
    with tempfile.TemporaryDirectory() as folder:
        before, after = (Path(folder, f"{name}.npy") for name in ("before", "after"))
        np.save(before, mask)
        subprocess.run([sys.executable, "-c", ITK_JOB, before, after], check=True)
        return marched(slabs, np.load(after).astype(np.float32), 0.5, thick)


CUBES, SINC, ITK = "marching cubes", "marching cubes + windowed sinc", "ITK's morphological contours"
PEERS: dict[str, Peer] = {
    CUBES: cubes,
    SINC: sinc,
    "surface nets": nets,
    "cubic levels": cubic,
    "signed distances, linear": distances(1),
    "signed distances, cubic": distances(3),
} | ({ITK: morphological} if find_spec("itk") else {})
