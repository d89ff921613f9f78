"""One job in one process: draw a cloud, make its surface with one method, score it, or make a reference.

`arena.py` runs this in the peers' environment, and with ``tomomesh`` as the method in the project's own.
Every job prints one line of JSON.
"""

from __future__ import annotations

import json
import resource
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bench import judge, median_times

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Cloud = NDArray[np.float64]
    Found = dict[str, float]
    Arrays = tuple[NDArray[np.float64], NDArray[np.int64]]

NEIGHBORS = 16
"""Points that a normal is fitted to."""

SEED = 7


def main() -> None:
    job, *arguments = sys.argv[1:]
    print(json.dumps(JOBS[job](*arguments)))


def draw(source: str, points: str, noise: str, outliers: str, out: str) -> Found:
    """Draw a cloud of 32-bit positions from a mesh; the outliers are uniform in the cloud's bounding box."""
    import trimesh

    mesh = trimesh.load(source, process=True, force="mesh")
    drawn = judge("cloud").cloud(mesh, int(points), float(noise), SEED)
    stray = np.random.default_rng(SEED).random((round(float(outliers) * len(drawn)), 3))
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    np.save(out, np.concatenate([drawn, low + stray * (high - low)]).astype(np.float32))
    return {"points": len(drawn) + len(stray)}


def reconstruct(method: str, depth: str, source: str, out: str, repeats: str) -> Found:
    """Run a method once for its surface and its peak of memory, then again for its median seconds."""
    points, run = _read(Path(source)), METHODS[method]
    surfaces: list[Arrays] = []
    peaks: list[float] = []

    def once() -> None:
        surfaces.clear()
        surfaces.append(run(points, int(depth)))
        peaks.append(_peak_mib())

    seconds = median_times(once, repeats=int(repeats))
    _write(out, *surfaces[-1])
    return {"peak_mib": peaks[0], **dict(zip(["seconds"], seconds, strict=False))}


def score(surface: str, reference: str) -> Found:
    """Score a surface as it is stored."""
    import trimesh

    scoring = judge("score")
    scored = scoring.score(trimesh.load(surface, process=False, force="mesh"), scoring.reference(reference))
    return {name: float(figure) for name, figure in scored.items()}


def place(source: str, *numbers: str) -> Found:
    """Move a mesh by the three rows of an affine map; the last argument is the file to write."""
    *rows, out = numbers
    reference = judge("score").reference(source)
    affine = np.array(rows, np.float64).reshape(3, 4)
    _write(out, reference.vertices @ affine[:, :3].T + affine[:, 3], reference.faces)
    return {"faces": len(reference.faces)}


def make_solids(out: str) -> Found:
    """Write the torus and the ball that the contours were cut from."""
    import trimesh

    torus = trimesh.creation.torus(40, 15, major_sections=512, minor_sections=256)
    torus.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], [0, 1, 0]))
    ball = trimesh.creation.icosphere(subdivisions=6, radius=25)
    ball.apply_translation([120, 0, 0])
    both = trimesh.util.concatenate(torus, ball)
    both.export(out)
    return {"faces": len(both.faces)}


def _tomomesh(points: Cloud, depth: int) -> Arrays:
    from tomomesh import reconstruct_points

    mesh = reconstruct_points(points).mesh
    return mesh.vertices, mesh.faces


def _open3d(points: Cloud, depth: int) -> Arrays:
    import ctypes

    import libusb_package

    # Open3D's library asks for libusb, which not every system has; the package's is found by its name.
    ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    import open3d

    oriented = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    oriented.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(NEIGHBORS))
    oriented.orient_normals_consistent_tangent_plane(30)
    mesh, _ = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(oriented, depth=depth)
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles, np.int64)


def _pymeshlab(points: Cloud, depth: int) -> Arrays:
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(points))
    meshes.compute_normal_for_point_clouds(k=NEIGHBORS)
    meshes.generate_surface_reconstruction_screened_poisson(depth=depth)
    mesh = meshes.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64)


def _meshlib(points: Cloud, depth: int) -> Arrays:
    from meshlib import mrmeshnumpy, mrmeshpy

    mesh = mrmeshpy.triangulatePointCloud(mrmeshnumpy.pointCloudFromPoints(points))
    return mrmeshnumpy.getNumpyVerts(mesh), mrmeshnumpy.getNumpyFaces(mesh.topology).astype(np.int64)


def _vtk(points: Cloud, depth: int) -> Arrays:
    import pyvista

    spacing = 1.5 * _sampling_distance(points)
    mesh = pyvista.PolyData(points).reconstruct_surface(nbr_sz=20, sample_spacing=spacing)
    return np.asarray(mesh.points, np.float64), np.asarray(mesh.triangulate().regular_faces, np.int64)


def _sampling_distance(points: Cloud) -> float:
    """Return the spacing of points of which each owns its square of the surface, from the sixth neighbor."""
    from scipy.spatial import cKDTree

    sixth = cKDTree(points).query(points, k=[7])[0]
    return float(np.median(sixth) * np.sqrt(np.pi / 6))


METHODS: dict[str, Callable[[Cloud, int], Arrays]] = {
    "tomomesh": _tomomesh,
    "meshlib": _meshlib,
    "open3d": _open3d,
    "pymeshlab": _pymeshlab,
    "vtk": _vtk,
}


def _read(path: Path) -> Cloud:
    """Read the positions of a cloud: an array, the vertices of a mesh file, or three columns of text."""
    if path.suffix == ".npy":
        return np.asarray(np.load(path), np.float64)
    if path.suffix == ".ply":
        import trimesh

        return np.asarray(trimesh.load(path, process=False).vertices, np.float64)
    return np.loadtxt(path, np.float64, usecols=(0, 1, 2))


def _write(path: str, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> None:
    import trimesh

    trimesh.Trimesh(vertices, faces, process=False).export(path)


def _peak_mib() -> float:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)


JOBS = {job.__name__: job for job in (draw, reconstruct, score, place, make_solids)}


if __name__ == "__main__":
    main()
