"""Studies slab by slab: the bytes, the report and the errors of the run in memory."""

from __future__ import annotations

import json
import shutil
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from slab_studies import MEMORY, blobs, same
from studies import write_nifti
from tomomesh import Volume, read_mesh, reconstruct
from tomomesh.cli import main
from tomomesh.errors import UsageError
from tomomesh.judgement import LIMITS, Limits
from tomomesh.large import LargeSurface, reconstruct_large
from tomomesh.segmentation.study import lay_out, select_in
from tomomesh.settings import Settings
from tomomesh.ways.choice import known_way, take_way

if TYPE_CHECKING:
    from pathlib import Path

LEFT_OUT = {"timings", "settings", "versions", "written", "slabs"}
APART = {"points_to_surface", "vertices_to_points"}
"""What is not measured of a mesh that is never whole begins with one of these."""


class TestSame:
    @law(25)
    @given(seeds, st.integers(1, 30), st.sampled_from(["gray", "otsu", "labels", "outer", "color"]))
    def test_bytes_for_any_slabs(self, seed: int, slab: int, kind: str) -> None:
        levels: Any = blobs(seed)
        asked: dict[str, Any] = {"way": "voxels", **MEMORY}
        if kind == "labels":
            levels, asked = (levels > 30).astype(np.int16), asked | {"select": (1,)}
        elif kind == "color":
            levels = np.stack([levels, np.roll(levels, 1, 0), levels], axis=3).clip(0, 255).astype(np.uint8)
        else:
            windows: dict[str, dict[str, Any]] = {
                "gray": {"lower": 20}, "otsu": {}, "outer": {"lower": 20, "surface": "outer"},
            }  # fmt: skip
            asked |= windows[kind]
        study = Volume.from_stored(levels, np.diag([0.7, 0.8, 0.9, 1.0]))
        assert same(reconstruct_large(study, slab=slab, **asked), reconstruct(study, **asked))

    def test_the_report(self) -> None:
        study = Volume.from_stored(blobs(3), np.eye(4))
        large = reconstruct_large(study, slab=5, lower=20, way="voxels", **MEMORY).report
        whole = reconstruct(study, lower=20, way="voxels", **MEMORY).report
        for section in whole.keys() - LEFT_OUT - {"points", "quality", "warnings"}:
            assert large[section] == whole[section], section
        quality = {name: value for name, value in large["quality"].items() if name != "per_component"}
        assert quality.items() <= whole["quality"].items()
        missing = {name for name in whole["quality"].keys() - quality.keys() if not name.startswith((*APART,))}
        assert missing == {"per_component"}
        assert large["points"].items() <= whole["points"].items()
        assert large["slabs"] == {"count": 5}

    @pytest.mark.parametrize("contours", ["loops", "components"])
    def test_how_far_rings_are_from_their_window(self, contours: str) -> None:
        study = Volume.from_stored(blobs(7), np.eye(4))
        large = reconstruct_large(study, slab=6, lower=20, contours=contours, **MEMORY)
        whole = reconstruct(study, lower=20, contours=contours, **MEMORY)
        assert isinstance(large, LargeSurface)
        assert large.report["quality"]["follows"] == whole.report["quality"]["follows"]

    @pytest.mark.parametrize("way", ["ring", "contours", "voxels"])
    def test_files_of_every_way_read_slab_by_slab(self, way: str, tmp_path: Path) -> None:
        k, j, i = np.ogrid[:24, :30, :30]
        ball = (100 - 8 * np.sqrt((k - 11.5) ** 2 + (j - 14.5) ** 2 + (i - 14.5) ** 2)).astype(np.int16)
        write_nifti(tmp_path / "ball.nii", ball, np.eye(4))
        line = ["reconstruct", str(tmp_path / "ball.nii"), "--lower", "20", "--way", way, "--quiet"]
        plain = ["--no-remesh", "--no-divide"]
        assert main([*line, *plain, "-o", str(tmp_path / "whole.ply")]) == 0
        for options in (["--slab", "5"], ["--memory", "1GB"]):
            assert main([*line, *plain, *options, "-o", str(tmp_path / "slabs.ply")]) == 0
            assert (tmp_path / "slabs.ply").read_bytes() == (tmp_path / "whole.ply").read_bytes()

    @pytest.mark.parametrize("way", ["contours", "voxels"])
    def test_files_of_a_study_that_is_cut_off(self, way: str, tmp_path: Path) -> None:
        """Of which faces are marked as filled, as far as its way has any."""
        write_nifti(tmp_path / "a.nii", blobs(2), np.diag([-0.7, 0.8, 0.9, 1.0]))
        line = ["reconstruct", str(tmp_path / "a.nii"), "--lower", "20", "--way", way, "--quiet"]
        plain = ["--no-remesh", "--no-divide"]
        assert main([*line, *plain, "-o", str(tmp_path / "whole.ply")]) == 0
        whole = (tmp_path / "whole.ply").read_bytes()
        assert (b"property uchar filled" in whole) == (way == "voxels")
        for slab in ("1", "5", "30"):
            assert main([*line, "--slab", slab, "-o", str(tmp_path / "slabs.ply")]) == 0
            assert (tmp_path / "slabs.ply").read_bytes() == whole

    def test_files_that_weld(self, tmp_path: Path, folder: Path) -> None:
        write_nifti(tmp_path / "a.nii", blobs(1), np.eye(4))
        line = ["reconstruct", str(tmp_path / "a.nii"), "--lower", "20", "--way", "voxels", "--quiet", "--slab", "4"]
        assert main([*line, "-o", str(folder / "whole.ply")]) == 0
        assert main([*line, "-o", str(folder / "part.ply"), "--pieces", "3", "--report", str(folder / "r.json")]) == 0
        parts = [read_mesh(folder / f"part-{n:03d}.ply") for n in (1, 2, 3)]
        whole = read_mesh(folder / "whole.ply")
        assert sum(len(part.faces) for part in parts) == len(whole.faces)
        places = np.concatenate([part.vertices for part in parts])
        assert len(np.unique(places, axis=0)) == len(whole.vertices)
        told = json.loads((folder / "r.json").read_text())["written"]["files"]
        assert told == ["part-001.ply", "part-002.ply", "part-003.ply", "part-pieces.json"]


@pytest.fixture
def unread(monkeypatch: pytest.MonkeyPatch) -> Volume:
    """Return a study of which nothing can be read."""

    def read(*args: Any, **named: Any) -> None:
        raise AssertionError("the study was read")

    monkeypatch.setattr("tomomesh.large.lay_out", read)
    return Volume.from_stored(blobs(0), np.eye(4))


class TestFaults:
    @pytest.mark.parametrize(
        ("options", "code", "said"),
        [
            (["--slab", "0"], 2, "a slab has a slice. Found: [--slab 0]"),
            (["--workers", "0"], 2, "there must be a worker. Found: [--workers 0]"),
            (["--memory", "4 rooms"], 2, "that is no limit of the memory"),
            (["--slab", "4", "--figures", "f"], 2, "this needs the study whole. Found: [--figures, and"),
            (["--slab", "4", "--smooth", "2"], 2, "this needs the whole mesh at once. Found: [--smooth"),
            (["--slab", "4", "--edge", "2"], 2, "this needs the whole mesh at once. Found: [--edge"),
            (["--slab", "4", "--hollow", "1"], 2, "a part to print"),
            (["--slab", "4", "--pieces", "0"], 2, "a mesh is written in 1 to 200 pieces"),
            (["--slab", "4", "--lower", "1e9"], 6, "the window selects nothing"),
        ],
    )
    def test_refused_in_one_line(
        self, options: list[str], code: int, said: str, tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write_nifti(tmp_path / "a.nii", blobs(0), np.eye(4))
        line = ["reconstruct", str(tmp_path / "a.nii"), "--way", "voxels", "-o", str(folder / "a.ply"), "--quiet"]
        window = [] if "--lower" in options else ["--lower", "20"]
        assert main([*line, *window, *options]) == code
        (told,) = capsys.readouterr().err.splitlines()
        assert said in told
        assert not any(folder.iterdir())

    @pytest.mark.parametrize(
        "asked",
        [
            {"way": "voxels", "smooth": 2.0}, {"network": "none", "edge": 2.0}, {"contours": "loops", "edge": 2.0},
            {"select": (1,), "target_faces": 100}, {"select": (1,), "neurons": 30, "hollow": 1.0},
            {"space": "volume", "network": "grid"},
        ],
    )  # fmt: skip
    def test_settings_are_refused_before_anything_is_read(self, asked: dict[str, Any], unread: Volume) -> None:
        with pytest.raises(UsageError, match=r"whole mesh at once|has no faces"):
            reconstruct_large(unread, slab=4, **asked)

    @pytest.mark.parametrize("asked", [{"lower": 20.0, "smooth": 2.0}, {"way": "ring", "smooth": 2.0, "lower": 20.0}])
    def test_settings_are_not_refused_that_the_window_may_allow(self, asked: dict[str, Any], unread: Volume) -> None:
        with pytest.raises(AssertionError, match="read"):
            reconstruct_large(unread, slab=4, **asked)

    @pytest.mark.parametrize(
        "asked", [{"select": (1,)}, {"select": (1,), "neurons": 30}, {"way": "ring", "lower": 0}, {"network": "sphere"}]
    )
    def test_what_settings_alone_tell_is_the_way_that_is_taken(self, asked: dict[str, Any]) -> None:
        settings = Settings().replace(**asked)
        study = lay_out(
            Volume.from_stored((blobs(5) > 20).astype(np.uint8), np.eye(4)), None, settings, labelled="select" in asked
        )
        known = known_way(settings)
        assert known is not None
        assert known.way == take_way(select_in(study, settings).value, settings).value.network.way

    def test_workers_are_not_waited_for_where_settings_are_refused(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write_nifti(tmp_path / "a.nii", blobs(0), np.eye(4))
        line = ["reconstruct", str(tmp_path / "a.nii"), "--way", "voxels", "--smooth", "2", "--lower", "20"]
        assert main([*line, "--scheduler", "tcp://127.0.0.1:1", "-o", str(tmp_path / "a.ply")]) == 2
        assert "this needs the whole mesh at once" in capsys.readouterr().err

    def test_a_mesh_that_is_far_from_its_window(
        self, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(LIMITS, "voxels", Limits(1.0, 1e-9, 1e-9))
        write_nifti(tmp_path / "a.nii", blobs(0), np.eye(4))
        line = ["reconstruct", str(tmp_path / "a.nii"), "--way", "voxels", "--lower", "20", "--quiet", "--slab", "4"]
        assert main([*line, "-o", str(folder / "a.ply")]) == 5
        assert "the mesh does not follow its window" in capsys.readouterr().err
        assert not any(folder.iterdir())
        assert main([*line, "-o", str(folder / "a.ply"), "--allow-far"]) == 0

    def test_a_format_that_is_not_written_in_parts(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        write_nifti(tmp_path / "a.nii", blobs(0), np.eye(4))
        assert main(["reconstruct", str(tmp_path / "a.nii"), "--slab", "4", "-o", str(tmp_path / "a.glb")]) == 2
        assert ".obj" in capsys.readouterr().err

    def test_a_chunk_that_is_missing(self, tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        zarr = pytest.importorskip("zarr", reason="the extra `zarr` is not installed")
        array = zarr.create_array(tmp_path / "a.zarr", shape=(24, 24, 24), chunks=(8, 8, 8), dtype=np.int16)
        array[:] = 5 + (np.indices((24, 24, 24)).sum(axis=0) % 40)
        shutil.rmtree(tmp_path / "a.zarr" / "c" / "1" / "1")
        line = ["reconstruct", str(tmp_path / "a.zarr"), "--spacing", "1", "1", "1", "--lower", "20", "--quiet"]
        assert main([*line, "--way", "voxels", "--slab", "4", "-o", str(folder / "a.ply")]) == 4
        (told,) = capsys.readouterr().err.splitlines()
        assert told.startswith("error: chunks of the array are missing")
        assert not any(folder.iterdir())

    def test_a_memory_that_holds_no_slab(self) -> None:
        """Which no mesh depends on is only how much of it there is."""
        study = Volume.from_stored(np.broadcast_to(np.int16(1), (4, 4000, 4000)), np.eye(4))
        with pytest.raises(Exception, match="the memory does not hold a slab of one slice") as caught:
            reconstruct_large(study, memory=190e6, lower=0, way="voxels")
        assert caught.value.exit_code == 7  # type: ignore[attr-defined]
