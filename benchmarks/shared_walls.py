"""Walls that neighbors share against meshes by themselves and VTK's surface nets: distance, and CPU seconds.

    python benchmarks/shared_walls.py [--side 256] [--labels 100]

Solids that are known exactly, cut by planes and put into each other, and the map of balls of benchmarks/each_label.py.
Both are in memory, on all cores, with the kernels compiled before; VTK (package vtk) runs at its own settings.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from each_label import label_map
from tomomesh import Volume, reconstruct, reconstruct_labels
from tomomesh.isosurface.walls.walls import walls_between
from tomomesh.measure.report import area_samples
from tomomesh.model.mesh import TriMesh
from tomomesh.segmentation.labels import Labelled
from tomomesh.settings import Settings

Solid = Callable[[np.ndarray], np.ndarray]

FARTHER, TIMES = 1.1, 1.2
"""Most of the distance by itself, and of the CPU time without, that shared walls may have."""
SIDE, CENTER = 64, np.array([31.3, 32.1, 30.7])


def ball(radius: float) -> Solid:
    """Return how far places (3, ...) are outside of a ball."""
    return lambda place: np.sqrt(sum((place[n] - CENTER[n]) ** 2 for n in range(3))) - radius


def beside(*normal: float) -> Solid:
    """Return how far places are outside of a half space."""
    unit = np.array(normal) / np.linalg.norm(normal)
    return lambda place: sum(unit[n] * (place[n] - CENTER[n]) for n in range(3)) - 0.7


def no(solid: Solid) -> Solid:
    """Return what is outside of a solid."""
    return lambda place: -solid(place)


def both(*solids: Solid) -> Solid:
    """Return what several solids have in common."""
    return lambda place: np.maximum.reduce([solid(place) for solid in solids])


CUT, ACROSS = beside(1, 0.3, 0.2), beside(-0.2, 1, 0.5)
SOLIDS = {
    "halves": [both(ball(24), CUT), both(ball(24), no(CUT))],
    "thirds": [both(ball(24), CUT), both(ball(24), no(CUT), ACROSS), both(ball(24), no(CUT), no(ACROSS))],
    "shell of 2, around and within": [both(ball(20), no(ball(18))), ball(18), both(ball(26), no(ball(20)))],
    "core in halves": [ball(11), both(ball(24), no(ball(11)), CUT), both(ball(24), no(ball(11)), no(CUT))],
}


def off(mesh: TriMesh, affine: np.ndarray, solid: Solid) -> float:
    """Return the mean distance of a mesh from the surface of a solid, voxels; beside edges a bound."""
    ways = np.linalg.inv(affine)
    return float(np.abs(solid((area_samples(mesh, 50_000) @ ways[:3, :3].T + ways[:3, 3]).T)).mean())


def nets_of_vtk(voxels: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, triangles, and the labels on both sides of each."""
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkFiltersCore import vtkSurfaceNets3D

    image, net = vtkImageData(), vtkSurfaceNets3D()
    image.SetDimensions(*voxels.shape[::-1])
    image.GetPointData().SetScalars(numpy_to_vtk(voxels.ravel(), deep=1))
    net.SetInputData(image)
    for place, label in enumerate(np.unique(voxels)[1:].tolist()):
        net.SetLabel(place, label)
    net.SetOutputMeshTypeToTriangles()
    net.Update()
    found = net.GetOutput()
    corners = vtk_to_numpy(found.GetPolys().GetConnectivityArray()).reshape(-1, 3).astype(np.int64)
    labels = vtk_to_numpy(found.GetCellData().GetArray("BoundaryLabels"))
    return vtk_to_numpy(found.GetPoints().GetData()).astype(np.float64), corners, labels


def distances() -> None:
    """Say how far each label of the solids is off, shared, by itself, and of VTK."""
    places = np.indices((SIDE, SIDE, SIDE))[::-1].astype(np.float64)
    for name, solids in SOLIDS.items():
        voxels = np.zeros((SIDE, SIDE, SIDE), np.uint8)
        for number, solid in enumerate(solids, 1):
            voxels[solid(places) < 0] = number
        volume = Volume.from_stored(voxels, np.eye(4))
        shared, (vertices, corners, labels) = reconstruct_labels(volume, shared_walls=True), nets_of_vtk(voxels)
        for number, solid in enumerate(solids, 1):
            alone = reconstruct(volume, select=(number,), way="voxels", keep="all", remesh=False)
            other = TriMesh(vertices, corners[(labels == number).any(axis=1)])
            found = [off(one.mesh, volume.affine, solid) for one in (shared[number], alone)]
            verdict = "passed" if found[0] <= FARTHER * found[1] else "LOST"
            print(f"{name:30} {number}: {found[0]:.4f}, by itself {found[1]:.4f} ({verdict}), VTK "
                  f"{off(other, np.eye(4), solid):.4f}")  # fmt: skip


def spent(work: Callable[[], object]) -> float:
    """Return the CPU seconds of what was done once before."""
    work()
    start = time.process_time()
    work()
    return time.process_time() - start


OPTIONS: tuple[dict[str, Any], ...] = ({"shared_walls": True}, {}, {"remesh": False})


def meshes(volume: Volume, **options: Any) -> list[TriMesh]:
    """Return the mesh of every label."""
    return [one.mesh for one in reconstruct_labels(volume, **options).values()]


def times(side: int, count: int) -> None:
    """Say what nets and meshes cost."""
    voxels = label_map(side, count)
    volume, settings = Volume.from_stored(voxels, np.eye(4)), Settings()
    every = [spent(partial(meshes, volume, **options)) for options in OPTIONS]
    verdict = "passed" if every[0] <= TIMES * every[1] else "LOST"
    print(f"{count} labels at {side}^3: shared {every[0]:.2f} s, without {every[1]:.2f} s ({verdict}), "
          f"nor even {every[2]:.2f} s")  # fmt: skip
    net, judge = spent(lambda: walls_between(Labelled.of(volume), settings.fit)), spent(lambda: nets_of_vtk(voxels))
    print(f"the net at rest {net:.2f} s, VTK's {judge:.2f} s")


def main() -> None:
    """Measure, and say whether the marks are met."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", type=int, default=256)
    parser.add_argument("--labels", type=int, default=100)
    asked = parser.parse_args()
    distances()
    times(asked.side, asked.labels)


if __name__ == "__main__":
    main()
