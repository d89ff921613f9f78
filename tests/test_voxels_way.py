"""The window's own boundary as a way: from a study to a surface, through the library and the command line."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import nibabel
import numpy as np
import pytest
import trimesh

from conftest import size
from isosurfaces import ball, cubes_marched, mean_turn
from studies import shared, write_nifti
from tomomesh.cli import main
from tomomesh.io import read_mesh, read_points, read_volume
from tomomesh.isosurface.voxels import boundary
from tomomesh.measure.report import compare
from tomomesh.measure.topology import topology
from tomomesh.model.points import CROSSING
from tomomesh.pipeline import reconstruct, segment

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.results import Surface

    Floats = NDArray[np.float64]


class TestWay:
    """From a study to a surface, through `reconstruct` and the command line."""

    def test_a_study_gives_points_and_a_surface(self) -> None:
        surface = reconstruct(ball(8), lower=0.0, network="none")
        report, stage_one = surface.report, surface.segmentation
        assert stage_one is not None
        assert report["voxels"] == {
            "added_for_composition": 0, "interpolated": True, "divided_into": 1, "split_in_four": 0,
        }  # fmt: skip
        assert report["surface"]["square_faces"] == report["points"]["measured"] == len(surface.points)
        assert report["surface"]["enclosed_cubes"] == np.count_nonzero(stage_one.mask) == (stage_one.labels == 1).sum()
        assert report["fit"]["converged"]
        assert report["quality"]["points_to_surface_mean_mm"] < 0.1 / 8
        assert surface.cuberille.triangulated().face_volumes.sum() == pytest.approx(stage_one.mask.sum() / 8**3)
        assert not surface.cap_faces.any()

    def test_faces_are_filled_over_which_the_study_is_cut_off(self) -> None:
        """Of a ball that the first slice halves they are the disk there, and nothing beside it."""
        whole = ball(16)
        half = replace(whole, voxels=whole.voxels[len(whole.voxels) // 2 :])
        surface = reconstruct(half, lower=0.0, way="voxels", remesh=False)
        areas, filled = surface.mesh.face_areas, surface.cap_faces
        heights = surface.mesh.corners[:, :, 2].mean(axis=1)
        assert areas[filled].sum() == pytest.approx(np.pi, rel=0.03)  # its edge is rounded
        assert heights[filled].max() < heights[~filled].min()

    def test_every_key_of_its_report_is_documented(self) -> None:
        page = (Path(__file__).parents[1] / "docs" / "report.md").read_text(encoding="utf-8")
        described = set(re.findall(r"^\| `([a-z_]+\.[a-z0-9_]+)` \|", page, re.MULTILINE))
        report = reconstruct(ball(6), lower=0.0, network="none").report
        sections = {name: found for name, found in report.items() if name not in ("settings", "warnings")}
        assert {f"{name}.{key}" for name, found in sections.items() for key in found} <= described

    def test_the_plane_of_the_slices_does_not_move_the_surface(self) -> None:
        made = [
            reconstruct(ball(6), lower=0.0, network="none", slices=plane, remesh=False)
            for plane in ("axial", "sagittal")
        ]
        one, other = (np.round(surface.mesh.vertices, 9) + 0.0 for surface in made)
        np.testing.assert_array_equal(one[np.lexsort(one.T)], other[np.lexsort(other.T)])
        assert all(topology(surface.mesh).sound for surface in made)

    def test_cavities_are_kept_unless_the_outer_surfaces_are_asked_for(self) -> None:
        both = reconstruct(ball(8), lower=0.0, upper=0.5, network="none")
        outer = reconstruct(ball(8), lower=0.0, upper=0.5, network="none", surface="outer")
        assert (both.report["surface"]["found"], both.report["surface"]["cavities"]) == (2, 1)
        assert (outer.report["surface"]["found"], outer.report["surface"]["cavities"]) == (1, 0)
        assert both.mesh.face_volumes.sum() < outer.mesh.face_volumes.sum()

    def test_stage_one_alone_gives_the_crossings(self) -> None:
        found = segment(ball(8), lower=0.0, network="none")
        assert (found.points.kinds == CROSSING).all()
        assert np.abs(np.sqrt((found.points.positions**2).sum(axis=1)) - 1).max() < 0.01

    @pytest.mark.parametrize(("divide", "near"), [(False, 0.1 * 1.25), (True, 0.05 * 4)])
    def test_of_a_ct_bone_is_where_marching_cubes_have_it(self, divide: bool, near: float) -> None:
        """Between thick slices marching cubes are no truth: what was made into slabs lies nearer divided (docs)."""
        study = read_volume(shared("dicom2stl/ct_example.nii.gz"))
        surface = reconstruct(study, preset="bone", way="voxels", divide=divide)
        other = cubes_marched(study, 300.0)
        apart = compare(surface.mesh, other)
        assert max(apart["mean_mm"], apart["back_mean_mm"]) < near
        assert mean_turn(surface.mesh) < mean_turn(other)
        assert surface.report["quality"]["sound_after_welding"]

    def test_the_command_line_writes_all_of_it(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        volume = ball(size(9, 6), (1.0, 1.0, 2.0))
        stored = np.round(1000 * volume.voxels).astype(np.int16)
        study = write_nifti(tmp_path / "ball.nii", stored, volume.affine)
        names = {"points": "points.ply", "labels": "labels.nii.gz", "report": "report.json", "figures": "pictures"}
        further = [word for name, file in names.items() for word in (f"--{name}", str(tmp_path / file))]
        mesh = tmp_path / "mesh.stl"
        words = ["reconstruct", str(study), "-o", str(mesh), "--lower", "0", "--network", "none", *further]
        assert main(words) == 0
        told = capsys.readouterr().out.splitlines()
        assert any(line.startswith("voxels ") for line in told)
        assert not any(line.startswith("networks ") for line in told)
        judged = trimesh.load(mesh)
        assert judged.is_watertight
        assert judged.is_winding_consistent
        assert judged.volume == pytest.approx(4 / 3 * np.pi, rel=0.02)
        report = json.loads((tmp_path / "report.json").read_text())
        assert len(read_points(tmp_path / "points.ply")) == report["points"]["count"]
        labels = np.asarray(nibabel.load(tmp_path / "labels.nii.gz").dataobj)
        np.testing.assert_array_equal(labels, (stored.T > 0).astype(np.uint16))
        assert {path.stem for path in (tmp_path / "pictures").iterdir()} >= {"04-window", "07-points", "10-shaded"}

    def test_so_does_stage_one(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        volume = ball(6)
        study = write_nifti(tmp_path / "ball.nii", np.round(1000 * volume.voxels).astype(np.int16), volume.affine)
        target = tmp_path / "points.csv"
        assert main(["segment", str(study), "-o", str(target), "--lower", "0", "--network", "none"]) == 0
        assert len(read_points(target)) == len(boundary(volume, volume.voxels > 0.0005, lower=0.0).net.quads)
        assert "points " in capsys.readouterr().out


def test_a_mesh_survives_its_file(tmp_path: Path) -> None:
    from tomomesh import write_mesh

    made: Surface = reconstruct(ball(6), lower=0.0, network="none")
    write_mesh(made.mesh, tmp_path / "mesh.stl")
    assert topology(read_mesh(tmp_path / "mesh.stl")).sound
