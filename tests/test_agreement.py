"""How near a mesh is to a segmentation or to another mesh: slow twins, known shifts, and SimpleITK as judge."""

from __future__ import annotations

import json
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from conftest import COMPILED, law, seeds, size, solids
from studies import rotation, shared, write_nifti
from test_cli import fails
from test_end_to_end import ball
from tomomesh import TriMesh, Volume, compare_with_study, read_mesh, write_mesh
from tomomesh.agreement import sides, voxels
from tomomesh.agreement.meshes import compare_with_mesh
from tomomesh.agreement.sides import areas_of, samples_of, sides_in_slabs
from tomomesh.agreement.voxels import compare_with_voxels, distance_to_voxels
from tomomesh.cli import main
from tomomesh.errors import UsageError
from tomomesh.isosurface.sides import WindowSides

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from numpy.typing import NDArray

SKEWED = np.array([[0.9, 0.1, 0.3, -40], [0.0, 1.3, 0.2, 12], [0.1, -0.2, 2.1, 500], [0, 0, 0, 1.0]])


def box_of(low: tuple[float, ...], high: tuple[float, ...]) -> TriMesh:
    judge = trimesh.creation.box(bounds=np.array([low, high], float))
    return TriMesh(np.array(judge.vertices), np.array(judge.faces, np.int64))


def block(shape: tuple[int, int, int] = (9, 10, 12)) -> NDArray[np.bool_]:
    """Return the voxels 3..6 of columns, 2..7 of rows, 1..4 of slices."""
    mask = np.zeros(shape, bool)
    mask[1:5, 2:8, 3:7] = True
    return mask


def on_grid(mask: NDArray[Any], affine: NDArray[np.float64] = SKEWED) -> Volume:
    """Return a volume whose canonical order is the stored one."""
    return Volume.from_stored(mask, affine)


class TestSides:
    @law(60)
    @given(mask=solids(5), slab=st.sampled_from([1, 7, 40, 2**20]))
    def test_every_face_is_there_once_whatever_the_slabs(self, mask: NDArray[np.bool_], slab: int) -> None:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sides, "SLAB_VOXELS", slab)
            parts = list(sides_in_slabs(mask))
        found = np.concatenate([part.middles for part in parts])
        assert sorted(map(tuple, found)) == sorted(map(tuple, WindowSides.of(mask).some()))
        for part in parts:
            corners, triangles = part.triangles()
            if len(part.middles):
                assert part.first <= corners[:, 2].min() <= corners[:, 2].max() <= part.last
                assert len(triangles) == 2 * len(part.middles)

    def test_none_of_nothing(self) -> None:
        assert not list(sides_in_slabs(np.zeros((3, 4, 5), bool)))

    def test_samples_are_spread_by_area(self) -> None:
        volume = on_grid(block())
        counts = np.array([2 * 4 * 6, 2 * 4 * 4, 2 * 6 * 4])  # across columns, rows, slices
        areas = counts * areas_of(volume)
        places = samples_of(block(), volume, 20_000)
        indices = volume.to_indices(places)
        across = np.abs(indices % 1 - 0.5) < 1e-9
        assert (across.sum(axis=1) == 1).all()
        np.testing.assert_allclose(across.mean(axis=0), areas / areas.sum(), atol=1e-3)
        for axis, (low, high) in enumerate(((2.5, 6.5), (1.5, 7.5), (0.5, 4.5))):
            on_others = indices[~across[:, axis], axis]
            assert on_others.min() >= low
            assert on_others.max() <= high
            assert on_others.mean() == pytest.approx((low + high) / 2, abs=0.02)


class TestDistance:
    @law(25)
    @given(mask=solids(6), seed=seeds, slab=st.sampled_from([1, 2**20]), side=st.integers(1, 8))
    def test_equals_the_distance_to_the_whole_boundary(
        self, mask: NDArray[np.bool_], seed: int, slab: int, side: int
    ) -> None:
        rng = np.random.default_rng(seed)
        volume = on_grid(mask)
        places = volume.to_mm(rng.uniform(-9, 14, (15, 3)))
        parts = [part.triangles() for part in sides_in_slabs(mask)]
        starts = np.cumsum([0, *(len(corners) for corners, _ in parts)])
        corners = volume.to_mm(np.concatenate([corners for corners, _ in parts]))
        faces = np.concatenate([triangles + start for (_, triangles), start in zip(parts, starts, strict=False)])
        judge = trimesh.Trimesh(corners, faces, process=False)
        right = trimesh.proximity.closest_point_naive(judge, places)[1]
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sides, "SLAB_VOXELS", slab)
            patch.setattr(voxels, "BLOCK", side)
            np.testing.assert_allclose(distance_to_voxels(places, mask, volume), right, atol=1e-6)


class TestVoxels:
    @pytest.mark.parametrize("moved", [0, 1, 2])
    def test_a_box_on_its_voxels_and_beside_them(self, moved: int) -> None:
        """Moved along a column of 1.5 mm by whole voxels: everything is known."""
        mask, volume = block(), on_grid(block(), np.diag([1.5, 1.0, 2.0, 1.0]))
        box = box_of((2.5 * 1.5 + 1.5 * moved, 1.5, 1.0), (6.5 * 1.5 + 1.5 * moved, 7.5, 9.0))
        found = compare_with_voxels(box, mask, volume)
        assert found["dice"] == pytest.approx((4 - moved) / 4)
        assert found["voxels"] == found["wanted"] == mask.sum()
        assert found["volume_mm3"] == pytest.approx(mask.sum() * 3)
        for key in ("max_mm", "back_max_mm"):
            assert found[key] == pytest.approx(1.5 * moved, abs=1e-6)
        assert found["mean_mm"] == pytest.approx(found["back_mean_mm"], abs=0.02)

    def test_what_is_open_has_no_dice_but_distances(self) -> None:
        mesh = box_of((2.5, 1.5, 0.5), (6.5, 7.5, 4.5))
        found = compare_with_voxels(TriMesh(mesh.vertices, mesh.faces[1:]), block(), on_grid(block(), np.eye(4)))
        assert found["dice"] is None
        assert found["max_mm"] == pytest.approx(0, abs=1e-6)
        assert found["back_max_mm"] > 0.5

    def test_simpleitk_finds_the_same_overlap_and_hausdorff(self) -> None:
        """Its distances are those of voxels' middles to the other body, so they may differ by a voxel."""
        sitk = pytest.importorskip("SimpleITK", reason="SimpleITK judges, where it is installed")
        mask = np.asarray(ball((24, 26, 28), 8.0)) > 50
        volume = on_grid(mask, np.diag([1.0, 1.1, 1.3, 1.0]))
        center = volume.to_mm(np.argwhere(mask)[:, ::-1].mean(axis=0, keepdims=True).astype(float))[0]
        sphere = trimesh.creation.icosphere(2, radius=8.0)
        mesh = TriMesh(sphere.vertices + center + [2.2, 0, 0], np.array(sphere.faces, np.int64))
        found = compare_with_voxels(mesh, mask, volume)
        places = volume.to_mm(np.argwhere(np.ones_like(mask))[:, ::-1].astype(float)) - center - [2.2, 0, 0]
        below = places @ sphere.face_normals.T < (sphere.face_normals * sphere.triangles_center).sum(axis=1)
        inside = below.all(axis=1)  # it is convex
        images = [sitk.GetImageFromArray(one.astype(np.uint8)) for one in (inside.reshape(mask.shape), mask)]
        for image in images:
            image.SetSpacing((1.0, 1.1, 1.3))
        overlap, hausdorff = sitk.LabelOverlapMeasuresImageFilter(), sitk.HausdorffDistanceImageFilter()
        overlap.Execute(*images)
        hausdorff.Execute(*images)
        assert found["dice"] == pytest.approx(overlap.GetDiceCoefficient(), abs=1e-9)
        most = max(found["max_mm"], found["back_max_mm"])
        assert most == pytest.approx(hausdorff.GetHausdorffDistance(), abs=1.3)


class TestStudy:
    def test_labels_must_be_chosen_where_there_are_several(self) -> None:
        labels = block().astype(np.uint8) * 3
        box = box_of((2.5, 1.5, 0.5), (6.5, 7.5, 4.5))
        assert compare_with_study(box, on_grid(labels, np.eye(4)))["dice"] == 1
        labels[0, :4, :4] = 9
        with pytest.raises(UsageError, match="--select"):
            compare_with_study(box, on_grid(labels, np.eye(4)))
        assert compare_with_study(box, on_grid(labels, np.eye(4)), select=(3,))["dice"] == 1
        assert compare_with_study(box, on_grid(labels, np.eye(4)), select=(3, 9))["dice"] < 1

    def test_a_window_of_gray_levels(self) -> None:
        levels = block().astype(np.float32) * 100 + np.arange(12)
        box = box_of((2.5, 1.5, 0.5), (6.5, 7.5, 4.5))
        found = compare_with_study(box, on_grid(levels, np.eye(4)), lower=50.0)
        assert (found["dice"], found["chosen_by"]) == (1, "given")
        assert compare_with_study(box, on_grid(levels, np.eye(4)), lower=105.0)["dice"] < 0.6


class TestMeshes:
    def test_two_balls(self) -> None:
        """Two balls of radius 1 whose middles are d apart have 1 - 3/4 d + d^3 / 16 in common."""
        sphere = trimesh.creation.icosphere(5)
        mesh = TriMesh(sphere.vertices, np.array(sphere.faces, np.int64))
        found = compare_with_mesh(mesh, mesh.moved(mesh.vertices + np.array([0.1, 0, 0])))
        assert found["dice"] == pytest.approx(1 - 0.075 + 0.001 / 16, abs=1e-3)
        assert found["max_mm"] == pytest.approx(0.1, abs=1e-3)
        assert compare_with_mesh(mesh, mesh)["dice"] == 1
        opened = TriMesh(mesh.vertices, mesh.faces[1:])
        assert compare_with_mesh(mesh, opened)["dice"] is compare_with_mesh(opened, mesh)["dice"] is None


@pytest.fixture(scope="module", name="made")
def _made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make an oblique study whose label 5 is a ball, and a mesh of it in every frame."""
    folder = tmp_path_factory.mktemp("made")
    affine = np.eye(4)
    affine[:3, :3] = rotation(0.3, 0.1, -0.2) @ np.diag([-1.0, 1.2, 1.5])
    affine[:3, 3] = 30, -20, 7
    gray = ball((28, 30, 32), 9.0) if COMPILED else ball((13, 14, 15), 5.0)
    labels = (np.asarray(gray) > 50).astype(np.uint8) * 5
    labels[0, 0, :3] = 2
    write_nifti(folder / "labels.nii", labels, affine)
    for frame in ("lps", "ras", "voxel"):
        line = ["reconstruct", "--labels-in", str(folder / "labels.nii"), "--select", "5", "--frame", frame]
        assert main([*line, "-o", str(folder / f"{frame}.stl"), "--quiet"]) == 0
    return folder


def checked(made: Path, mesh: str, against: str, capsys: CaptureFixture[str], *more: str) -> dict[str, Any]:
    assert main(["check", str(made / mesh), "--against", str(made / against), "--json", *more]) == 0
    return dict(json.loads(capsys.readouterr().out))


class TestCommand:
    def test_every_frame_is_respected(self, made: Path, capsys: CaptureFixture[str]) -> None:
        first = checked(made, "lps.stl", "labels.nii", capsys, "--select", "5")
        assert first["dice"] > size(0.98, 0.9)
        assert first["max_mm"] < 1.5
        assert first["against"]["against"] == "labels"
        assert first["against"]["notes"] == []
        for frame in ("ras", "voxel"):
            found = checked(made, f"{frame}.stl", "labels.nii", capsys, "--select", "5")
            assert found["dice"] == first["dice"]
            for key in ("mean_mm", "p95_mm", "back_mean_mm", "back_max_mm"):
                assert found[key] == pytest.approx(first[key], rel=0.02)

    def test_meshes_are_brought_into_one_frame(self, made: Path, capsys: CaptureFixture[str]) -> None:
        found = checked(made, "ras.stl", "lps.stl", capsys)
        assert found["dice"] == 1
        assert found["max_mm"] < 1e-4
        mesh = read_mesh(made / "lps.stl")
        write_mesh(mesh.moved(mesh.vertices / 10), made / "cm.ply", unit="cm")
        assert checked(made, "cm.ply", "ras.stl", capsys)["max_mm"] < 1e-4
        trimesh.Trimesh(mesh.vertices / 25.4, mesh.faces, process=False).export(made / "millimeters.3mf")
        with zipfile.ZipFile(made / "millimeters.3mf") as old, zipfile.ZipFile(made / "in.3mf", "w") as new:
            for name in old.namelist():
                new.writestr(name, old.read(name).replace(b'unit="millimeter"', b'unit="inch"'))
        assert checked(made, "in.3mf", "lps.stl", capsys)["max_mm"] < 1e-4
        fails(["check", str(made / "ras.stl"), "--against", str(made / "voxel.stl")], 5, capsys)

    def test_a_mesh_counted_from_a_corner_is_brought_back(self, made: Path, capsys: CaptureFixture[str]) -> None:
        mesh = read_mesh(made / "lps.stl")
        write_mesh(mesh.moved(mesh.vertices / 10 - [1.5, -20, 3]), made / "l.ply", unit="cm", frame="local:1.5,-20.0,3")
        write_mesh(mesh, made / "u.ply", frame="unknown")
        assert checked(made, "l.ply", "u.ply", capsys)["max_mm"] < 1e-9
        write_mesh(mesh, made / "odd.ply", frame="local:1,2")
        assert checked(made, "odd.ply", "u.ply", capsys)["max_mm"] < 1e-9

    def test_a_mesh_without_a_frame_is_taken_for_lps_and_told(self, made: Path, capsys: CaptureFixture[str]) -> None:
        mesh = read_mesh(made / "ras.stl")
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(made / "other.stl")
        found = checked(made, "other.stl", "labels.nii", capsys, "--select", "5")
        assert found["dice"] < 0.5
        assert "--mesh-frame" in found["against"]["notes"][0]
        found = checked(made, "other.stl", "labels.nii", capsys, "--select", "5", "--mesh-frame", "ras")
        assert found["dice"] > size(0.98, 0.9)
        assert found["against"]["notes"] == []
        assert checked(made, "other.stl", "ras.stl", capsys)["max_mm"] < 1e-9

    def test_the_table(self, made: Path, capsys: CaptureFixture[str]) -> None:
        line = ["check", str(made / "lps.stl"), "--against", str(made / "labels.nii"), "--select", "5"]
        assert main(line) == 0
        told = capsys.readouterr().out.splitlines()
        start = next(n for n, text in enumerate(told) if text.startswith("against   the labels: Dice "))
        assert told[start + 1].split() == ["distance", "mean", "95", "%", "largest"]
        for row, name in zip(told[start + 2 : start + 4], ("to the labels", "from the labels"), strict=True):
            assert name in row
            numbers = [float(word) for word in row.split()[3:]]
            assert len(numbers) == 3
            assert numbers == sorted(numbers)

    def test_options_of_a_study_without_one(self, made: Path, capsys: CaptureFixture[str]) -> None:
        fails(["check", str(made / "lps.stl"), "--select", "5"], 2, capsys)
        fails(["check", str(made / "lps.stl"), "--against", str(made / "ras.stl"), "--lower", "5"], 2, capsys)
        fails(["check", str(made / "lps.stl"), "--against", str(made / "labels.nii")], 2, capsys)
        fails(["check", str(made / "lps.stl"), "--against", str(made / "none.nii.gz")], 3, capsys)


@pytest.mark.skipif(not COMPILED, reason="a whole study takes minutes without the compiler")
def test_labels_of_a_body_are_followed_by_even_triangles_of_32_bits(
    tmp_path: Path, capsys: CaptureFixture[str]
) -> None:
    """Finite elements want no slivers."""
    labels = str(shared("totalsegmentator/example_seg_dicom.nii.gz"))
    line = ["--select", "20", "--network", "none", "-o", str(tmp_path / "m.stl"), "--quiet"]
    assert main(["reconstruct", "--labels-in", labels, *line]) == 0
    judge = trimesh.load(tmp_path / "m.stl")
    assert judge.is_volume
    assert np.rad2deg(judge.face_angles.min()) > 20
    assert judge.edges_unique_length.min() > 0.2
    found = checked(tmp_path, "m.stl", labels, capsys, "--select", "20")
    assert found["dice"] > 0.99
    assert found["p95_mm"] < 1
    assert found["max_mm"] < 2
