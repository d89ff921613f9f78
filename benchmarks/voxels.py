"""Without a network: how long the window's boundary takes, how near it is to marching cubes, and how much it turns."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import SHARED, at_most, header, median_times, note
from study import _surface_nets
from tomomesh import assess, phantom, read_volume, window
from tomomesh.isosurface.voxels import boundary, voxel_surface
from tomomesh.measure.report import compare
from tomomesh.measure.topology import check_promise
from tomomesh.model.mesh import TriMesh
from tomomesh.segmentation.otsu import otsu_threshold
from tomomesh.settings import FitSettings

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from tomomesh import Volume

FILES = {"CT, bone": ("dicom2stl/ct_example.nii.gz", 300.0), "MR, skin": ("volrender/seg3D/MR.nii.gz", None)}


def main() -> None:
    header("--way voxels: from a volume to a checked mesh", "vtk", "scikit-image")
    for name, volume, lower in studies():
        times(name, volume, lower)
        distances(name, volume, lower)


def studies() -> Iterator[tuple[str, Volume, float]]:
    """Yield the built-in head, and the studies beside the project where they are there."""
    head = phantom()
    yield "built-in head", head.volume, head.lower
    for name, (file, lower) in FILES.items():
        path = SHARED / "data" / file
        if path.exists():
            volume = read_volume(path)
            yield name, volume, otsu_threshold(volume.voxels) if lower is None else lower
        else:
            note(name, "not measured: the shared data are not here")


def surface(volume: Volume, lower: float) -> TriMesh:
    """Return the checked mesh of a volume."""
    found = boundary(volume, window(volume, lower=lower), lower=lower)
    mesh = voxel_surface(found, FitSettings()).mesh
    check_promise(mesh, cavities=found.cavities)
    return mesh


def times(name: str, volume: Volume, lower: float) -> None:
    """Compare the time with that of VTK's surface nets on the mask and scikit-image's marching cubes on the levels."""
    nets, levels = _surface_nets(np.pad(window(volume, lower=lower), 1), volume), padded(volume, lower)
    calls = (lambda: surface(volume, lower), nets, lambda: marched(levels, lower))
    ours, theirs, cubes = median_times(*calls, repeats=7)
    cpu, their_cpu, _ = median_times(*calls, repeats=7, clock=time.process_time)
    note(f"{name}: volume to checked mesh", f"{1e3 * ours:.0f} ms")
    at_most(f"{name}: over VTK's surface nets with smoothing", ours / theirs, 5, "x")
    note(f"{name}: the same in CPU time", f"{cpu / their_cpu:.3g} x")
    note(f"{name}: over scikit-image's marching cubes", f"{ours / cubes:.3g} x")


def distances(name: str, volume: Volume, lower: float) -> None:
    """Compare the surface with marching cubes of the gray levels."""
    mesh, (places, faces) = surface(volume, lower), marched(padded(volume, lower), lower)
    other = TriMesh(volume.to_mm(places[:, ::-1].astype(np.float64) - 1), faces.astype(np.int64))
    apart, voxel = compare(mesh, other), min(volume.spacing_mm)
    ours, theirs = assess(mesh), assess(other)
    at_most(f"{name}: mean distance to marching cubes", apart["mean_mm"] / voxel, 0.1, "voxel")
    at_most(f"{name}: mean distance from marching cubes", apart["back_mean_mm"] / voxel, 0.1, "voxel")
    at_most(f"{name}: mean turn between faces over theirs", ours["mean_turn_deg"] / theirs["mean_turn_deg"], 1)
    at_most(f"{name}: self-intersecting faces", ours["self_intersections"], 0)
    note(f"{name}: faces, ours and theirs", f"{ours['faces']}, {theirs['faces']}")


def padded(volume: Volume, lower: float) -> NDArray[np.float32]:
    """Put one layer around the levels that takes the surface half a voxel beyond the last ones inside."""
    levels = np.pad(volume.voxels.astype(np.float32), 1, mode="edge")
    layer = np.ones(levels.shape, bool)
    layer[1:-1, 1:-1, 1:-1] = False
    return np.where(layer & (levels > lower), 2 * np.float32(lower) - levels, levels)


def marched(levels: NDArray[np.float32], lower: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return scikit-image's vertices (z, y, x) and faces."""
    from skimage.measure import marching_cubes

    places, faces, _, _ = marching_cubes(levels, lower)
    return places, faces


if __name__ == "__main__":
    main()
