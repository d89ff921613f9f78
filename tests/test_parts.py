"""Unit and frame of parts to print: those that files of tomomesh state are believed, and only true ones are stated."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import nibabel
import numpy as np
import pytest
import trimesh

from conftest import COMPILED
from studies import write_nifti
from test_cli import fails
from test_end_to_end import ball
from tomomesh import io
from tomomesh.cli import main
from tomomesh.model.mesh import TriMesh

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture

pytestmark = pytest.mark.skipif(not COMPILED, reason="distances on a grid take minutes without the compiler")

CONE = trimesh.creation.cone(5, 20).apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0)))
"""Its base lies at y = 0, its tip at y = -20."""
STATING = ["stl", "ply", "obj"]
"""Kinds that state unit and frame, and are read: a plain OFF states neither."""


def write(folder: Path, kind: str, unit: str, frame: str) -> str:
    path = folder / f"mesh.{kind}"
    io.write_mesh(TriMesh(np.array(CONE.vertices), np.array(CONE.faces)), path, unit=unit, frame=frame)
    return str(path)


def printed(mesh: str, *options: str, name: str = "part.ply") -> trimesh.Trimesh:
    part = mesh.rpartition("/")[0] + "/" + name
    assert main(["print", mesh, "-o", part, "--quiet", *options]) == 0
    return trimesh.load(part)


@pytest.mark.parametrize("kind", STATING)
def test_what_a_file_states_is_read_back(tmp_path: Path, kind: str) -> None:
    assert io.frame_of_file(write(tmp_path, kind, "cm", "RAS")) == {"unit": "cm", "frame": "RAS"}
    CONE.export(tmp_path / f"other.{kind}")
    assert io.frame_of_file(tmp_path / f"other.{kind}") == {}


@pytest.mark.parametrize("kind", STATING)
def test_a_mesh_in_centimeters_is_printed_in_millimeters(tmp_path: Path, kind: str) -> None:
    mesh = write(tmp_path, kind, "cm", "unknown")
    assert printed(mesh, "--scale", "1.5").extents == pytest.approx([150, 300, 150])
    assert printed(mesh, "--units", "m").extents == pytest.approx([10000, 20000, 10000])


def test_check_judges_it_in_millimeters_too(tmp_path: Path, capsys: CaptureFixture[str]) -> None:
    assert main(["check", write(tmp_path, "ply", "cm", "unknown"), "--print", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["print"]["size_mm"] == pytest.approx([100, 200, 100])


def test_a_mesh_of_voxel_indices_has_no_size(tmp_path: Path, capsys: CaptureFixture[str]) -> None:
    fails(["print", write(tmp_path, "ply", "voxel", "voxel"), "-o", str(tmp_path / "part.ply")], 5, capsys)
    assert not (tmp_path / "part.ply").exists()


@pytest.mark.parametrize(("frame", "lowest"), [("LPS", -15), ("RAS", -20), ("unknown", -15)])
def test_front_is_the_front_in_either_frame(tmp_path: Path, frame: str, lowest: float) -> None:
    pytest.importorskip("manifold3d", reason="the extra print is not installed")
    part = printed(write(tmp_path, "ply", "mm", frame), "--flat-base", "5", "--down", "anterior")
    assert part.bounds[:, 1] == pytest.approx([lowest, lowest + 15])


@pytest.mark.parametrize(("frame", "scale", "told"), [
    ("LPS", "1", "LPS"), ("RAS", "1", "RAS"), ("LPS", "2", "unknown"), ("RAS", "0.5", "unknown"),
    ("local:1,2,3", "1", "unknown"),
])  # fmt: skip
def test_a_patient_s_frame_is_kept_at_its_own_size_alone(tmp_path: Path, frame: str, scale: str, told: str) -> None:
    report = tmp_path / "report.json"
    printed(write(tmp_path, "ply", "cm", frame), "--scale", scale, "--report", str(report))
    assert io.frame_of_file(tmp_path / "part.ply") == {"unit": "mm", "frame": told}
    assert json.loads(report.read_text())["written"] == {"unit": "mm", "frame": told}


@pytest.mark.parametrize(("scale", "frame", "space"), [("1", "RAS", 1), ("0.5", "unknown", 0)])
def test_a_scaled_part_of_a_study_is_in_no_scanner_s_frame(tmp_path: Path, scale: str, frame: str, space: int) -> None:
    study, report = write_nifti(tmp_path / "ball.nii", ball(), np.diag([1.0, 1.2, 0.9, 1])), tmp_path / "report.json"
    for name in ("part.gii", "part.ply"):
        options = ["--lower", "50", "--network", "none", "--frame", "ras", "--scale", scale, "--print-check"]
        line = ["reconstruct", str(study), "-o", str(tmp_path / name), *options, "--report", str(report), "--quiet"]
        assert main(line) == 0
        assert json.loads(report.read_text())["written"] == {"unit": "mm", "frame": frame}
    array = nibabel.load(tmp_path / "part.gii").darrays[0]
    assert array.coordsys.dataspace == space
    assert np.abs(array.data - trimesh.load(tmp_path / "part.ply", process=False).vertices).max() < 1e-3
