"""Files: volumes, meshes and clouds read, meshes and clouds written, each beside a library that knows the format."""

from __future__ import annotations

import tempfile
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bench import costs, note, race
from reading import compare_all
from tomomesh import PointSet, TriMesh
from tomomesh.io import read_mesh, read_points, write_mesh, write_points
from tomomesh.model.icosphere import icosphere

if TYPE_CHECKING:
    from collections.abc import Callable

MOST = 1.1
SPLITS, POINTS = 128, 300_000
"""A ball of 327,680 faces, and a cloud about as large."""


class Peer(NamedTuple):
    """A library that does the same."""

    package: str
    does: Callable[[Any, str], object]


def trimesh_write(made: Any, path: str) -> object:
    mesh = import_module("trimesh").Trimesh(made.vertices, made.faces, process=False)
    return mesh.export(path)


def trimesh_read(_: Any, path: str) -> object:
    return import_module("trimesh").load(path)


def vtk_write(made: Any, path: str) -> object:
    vtk, arrays = import_module("vtk"), import_module("vtkmodules.util.numpy_support")
    points, cells, data = vtk.vtkPoints(), vtk.vtkCellArray(), vtk.vtkPolyData()
    points.SetData(arrays.numpy_to_vtk(made.vertices))
    cells.SetData(3, arrays.numpy_to_vtkIdTypeArray(made.faces.ravel()))
    data.SetPoints(points)
    data.SetPolys(cells)
    writer = vtk.vtkXMLPolyDataWriter()
    writer.SetInputData(data)
    writer.SetFileName(path)
    return writer.Write()


def vtk_read(_: Any, path: str) -> object:
    reader = import_module("vtk").vtkXMLPolyDataReader()
    reader.SetFileName(path)
    reader.Update()
    return reader.GetOutput()


def nibabel_read(_: Any, path: str) -> object:
    image = import_module("nibabel").load(path)
    return [one.data for one in image.darrays]


def nibabel_write(made: Any, path: str) -> object:
    gifti = import_module("nibabel.gifti")
    arrays = [
        gifti.GiftiDataArray(made.vertices.astype(np.float32), "NIFTI_INTENT_POINTSET"),
        gifti.GiftiDataArray(made.faces.astype(np.int32), "NIFTI_INTENT_TRIANGLE"),
    ]
    return gifti.GiftiImage(darrays=arrays).to_filename(path)


def numpy_text(_: Any, path: str) -> object:
    return np.loadtxt(path, delimiter="," if path.endswith("csv") else None, skiprows=int(path.endswith("csv")))


def laspy_read(_: Any, path: str) -> object:
    return import_module("laspy").read(path).xyz


def e57_read(_: Any, path: str) -> object:
    return import_module("pye57").E57(path).read_scan(0, ignore_missing_fields=True)


def pcd_read(_: Any, path: str) -> object:
    return import_module("pypcd4").PointCloud.from_path(path).numpy(("x", "y", "z"))


MESHES = {
    ".stl": (Peer("trimesh", trimesh_read), Peer("trimesh", trimesh_write)),
    ".ply": (Peer("trimesh", trimesh_read), Peer("trimesh", trimesh_write)),
    ".obj": (Peer("trimesh", trimesh_read), Peer("trimesh", trimesh_write)),
    ".off": (Peer("trimesh", trimesh_read), Peer("trimesh", trimesh_write)),
    ".glb": (Peer("trimesh", trimesh_read), Peer("trimesh", trimesh_write)),
    ".3mf": (Peer("trimesh", trimesh_read), Peer("trimesh", trimesh_write)),
    ".vtp": (Peer("vtk", vtk_read), Peer("vtk", vtk_write)),
    ".gii": (Peer("nibabel", nibabel_read), Peer("nibabel", nibabel_write)),
}
CLOUDS = {
    ".ply": Peer("trimesh", trimesh_read),
    ".xyz": Peer("numpy", numpy_text),
    ".csv": Peer("numpy", numpy_text),
    ".las": Peer("laspy", laspy_read),
    ".laz": Peer("laspy", laspy_read),
    ".pcd": Peer("pypcd4", pcd_read),
    ".e57": Peer("pye57", e57_read),
}


def main() -> None:
    compare_all()
    with tempfile.TemporaryDirectory() as folder:
        meshes(Path(folder))
        clouds(Path(folder))


def meshes(folder: Path) -> None:
    vertices, faces = icosphere(SPLITS)
    mesh = TriMesh(50 * vertices, faces)
    for suffix, (reads, writes) in MESHES.items():
        ours, theirs = folder / f"ours{suffix}", str(folder / f"theirs{suffix}")
        _race(f"{suffix} of {len(faces)} faces written", partial(write_mesh, mesh, ours), writes, mesh, theirs)
        write_mesh(mesh, ours)
        _race(f"{suffix} of {len(faces)} faces read", partial(read_mesh, ours), reads, mesh, str(ours))


def clouds(folder: Path) -> None:
    positions = 100 * np.random.default_rng(0).random((POINTS, 3))
    for suffix, reads in CLOUDS.items():
        path = folder / f"cloud{suffix}"
        if find_spec(reads.package) and _written(positions, path):
            _race(f"{suffix} of {POINTS} points read", partial(read_points, path), reads, None, str(path))
        else:
            note(f"{suffix} of {POINTS} points read", f"not measured: {reads.package} is not installed")


def _written(positions: Any, path: Path) -> bool:
    """Write a cloud, in formats that tomomesh only reads by the peer."""
    if path.suffix in (".las", ".laz"):
        laspy = import_module("laspy")
        cloud = laspy.create(point_format=0, file_version="1.2")
        cloud.header.scales = [1e-4] * 3
        cloud.xyz = positions
        cloud.write(str(path))
    elif path.suffix == ".pcd":
        import_module("pypcd4").PointCloud.from_xyz_points(positions.astype(np.float32)).save(str(path))
    elif path.suffix == ".e57":
        names = ("cartesianX", "cartesianY", "cartesianZ")
        with import_module("pye57").E57(str(path), mode="w") as file:
            file.write_scan_raw(dict(zip(names, positions.T.copy(), strict=True)))
    else:
        write_points(PointSet.from_positions(positions), path)
    return True


def _race(figure: str, ours: Callable[[], object], peer: Peer, made: Any, path: str) -> None:
    if not find_spec(peer.package):
        note(figure, f"not measured: {peer.package} is not installed")
        return
    own, other = costs(ours, lambda: peer.does(made, path), repeats=3)
    race(f"{figure}, {peer.package}", own, other, MOST)


if __name__ == "__main__":
    main()
