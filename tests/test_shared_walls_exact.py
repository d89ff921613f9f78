"""Shared walls of solids that are known exactly, in thick slices too, and beside another program's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from label_walls import FIT, SLOW, boundaries, label_maps, labelled, walls_of
from tomomesh import Volume, reconstruct, reconstruct_labels
from tomomesh.isosurface.walls.walls import walls_between
from tomomesh.measure.intersections import CrossingFaces
from tomomesh.measure.report import area_samples
from tomomesh.measure.topology import check_promise
from tomomesh.model.mesh import TriMesh

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Solid = Callable[[Any], Any]

CENTER = np.array([19.3, 20.1, 18.7])
SIDE = 40


def ball(radius: float) -> Solid:
    return lambda place: np.sqrt(sum((place[n] - CENTER[n]) ** 2 for n in range(3))) - radius


def half(*normal: float) -> Solid:
    unit = np.array(normal) / np.linalg.norm(normal)
    return lambda place: sum(unit[n] * (place[n] - CENTER[n]) for n in range(3)) - 0.3


def without(solid: Solid) -> Solid:
    return lambda place: -solid(place)


def both(*solids: Solid) -> Solid:
    return lambda place: np.maximum.reduce([solid(place) for solid in solids])


CUT, ACROSS = half(1, 0.3, 0.2), half(-0.2, 1, 0.5)
SOLIDS = {
    "halves": [both(ball(15), CUT), both(ball(15), without(CUT))],
    "thirds": [both(ball(15), CUT), *(both(ball(15), without(CUT), side) for side in (ACROSS, without(ACROSS)))],
    "shells": [both(ball(12), without(ball(10))), ball(10), both(ball(16), without(ball(12)))],
    "core": [ball(7), both(ball(15), without(ball(7)), CUT), both(ball(15), without(ball(7)), without(CUT))],
}  # fmt: skip


def map_of(solids: list[Solid]) -> NDArray[np.uint8]:
    places = np.indices((SIDE, SIDE, SIDE))[::-1].astype(np.float64)
    voxels = np.zeros((SIDE, SIDE, SIDE), np.uint8)
    for number, solid in enumerate(solids, 1):
        voxels[solid(places) < 0] = number
    return voxels


def off(mesh: Any, solid: Solid) -> float:
    """Return how far a mesh is from the surface of a solid on average; distances beside its edges are bounds."""
    return float(np.abs(solid(area_samples(mesh, 20_000).T)).mean())


class TestThick:
    @law(40)
    @given(label_maps(), st.sampled_from([0, 1, 2]), st.sampled_from([1.6, 2.7, 4.0]))
    def test_divided_labels_keep_the_promise(self, voxels: NDArray[Any], axis: int, thick: float) -> None:
        affine = np.diag(np.where(np.arange(4) == axis, thick, 1.0))
        walls = walls_between(labelled(voxels, affine), FIT, divide=True)
        assert walls.block.parts == round(thick)
        for one in boundaries(walls).values():
            check_promise(one.made.mesh, cavities=one.cavities)
        assert not CrossingFaces()(walls.mesh).any()

    @SLOW
    @pytest.mark.parametrize("thick", [2, 4])
    def test_a_label_by_itself_is_divided_as_alone(self, thick: int) -> None:
        volume = Volume.from_stored(map_of([ball(15)])[::thick], np.diag([1.0, 1.0, thick, 1.0]))
        alone = reconstruct(volume, select=(1,), way="voxels", keep="all", remesh=False)
        shared = reconstruct_labels(volume, shared_walls=True)[1]
        assert shared.report["voxels"] == alone.report["voxels"]
        assert shared.mesh.faces.shape == alone.mesh.faces.shape
        apart = np.abs(shared.mesh.vertices - alone.mesh.vertices).max(axis=1)
        assert np.percentile(apart, 90) < 0.005  # shares have 16 bits
        assert apart.max() < 0.2  # beside voxels that are kept with less than half

    @SLOW
    @pytest.mark.parametrize("name", ["halves", "thirds", "core"])
    @pytest.mark.parametrize("thick", [2, 4])
    def test_no_mesh_is_a_tenth_farther_than_alone(self, name: str, thick: int) -> None:
        volume = Volume.from_stored(map_of(SOLIDS[name])[::thick], np.diag([1.0, 1.0, thick, 1.0]))
        shared = reconstruct_labels(volume, shared_walls=True)
        for number, solid in enumerate(SOLIDS[name], 1):
            alone = reconstruct(volume, select=(number,), way="voxels", keep="all", remesh=False)
            scaled = [in_voxels(surface.mesh, volume) for surface in (shared[number], alone)]
            one, other = (off(mesh.moved(mesh.vertices * [1, 1, thick]), solid) for mesh in scaled)
            assert one < 1.1 * other < 0.1 * thick


@SLOW
class TestExact:
    @pytest.mark.parametrize("name", SOLIDS)
    def test_no_mesh_is_a_tenth_farther_than_alone(self, name: str) -> None:
        volume = Volume.from_stored(map_of(SOLIDS[name]), np.eye(4))
        shared = reconstruct_labels(volume, shared_walls=True)
        for number, solid in enumerate(SOLIDS[name], 1):
            alone = reconstruct(volume, select=(number,), way="voxels", keep="all", remesh=False)
            one, other = (off(in_voxels(surface.mesh, volume), solid) for surface in (shared[number], alone))
            assert one < 1.1 * other < 0.1

    @pytest.mark.parametrize("name", SOLIDS)
    def test_surface_nets_of_vtk_lie_farther_off(self, name: str) -> None:
        voxels = map_of(SOLIDS[name])
        places, corners, labels = nets_of_vtk(voxels)
        walls = walls_of(voxels, np.eye(4))
        for number, solid in enumerate(SOLIDS[name], 1):
            judge = TriMesh(places, corners[(labels == number).any(axis=1)])
            bounded = walls.of(number)
            assert bounded is not None
            assert len(judge.faces) == 2 * len(bounded.net.quads) or len(walls.block.given)
            own = in_voxels(bounded.made.mesh, labelled(voxels, np.eye(4)).volume)
            assert 1.5 * off(own, solid) < off(judge, solid)


def in_voxels(mesh: TriMesh, volume: Volume) -> TriMesh:
    """Return a mesh in the indices (x, y, z) of a volume's voxels."""
    inverse = np.linalg.inv(volume.affine)
    return mesh.moved(mesh.vertices @ inverse[:3, :3].T + inverse[:3, 3])


def nets_of_vtk(voxels: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Return vertices, triangles, and the labels on both sides of each, of VTK's surface nets at its own settings."""
    filters = pytest.importorskip("vtkmodules.vtkFiltersCore", reason="VTK judges, where it is installed")
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkImageData

    image = vtkImageData()
    image.SetDimensions(*voxels.shape[::-1])
    image.GetPointData().SetScalars(numpy_to_vtk(voxels.ravel(), deep=1))
    net = filters.vtkSurfaceNets3D()
    net.SetInputData(image)
    for place, label in enumerate(np.unique(voxels)[1:].tolist()):
        net.SetLabel(place, label)
    net.SetOutputMeshTypeToTriangles()
    net.Update()
    found = net.GetOutput()
    corners = vtk_to_numpy(found.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    labels = vtk_to_numpy(found.GetCellData().GetArray("BoundaryLabels"))
    return vtk_to_numpy(found.GetPoints().GetData()).astype(np.float64), corners.astype(np.int64), labels
