"""Meshes filled back to voxels: judged by winding numbers, by VTK, by exact volumes, and by laws."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import nibabel
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from conftest import COMPILED, cuberille_of, law, seeds, size, solids
from studies import affine_of, indices_of, rotation, write_nifti
from test_end_to_end import ball
from tomomesh import fill_mesh, reconstruct
from tomomesh.cli import main
from tomomesh.errors import GeometryError
from tomomesh.model.mesh import TriMesh
from tomomesh.model.volume import Volume

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray


def grid(shape: Sequence[int], affine: NDArray[np.float64] | None = None) -> Volume:
    return Volume.from_stored(np.zeros(shape, np.uint8), np.eye(4) if affine is None else affine)


def winding_numbers(mesh: TriMesh, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sum the solid angles of all faces seen from each place, over those of a sphere (van Oosterom & Strackee 1983)."""
    total = np.zeros(len(places))
    for corners in mesh.corners:
        a, b, c = (corner - places for corner in corners)
        la, lb, lc = (np.sqrt((side**2).sum(axis=1)) for side in (a, b, c))
        over = (a * np.cross(b, c)).sum(axis=1)
        under = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
        total += 2 * np.arctan2(over, under)
    return total / (4 * np.pi)


class TestAgainstWindingNumbers:
    @law(40)
    @given(solids(widest=4), seeds)
    def test_any_closed_mesh_on_any_grid(self, solid: NDArray[np.bool_], seed: int) -> None:
        rng = np.random.default_rng(seed)
        mesh = cuberille_of(solid).triangulated()
        mesh = mesh.moved(mesh.vertices + rng.uniform(-0.3, 0.3, mesh.vertices.shape))
        turned = rotation(*rng.uniform(-3, 3, 3)) + rng.uniform(-0.2, 0.2, (3, 3))
        affine = affine_of(turned @ np.diag(rng.choice([-1.0, 1.0], 3)), (0.7, 0.9, 1.1), (0, 0, 0))
        affine[:3, 3] = mesh.vertices.mean(axis=0) - affine[:3, :3] @ np.full(3, 3.0)
        volume = grid((7, 7, 7), affine)
        numbers = winding_numbers(mesh, volume.to_mm(indices_of(volume.shape)))
        assert np.array_equal(fill_mesh(mesh, volume).ravel(), numbers > 0.5)

    @law(40)
    @given(solids())
    def test_voxels_are_given_back_exactly_with_centers_off_the_walls(self, solid: NDArray[np.bool_]) -> None:
        quads = cuberille_of(solid)
        mesh = quads.triangulated()
        low = np.floor(mesh.vertices.min(axis=0)) - 1
        affine = affine_of(np.eye(3), (1, 1, 1), tuple(low + 0.5))
        shape = tuple(int(n) for n in (np.ceil(mesh.vertices.max(axis=0)) - low + 1)[::-1])
        filled = fill_mesh(mesh, grid(shape, affine))
        assert np.count_nonzero(filled) == pytest.approx(mesh.face_volumes.sum(), abs=1e-6)


class TestLaws:
    @law(40)
    @given(solids(), st.integers(0, 2))
    def test_centers_on_walls_edges_and_corners_never_leak(self, solid: NDArray[np.bool_], axis: int) -> None:
        """Half-open: with every center on the lattice of the corners, each cube owns exactly one of them."""
        mesh = cuberille_of(solid).triangulated()
        low, high = mesh.vertices.min(axis=0) - 2, mesh.vertices.max(axis=0) + 2
        shape = tuple(int(n) for n in np.rint(high - low)[::-1] + 1)
        volume = grid(shape, affine_of(np.eye(3), (1, 1, 1), tuple(low))).along(axis)
        filled = fill_mesh(mesh, volume)
        assert np.count_nonzero(filled) == round(mesh.face_volumes.sum())
        assert not filled[0].any()
        assert not filled[-1].any()

    @law(30)
    @given(seeds)
    def test_a_mesh_beyond_the_grid_is_clipped(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        sphere = trimesh.creation.icosphere(subdivisions=2, radius=6.0)
        mesh = TriMesh(sphere.vertices + rng.uniform(-9, 9, 3), np.asarray(sphere.faces, np.int64))
        small = grid((9, 8, 7), affine_of(np.eye(3), (1, 1, 1), (-3, -4, -4)))
        large = grid((49, 48, 47), affine_of(np.eye(3), (1, 1, 1), (-23, -24, -24)))
        assert np.array_equal(fill_mesh(mesh, small), fill_mesh(mesh, large)[20:29, 20:28, 20:27])

    def test_cavities_stay_empty_and_overlaps_full(self) -> None:
        outer, inner = (trimesh.creation.icosphere(subdivisions=3, radius=radius) for radius in (8.0, 5.0))
        volume = grid((21, 21, 31), affine_of(np.eye(3), (1, 1, 1), (-10, -10, -10)))
        far = np.linalg.norm(volume.to_mm(indices_of(volume.shape)), axis=1).reshape(volume.shape)
        lined = _joined(outer.vertices, outer.faces, inner.vertices, inner.faces[:, ::-1])
        filled = fill_mesh(lined, volume)
        assert not filled[far < 4.9].any()
        assert filled[(far > 5.1) & (far < 7.8)].all()
        two = _joined(outer.vertices, outer.faces, outer.vertices + np.array([6.0, 0, 0]), outer.faces)
        assert fill_mesh(two, volume)[far < 7.8].all()

    def test_volume_converges_to_that_of_the_mesh(self) -> None:
        sphere = trimesh.creation.icosphere(subdivisions=size(4, 2), radius=10.0)
        mesh, errors = TriMesh(sphere.vertices, np.asarray(sphere.faces, np.int64)), []
        for count in (12, size(96, 24)):
            affine = affine_of(rotation(0.3, 0.2, 0.1), (30.0 / count,) * 3, (0, 0, 0))
            affine[:3, 3] = -affine[:3, :3] @ np.full(3, count / 2 + 0.1)
            volume = grid((count,) * 3, affine)
            filled = np.count_nonzero(fill_mesh(mesh, volume)) * volume.voxel_mm3
            errors.append(abs(filled / mesh.face_volumes.sum() - 1))
        assert errors[1] < min(size(1e-3, 3e-2), errors[0])

    def test_an_open_mesh_is_refused(self) -> None:
        sphere = trimesh.creation.icosphere(subdivisions=1)
        with pytest.raises(GeometryError, match="not closed"):
            fill_mesh(TriMesh(sphere.vertices, np.asarray(sphere.faces[1:], np.int64)), grid((3, 3, 3)))


def _joined(*parts: NDArray[np.float64]) -> TriMesh:
    a, f, b, g = parts
    return TriMesh(np.concatenate([a, b]), np.concatenate([f, g + len(a)]).astype(np.int64))


def test_vtk_fills_the_same_voxels() -> None:
    vtk = pytest.importorskip("vtk", reason="VTK judges, where it is installed")
    from vtk.util.numpy_support import vtk_to_numpy

    sphere = trimesh.creation.icosphere(subdivisions=3, radius=7.03)
    vertices = sphere.vertices * [1.0, 0.8, 1.2] + [0.013, 0.029, 0.017]
    mesh = TriMesh(vertices, np.asarray(sphere.faces, np.int64))
    data, points, cells = vtk.vtkPolyData(), vtk.vtkPoints(), vtk.vtkCellArray()
    for place in vertices:
        points.InsertNextPoint(*place)
    for face in mesh.faces:
        cells.InsertNextCell(3, [int(n) for n in face])
    data.SetPoints(points)
    data.SetPolys(cells)
    stencil, image = vtk.vtkPolyDataToImageStencil(), vtk.vtkImageStencilToImage()
    stencil.SetInputData(data)
    stencil.SetOutputSpacing(1, 1, 1)
    stencil.SetOutputOrigin(-10, -10, -10)
    stencil.SetOutputWholeExtent(0, 20, 0, 20, 0, 20)
    stencil.SetTolerance(0)
    image.SetInputConnection(stencil.GetOutputPort())
    image.SetInsideValue(1)
    image.SetOutsideValue(0)
    image.Update()
    theirs = vtk_to_numpy(image.GetOutput().GetPointData().GetScalars()).reshape(21, 21, 21) > 0
    ours = fill_mesh(mesh, grid((21, 21, 21), affine_of(np.eye(3), (1, 1, 1), (-10, -10, -10))))
    assert np.array_equal(ours, theirs)


def solid() -> NDArray[np.int16]:
    """A ball, a small one where kernels are slow."""
    return ball((40, 48, 44)) if COMPILED else ball((17, 19, 18), 7.0)


class TestCommand:
    AFFINE = affine_of(rotation(0.3, 0.1, -0.2) @ np.diag([-1.0, 1.0, 1.0]), (1.0, 1.2, 0.9))

    def test_the_mask_lies_on_the_study_and_the_report_compares_it(self, tmp_path: Path) -> None:
        study = write_nifti(tmp_path / "ball.nii", solid(), self.AFFINE)
        labels = write_nifti(tmp_path / "labels.nii", (solid() > 50).astype(np.uint8) * 7, self.AFFINE)
        mask, report = tmp_path / "mask.nii.gz", tmp_path / "report.json"
        common = ["-o", str(tmp_path / "b.ply"), "--network", "none", "--mask-out", str(mask), "--report", str(report)]
        for given_, against in (
            ([str(study), "--lower", "50"], "window"),
            ([str(study), "--labels-in", str(labels), "--select", "7"], "labels"),
        ):
            assert main(["reconstruct", *given_, *common, "--quiet"]) == 0
            written, source = nibabel.load(mask), nibabel.load(study)
            assert np.allclose(written.affine, source.affine, atol=1e-5)
            filled, wanted = np.asarray(written.dataobj) == 1, np.asarray(source.dataobj) > 50
            told = json.loads(report.read_text())["mask"]
            dice = 2 * np.count_nonzero(filled & wanted) / (np.count_nonzero(filled) + np.count_nonzero(wanted))
            assert told["dice"] == pytest.approx(dice)
            assert dice > size(0.97, 0.9)
            assert told["voxels"] == np.count_nonzero(filled)
            assert told["against"] == against
            assert told["volume_mm3"] == pytest.approx(told["voxels"] * 1.0 * 1.2 * 0.9)

    def test_a_part_is_filled_in_its_place(self, tmp_path: Path) -> None:
        study = write_nifti(tmp_path / "ball.nii", solid(), self.AFFINE)
        mask, report = tmp_path / "mask.nii", tmp_path / "report.json"
        options = ["--lower", "50", "--network", "none", "--slice-range", "2", "-5", "--quiet"]
        files = ["-o", str(tmp_path / "b.ply"), "--mask-out", str(mask), "--report", str(report)]
        assert main(["reconstruct", str(study), *files, *options]) == 0
        assert json.loads(report.read_text())["mask"]["dice"] > size(0.95, 0.9)

    def test_the_summary_says_how_well_it_agrees(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        study = write_nifti(tmp_path / "ball.nii", solid(), self.AFFINE)
        files = ["-o", str(tmp_path / "b.ply"), "--mask-out", str(tmp_path / "mask.nii")]
        assert main(["reconstruct", str(study), *files, "--lower", "50", "--network", "none"]) == 0
        assert " voxels inside the mesh, Dice " in capsys.readouterr().out

    def test_the_solid_of_a_ring_network_is_filled(self) -> None:
        volume = Volume.from_stored(solid(), self.AFFINE)
        surface = reconstruct(volume, lower=50.0)
        filled = fill_mesh(surface.mesh, volume)
        volume_mm3 = np.count_nonzero(filled) * volume.voxel_mm3
        assert volume_mm3 == pytest.approx(surface.mesh.face_volumes.sum(), rel=size(0.02, 0.1))
