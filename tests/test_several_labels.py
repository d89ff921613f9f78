"""Several rings a slice of label maps, and from the command line."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import tomomesh
from studies import shared, write_nifti
from test_cli import fails
from test_several_surfaces import SHAPE, SPACING, places, shell, study
from tomomesh import reconstruct, segment
from tomomesh.cli import main
from tomomesh.errors import EmptyError, GeometryError, UsageError
from tomomesh.measure.report import compare
from tomomesh.model.mesh import TriMesh
from tomomesh.model.volume import Volume

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


class TestLabels:
    """Labels as the window."""

    def labels(self) -> NDArray[np.int16]:
        away = np.sqrt(sum(axis**2 for axis in places()))
        return np.select([away <= 10, away <= 16, away <= 22], [4, 515, 516], 0).astype(np.int16)

    def volume(self, affine: Floats | None = None) -> Volume:
        return Volume.from_stored(self.labels(), np.diag([*SPACING, 1.0]) if affine is None else affine)

    def test_the_study_may_be_the_label_map_itself(self) -> None:
        found = segment(self.volume(), select=(515, 516), contours="loops")
        np.testing.assert_array_equal(found.mask, self.labels() >= 515)
        assert found.report["window"]["chosen_by"] == "labels"
        assert found.report["window"]["lower"] is None

    def test_a_label_map_beside_a_study(self) -> None:
        gray = study(np.ones(SHAPE, bool))
        one = reconstruct(gray, labels=self.volume(), select=(4,))
        two = reconstruct(self.volume(), select=(4,))
        assert one.mesh.vertices.tobytes() == two.mesh.vertices.tobytes()
        assert one.report["study"]["slices"] == 16

    def test_without_networks_too(self) -> None:
        found = reconstruct(self.volume(), select=(515, 516), network="none")
        assert found.report["surface"]["cavities"] == 1
        assert found.report["quality"]["components"] == 2

    def test_any_order_of_axes(self) -> None:
        turned = Volume.from_stored(
            np.ascontiguousarray(self.labels().transpose(2, 1, 0)), np.diag([3.0, 1.0, 1.0, 1.0])[[2, 1, 0, 3]]
        )
        one, two = (segment(volume, select=(515,), contours="loops") for volume in (self.volume(), turned))
        np.testing.assert_array_equal(one.mask, two.mask)

    def test_what_is_refused(self) -> None:
        with pytest.raises(EmptyError, match=r"no such label.*7, 9.*0, 4, 515, 516"):
            segment(self.volume(), select=(4, 9, 7))
        with pytest.raises(GeometryError, match="do not fit"):
            segment(study(np.ones(SHAPE, bool)), labels=self.volume(np.diag([1.0, 1.0, 4.0, 1.0])), select=(4,))
        moved = np.diag([*SPACING, 1.0])
        moved[0, 3] = 5.5 * SPACING[0]
        with pytest.raises(GeometryError, match=r"mm off its voxels"):
            segment(study(np.ones(SHAPE, bool)), labels=self.volume(moved), select=(4,))
        with pytest.raises(UsageError, match="no label was chosen"):
            segment(study(shell()), labels=self.volume())
        with pytest.raises(UsageError, match="two windows"):
            segment(self.volume(), select=(4,), lower=0.0)
        with pytest.raises(UsageError, match="no whole numbers"):
            segment(Volume.from_stored(np.full(SHAPE, 0.5), np.eye(4)), select=(4,))

    def test_a_head_has_its_skull_its_ventricles_and_its_white_matter(self) -> None:
        volume = tomomesh.read_volume(shared("derived/dev54_synth_t1/dev54_synth_t1_labels.nii.gz"))
        found = reconstruct(volume, select=(4, 43, 14, 15), contours="loops")
        judged_ = found.report["quality"]
        assert judged_["sound"]
        assert judged_["self_intersections"] == 0
        marching = pytest.importorskip("skimage.measure").marching_cubes
        mask = np.isin(volume.voxels, (4, 43, 14, 15))
        vertices, faces, _, _ = marching(np.pad(mask, 1).astype(np.float32), 0.5)
        peer = TriMesh(volume.to_mm(vertices[:, ::-1] - 1.0), faces[:, ::-1].astype(np.int64))
        away = compare(found.mesh, peer)
        assert max(away["mean_mm"], away["back_mean_mm"]) < 0.6


class TestCommandLine:
    @pytest.fixture
    def files(self, tmp_path: Path) -> dict[str, str]:
        """A label map and a gray study on its grid."""
        affine = np.diag([*SPACING, 1.0])
        labels = TestLabels().labels()
        write_nifti(tmp_path / "labels.nii", labels, affine)
        write_nifti(tmp_path / "gray.nii", (labels > 0).astype(np.int16) * 100, affine)
        write_nifti(tmp_path / "thick.nii", labels, affine @ np.diag([1.0, 1.0, 1.5, 1.0]))
        return {name: str(tmp_path / f"{name}.nii") for name in ("labels", "gray", "thick")}

    def test_labels_become_a_surface(self, files: dict[str, str], tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        one, two, report = (str(tmp_path / name) for name in ("one.ply", "two.ply", "report.json"))
        chosen = ["--select", "515,516", "--contours", "loops", "--report", report]
        assert main(["reconstruct", files["gray"], "--labels-in", files["labels"], *chosen, "-o", one]) == 0
        said = capsys.readouterr().out
        assert "label(s) 515, 516" in said
        assert "loops on" in said
        assert main(["reconstruct", "--labels-in", files["labels"], *chosen, "-o", two, "--quiet"]) == 0
        assert (tmp_path / "one.ply").read_bytes() == (tmp_path / "two.ply").read_bytes()
        found: dict[str, Any] = json.loads((tmp_path / "report.json").read_text())
        assert found["quality"]["sound"]
        assert found["settings"]["window"]["select"] == [515, 516]

    def test_settings_are_saved_and_read(self, files: dict[str, str], tmp_path: Path) -> None:
        line = ["segment", files["labels"], "-o", str(tmp_path / "p.ply"), "--quiet"]
        more = ["--select", "4", "--contours", "loops", "--save-settings", str(tmp_path / "s.toml")]
        assert main([*line, *more]) == 0
        first = (tmp_path / "p.ply").read_bytes()
        assert main([*line, "--settings", str(tmp_path / "s.toml")]) == 0
        assert (tmp_path / "p.ply").read_bytes() == first

    def test_pictures_and_labels_are_drawn(self, files: dict[str, str], tmp_path: Path) -> None:
        line = ["segment", files["labels"], "-o", str(tmp_path / "p.csv"), "--quiet", "--select", "515,516"]
        more = ["--contours", "walls", "--figures", str(tmp_path / "f"), "--labels", str(tmp_path / "l.nii.gz")]
        assert main([*line, *more]) == 0
        assert (tmp_path / "f" / "06-network.png").exists()
        assert (tmp_path / "f" / "06-slices-1.png").exists()
        assert (tmp_path / "l.nii.gz").exists()

    def test_faults(self, files: dict[str, str], tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        mesh = str(tmp_path / "m.stl")
        line = ["reconstruct", "--labels-in", files["labels"], "-o", mesh]
        assert "0, 4, 515, 516" in fails([*line, "--select", "515,9"], 6, capsys)
        for select in ("a", "1,", "1.5", "-4"):
            assert "--select" in fails([*line, f"--select={select}"], 2, capsys)
        assert "no label was chosen" in fails(line, 2, capsys)
        assert "no study" in fails(["reconstruct", "-o", mesh], 2, capsys)
        assert "two windows" in fails([*line, "--select", "4", "--lower", "3"], 2, capsys)
        assert "--contours" in fails([*line, "--select", "4", "--contours", "all"], 2, capsys)
        assert "rings" in fails([*line, "--select", "4", "--contours", "loops", "--network", "grid"], 2, capsys)
        beside = ["reconstruct", files["thick"], "--labels-in", files["labels"], "--select", "4", "-o", mesh]
        assert "16" in fails(beside, 5, capsys)
        missing = ["reconstruct", files["gray"], "--labels-in", "nowhere.nii", "--select", "4", "-o", mesh]
        assert "nowhere.nii" in fails(missing, 3, capsys)
        assert not (tmp_path / "m.stl").exists()
