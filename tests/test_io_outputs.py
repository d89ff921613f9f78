"""Outputs: whole or not there; reports and settings; the doors that open before any work."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tomomesh.errors import FormatError, OutputError, UnreadableError, UsageError
from tomomesh.io import check_output, read_settings, replacing, write_document, write_settings
from tomomesh.io.files.source import existing, suffix_of
from tomomesh.settings import Settings

if TYPE_CHECKING:
    from pathlib import Path


class TestReplacing:
    def test_the_new_file_takes_the_place_of_the_old(self, tmp_path: Path) -> None:
        (tmp_path / "a").write_text("old")
        with replacing(tmp_path / "a") as file:
            file.write(b"new")
            assert (tmp_path / "a").read_text() == "old"
        assert (tmp_path / "a").read_text() == "new"
        assert [path.name for path in tmp_path.iterdir()] == ["a"]

    @pytest.mark.parametrize("fault", [ValueError, KeyboardInterrupt, SystemExit])
    def test_whatever_is_raised_inside_leaves_the_old_file(self, tmp_path: Path, fault: type[BaseException]) -> None:
        (tmp_path / "a").write_text("old")

        def interrupted() -> None:
            with replacing(tmp_path / "a") as file:
                file.write(b"half")
                raise fault

        with pytest.raises(fault):
            interrupted()
        assert (tmp_path / "a").read_text() == "old"
        assert [path.name for path in tmp_path.iterdir()] == ["a"]

    def test_a_full_disk_is_an_output_error(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def full(handle: int) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(OutputError, match="no space left"), replacing(tmp_path / "a") as file:
            file.write(b"new")
        assert list(tmp_path.iterdir()) == []

    def test_killed_at_any_moment_the_old_file_is_whole(self, tmp_path: Path) -> None:
        (tmp_path / "a").write_text("old")
        script = (
            "import os, signal, sys\nfrom tomomesh.io.files.atomic import replacing\n"
            "with replacing(sys.argv[1]) as file:\n"
            "    file.write(b'half'); file.flush(); os.kill(os.getpid(), signal.SIGKILL)\n"
        )
        done = subprocess.run([sys.executable, "-c", script, str(tmp_path / "a")], check=False)
        assert done.returncode == -9
        assert (tmp_path / "a").read_text() == "old"

    def test_a_link_stays_a_link(self, tmp_path: Path) -> None:
        (tmp_path / "real").write_text("old")
        (tmp_path / "link").symlink_to(tmp_path / "real")
        with replacing(tmp_path / "link") as file:
            file.write(b"new")
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "real").read_text() == "new"

    def test_a_missing_folder_is_an_output_error(self, tmp_path: Path) -> None:
        with pytest.raises(OutputError), replacing(tmp_path / "none" / "a"):
            pass


class TestCheckOutput:
    def test_good_outputs_pass(self, tmp_path: Path) -> None:
        check_output(tmp_path / "a b ö.STL", {".stl"}, inputs=[tmp_path / "b.nii"])
        check_output(tmp_path / "a.nii.gz", (".nii", ".nii.gz"))
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize("name", ["a.foo", "a", "a.gz", ".stl"])
    def test_unknown_suffixes_are_usage_errors(self, tmp_path: Path, name: str) -> None:
        with pytest.raises(UsageError, match="suffix"):
            check_output(tmp_path / name, (".stl", ".nii.gz"))

    def test_the_input_is_never_the_output(self, tmp_path: Path) -> None:
        (tmp_path / "a.ply").write_text("x")
        (tmp_path / "b.ply").symlink_to(tmp_path / "a.ply")
        for name in ("a.ply", "b.ply", "./a.ply"):
            with pytest.raises(UsageError, match="input"):
                check_output(tmp_path / name, {".ply"}, inputs=[tmp_path / "a.ply"])

    def test_folders_that_cannot_hold_the_output(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (tmp_path / "file").write_text("x")
        (tmp_path / "d.ply").mkdir()
        for name in ("none/a.ply", "file/a.ply", "d.ply"):
            with pytest.raises(OutputError):
                check_output(tmp_path / name, {".ply"})
        monkeypatch.setattr(os, "access", lambda path, mode: False)  # root may write everywhere
        with pytest.raises(OutputError, match="may not be written"):
            check_output(tmp_path / "a.ply", {".ply"})


class TestPaths:
    def test_what_is_not_there_or_no_file(self, tmp_path: Path) -> None:
        (tmp_path / "loop").symlink_to(tmp_path / "loop")
        os.mkfifo(tmp_path / "pipe")
        for name in ("none", "none/deeper"):
            with pytest.raises(UnreadableError, match="none"):
                existing(tmp_path / name)
        for name in ("loop", "pipe", "\0"):
            with pytest.raises(FormatError):
                existing(tmp_path / name)
        with pytest.raises(FormatError):
            existing("/dev/null")

    def test_what_may_not_be_read(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (tmp_path / "a").write_text("x")
        monkeypatch.setattr(os, "access", lambda path, mode: False)
        with pytest.raises(UnreadableError, match="permission"):
            existing(tmp_path / "a")

    @pytest.mark.parametrize(
        ("name", "suffix"),
        [
            ("a.nii.gz", ".nii.gz"),
            ("A.NII.GZ", ".nii.gz"),
            ("a.b.STL", ".stl"),
            ("a", ""),
            ("a.1.2.3", ".3"),
            ("x.gz", ".gz"),
        ],
    )
    def test_suffixes(self, name: str, suffix: str) -> None:
        assert suffix_of(name) == suffix


class TestDocuments:
    def test_reports_are_plain_json(self, tmp_path: Path) -> None:
        data = {
            "z": np.float64(0.1),
            "a": {"count": np.int64(3), "none": None, "nan": float("nan"), "inf": np.float32(np.inf)},
            "list": (1, np.array([[1.5, np.nan]]), True),
            "text": "Größe",
        }
        write_document(data, tmp_path / "r.json")
        raw = (tmp_path / "r.json").read_bytes()

        def refuse(word: str) -> Any:
            raise AssertionError(word)

        back = json.loads(raw, parse_constant=refuse)
        assert back == {
            "z": 0.1,
            "a": {"count": 3, "none": None, "nan": None, "inf": None},
            "list": [1, [[1.5, None]], True],
            "text": "Größe",
        }
        assert list(back) == list(data)
        assert raw.endswith(b"}\n")
        assert b'\n  "z": 0.1' in raw

    @pytest.mark.parametrize(
        "settings",
        [
            Settings(),
            Settings.for_paper(),
            Settings().replace(cell_mm=(1.0, 2.0, 3.0), preset="bone", series=3),
        ],
    )
    def test_settings_survive_their_file(self, tmp_path: Path, settings: Settings) -> None:
        write_settings(settings, tmp_path / "s.toml")
        assert read_settings(tmp_path / "s.toml") == settings

    @pytest.mark.parametrize(
        ("text", "error"),
        [
            ("[network\n", FormatError),
            ("[network]\nneurons = 2\n", UsageError),
            ("[none]\na = 1\n", UsageError),
        ],
    )
    def test_settings_that_are_wrong_are_refused(self, tmp_path: Path, text: str, error: type[Exception]) -> None:
        (tmp_path / "s.toml").write_text(text)
        with pytest.raises(error):
            read_settings(tmp_path / "s.toml")
        (tmp_path / "s.toml").write_bytes(b"\xff")
        with pytest.raises(FormatError, match="no text"):
            read_settings(tmp_path / "s.toml")

    @pytest.mark.parametrize("value", ["1" * 5000, "[" * 9000, "="])
    def test_settings_that_toml_cannot_be(self, tmp_path: Path, value: str) -> None:
        (tmp_path / "s.toml").write_text(f"[run]\nseed = {value}\n")
        with pytest.raises(FormatError, match="settings cannot be read"):
            read_settings(tmp_path / "s.toml")

    def test_importing_the_readers_loads_none_of_the_libraries(self) -> None:
        heavy = {"nibabel", "pydicom", "trimesh", "PIL", "scipy", "numba", "matplotlib"}
        heavy |= {"laspy", "pye57", "pypcd4", "pydantic", "tifffile", "imagecodecs", "zarr"}
        script = f"import sys, tomomesh.io; print(sorted({heavy} & set(sys.modules)))"
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "[]"
