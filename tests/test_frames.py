"""Frames that a study's mesh and points are written in, read back by somebody else and carried to where they were."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import nibabel
import numpy as np
import pytest
import trimesh
from nibabel.affines import apply_affine

from studies import affine_of, rotation, write_nifti
from test_cli import fails
from test_end_to_end import ball
from tomomesh.cli import main

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from numpy.typing import NDArray

AFFINES = {
    "mirrored": affine_of(rotation(0.3, 0.1, -0.2) @ np.diag([-1.0, 1.0, 1.0]), (1.0, 1.2, 0.9)),
    "sagittal": affine_of(np.array([[0.0, 0, 1], [1, 0, 0], [0, -1, 0]]), (1.0, 1.2, 0.9)),
    "sheared": affine_of(np.array([[1.0, 0, 0], [0, 1, 0.3], [0, 0, 0.95]]), (1.0, 1.2, 0.9)),
}
RAS = np.diag([-1.0, -1.0, 1.0])
NEAR = 1e-3


def write(folder: Path, affine: NDArray[np.float64], frame: str, name: str, *more: str) -> Path:
    study, output = folder / "ball.nii", folder / name
    write_nifti(study, ball(), affine)
    asked = ["--lower", "50", "--network", "none", "--frame", frame, "--quiet", *more]
    assert main(["reconstruct", str(study), "-o", str(output), *asked]) == 0
    return output


def loaded(path: Path) -> trimesh.Trimesh:
    return trimesh.load(path, process=False, force="mesh")


@pytest.mark.parametrize("name", sorted(AFFINES))
class TestMesh:
    def test_every_frame_leads_back_to_the_same_places(self, tmp_path: Path, name: str) -> None:
        lps, ras, voxel = (loaded(write(tmp_path, AFFINES[name], frame, f"{frame}.ply"))
                           for frame in ("lps", "ras", "voxel"))  # fmt: skip
        study = nibabel.load(tmp_path / "ball.nii")
        assert np.abs(ras.vertices @ RAS - lps.vertices).max() < NEAR
        assert np.abs(apply_affine(study.affine, voxel.vertices) - ras.vertices).max() < NEAR
        for one in (lps, ras, voxel):
            assert one.is_watertight
            assert one.volume > 0

    def test_voxel_indices_lie_where_the_file_has_its_levels(self, tmp_path: Path, name: str) -> None:
        voxel = loaded(write(tmp_path, AFFINES[name], "voxel", "voxel.stl"))
        levels = np.asarray(nibabel.load(tmp_path / "ball.nii").dataobj)
        inside = np.argwhere(levels > 50)
        assert np.abs(voxel.vertices.min(axis=0) - inside.min(axis=0)).max() <= 1.0
        assert np.abs(voxel.vertices.max(axis=0) - inside.max(axis=0)).max() <= 1.0

    def test_gifti_is_in_ras_whatever_is_asked(self, tmp_path: Path, name: str) -> None:
        lps, ras = (
            nibabel.load(write(tmp_path, AFFINES[name], frame, f"{frame}.gii")).agg_data("pointset")
            for frame in ("lps", "ras")
        )
        there = loaded(write(tmp_path, AFFINES[name], "ras", "ras.ply")).vertices
        assert np.array_equal(lps, ras)
        assert np.abs(ras - there).max() < NEAR

    def test_glb_stands_where_it_did(self, tmp_path: Path, name: str) -> None:
        lps, ras = (loaded(write(tmp_path, AFFINES[name], frame, f"{frame}.glb")) for frame in ("lps", "ras"))
        assert np.abs(lps.vertices - ras.vertices).max() < NEAR / 1000


class TestNames:
    @pytest.mark.parametrize(("frame", "unit", "told"), [
        ("lps", "mm", "LPS"), ("ras", "mm", "RAS"), ("voxel", "voxel", "voxel"),
    ])  # fmt: skip
    def test_file_and_report_name_unit_and_frame(self, tmp_path: Path, frame: str, unit: str, told: str) -> None:
        points, report = tmp_path / "points.ply", tmp_path / "report.json"
        more = ["--points", str(points), "--report", str(report)]
        output = write(tmp_path, AFFINES["mirrored"], frame, "mesh.stl", *more)
        head = f"unit={unit} frame={told}".encode()
        assert head in output.read_bytes()[:80]
        assert head in points.read_bytes()[:200]
        assert json.loads(report.read_text())["written"] == {"unit": unit, "frame": told}

    def test_gifti_is_told_as_ras(self, tmp_path: Path) -> None:
        report = tmp_path / "report.json"
        write(tmp_path, AFFINES["mirrored"], "lps", "mesh.gii", "--report", str(report))
        assert json.loads(report.read_text())["written"] == {"unit": "mm", "frame": "RAS"}

    def test_points_of_stage_one_are_carried_too(self, tmp_path: Path) -> None:
        study = write_nifti(tmp_path / "ball.nii", ball(), AFFINES["mirrored"])
        found: dict[str, NDArray[np.float64]] = {}
        for frame in ("ras", "voxel"):
            output = tmp_path / f"{frame}.csv"
            assert main(["segment", str(study), "-o", str(output), "--lower", "50", "--frame", frame, "--quiet"]) == 0
            found[frame] = np.loadtxt(output, delimiter=",", skiprows=1)[:, :3]
        there = apply_affine(nibabel.load(study).affine, found["voxel"])
        assert np.abs(there - found["ras"]).max() < NEAR


class TestRefused:
    @pytest.mark.parametrize("suffix", ["gii", "3mf"])
    def test_voxel_indices_in_formats_of_lengths(
        self, tmp_path: Path, suffix: str, capsys: CaptureFixture[str]
    ) -> None:
        study, output = write_nifti(tmp_path / "ball.nii", ball(), np.eye(4)), tmp_path / f"mesh.{suffix}"
        fails(["reconstruct", str(study), "-o", str(output), "--frame", "voxel"], 2, capsys)
        assert not output.exists()

    @pytest.mark.parametrize("by", ["option", "file"])
    def test_frames_of_clouds(self, tmp_path: Path, by: str, capsys: CaptureFixture[str]) -> None:
        cloud, asked = tmp_path / "cloud.xyz", tmp_path / "settings.toml"
        np.savetxt(cloud, np.random.default_rng(0).normal(size=(50, 3)))
        asked.write_text('[run]\nframe = "ras"\n')
        more = ["--frame", "ras"] if by == "option" else ["--settings", str(asked)]
        fails(["surface", str(cloud), "-o", str(tmp_path / "mesh.ply"), *more], 2, capsys)
