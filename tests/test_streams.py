"""Standard input and output: the same bytes as files, all or nothing, and nothing else among them."""

from __future__ import annotations

import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh

from studies import write_nifti
from test_cli import ERROR
from tomomesh.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable

OPTIONS = ["--network", "none", "--lower", "50"]
FULL = Path("/dev/full")
PROGRAM = "import sys; from tomomesh.cli import main; sys.exit(main(sys.argv[1:]))"


class Stream(io.TextIOWrapper):
    """A standard stream over bytes, which may be a terminal."""

    def __init__(self, data: bytes = b"", *, terminal: bool = False) -> None:
        super().__init__(io.BytesIO(data), encoding="utf-8")
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal

    @property
    def bytes(self) -> bytes:
        assert isinstance(self.buffer, io.BytesIO)
        return self.buffer.getvalue()


@pytest.fixture
def study(tmp_path: Path) -> Path:
    voxels = np.zeros((8, 9, 10), np.uint8)
    voxels[2:6, 2:6, 2:7] = 100
    return write_nifti(tmp_path / "s.nii", voxels, np.eye(4))


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


def until(true: Callable[[], bool]) -> bool:
    """Wait until something is true, 20 s at most."""
    end = time.monotonic() + 20
    while not (found := true()) and time.monotonic() < end:
        time.sleep(0.02)
    return found


def feed(monkeypatch: pytest.MonkeyPatch, data: bytes) -> None:
    monkeypatch.setattr(sys, "stdin", Stream(data))


class TestOut:
    @pytest.mark.parametrize("kind", ["ply", "stl", "obj"])
    def test_a_mesh_is_the_one_that_a_file_holds(
        self, kind: str, study: Path, tmp_path: Path, temporary: Path, capfdbinary: Any
    ) -> None:
        line = ["reconstruct", str(study), *OPTIONS]
        assert main([*line, "-o", str(tmp_path / f"m.{kind}"), "--quiet"]) == 0
        assert main([*line, "-o", "-", "--format", kind]) == 0
        written, said = capfdbinary.readouterr()
        assert written == (tmp_path / f"m.{kind}").read_bytes()
        assert trimesh.load(io.BytesIO(written), file_type=kind).is_watertight
        assert list(temporary.iterdir()) == []
        assert b"written   standard output" in said
        assert str(temporary).encode() not in said

    def test_points_are_written_too(self, study: Path, capfdbinary: Any) -> None:
        assert main(["segment", str(study), *OPTIONS, "-o", "-", "--format", "csv"]) == 0
        assert capfdbinary.readouterr().out.startswith(b"x_mm,y_mm,z_mm")

    def test_the_report_goes_beside_it(self, study: Path, capfdbinary: Any) -> None:
        assert main(["reconstruct", str(study), *OPTIONS, "-o", "-", "--format", "stl", "--json"]) == 0
        written, said = capfdbinary.readouterr()
        assert json.loads(said[said.index(b"{") :])["quality"]["sound"]
        assert trimesh.load(io.BytesIO(written), file_type="stl").is_watertight

    def test_nothing_is_written_where_something_fails(
        self, study: Path, monkeypatch: pytest.MonkeyPatch, temporary: Path, capfdbinary: Any
    ) -> None:
        monkeypatch.setattr("tomomesh.finish.check_promise", lambda *_, **__: 1 / 0)
        assert main(["reconstruct", str(study), *OPTIONS, "-o", "-", "--format", "stl"]) == 9
        assert capfdbinary.readouterr().out == b""
        assert list(temporary.iterdir()) == []

    def test_errors_name_the_stream_as_it_was_typed(self, tmp_path: Path, temporary: Path, capfdbinary: Any) -> None:
        cloud = tmp_path / "far.xyz"
        rng = np.random.default_rng(0)
        places = rng.normal(size=(500, 3))
        np.savetxt(cloud, places / np.linalg.norm(places, axis=1)[:, None] * 1e-3 + 1e9, fmt="%.9f")
        assert main(["surface", str(cloud), "-o", "-", "--format", "stl"]) == 8
        written, said = capfdbinary.readouterr()
        assert b"File: -" in said.splitlines()[-1]
        assert str(temporary).encode() not in said
        assert written == b""

    def test_a_terminal_gets_text_alone(self, study: Path, monkeypatch: pytest.MonkeyPatch, capfdbinary: Any) -> None:
        shown = Stream(terminal=True)
        monkeypatch.setattr(sys, "stdout", shown)
        line = ["reconstruct", str(study), *OPTIONS, "-o", "-", "--format"]
        assert main([*line, "ply"]) == 2
        assert b"> mesh.ply" in capfdbinary.readouterr().err
        assert shown.bytes == b""
        assert main([*line, "obj"]) == 0
        assert shown.bytes.startswith(b"# tomomesh")

    def test_a_format_is_needed_and_for_streams_alone(self, study: Path, tmp_path: Path, capfdbinary: Any) -> None:
        assert main(["reconstruct", str(study), "-o", "-"]) == 2
        assert b"Try: --format" in capfdbinary.readouterr().err
        assert main(["reconstruct", str(study), "-o", str(tmp_path / "m.stl"), "--format", "ply"]) == 2
        assert not (tmp_path / "m.stl").exists()


class TestIn:
    def test_a_cloud_is_the_one_that_a_file_holds(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, temporary: Path
    ) -> None:
        sphere = trimesh.creation.icosphere(3).vertices
        np.savetxt(tmp_path / "c.xyz", sphere)
        feed(monkeypatch, (tmp_path / "c.xyz").read_bytes())
        assert main(["surface", str(tmp_path / "c.xyz"), "-o", str(tmp_path / "a.ply"), "--quiet"]) == 0
        assert main(["surface", "-", "-o", str(tmp_path / "b.ply"), "--quiet"]) == 0
        assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()
        assert list(temporary.iterdir()) == []

    def test_a_study_goes_through_both_streams(
        self, study: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfdbinary: Any
    ) -> None:
        feed(monkeypatch, study.read_bytes())
        assert main(["reconstruct", "-", *OPTIONS, "-o", "-", "--format", "ply"]) == 0
        assert main(["reconstruct", str(study), *OPTIONS, "-o", str(tmp_path / "m.ply"), "--quiet"]) == 0
        assert capfdbinary.readouterr().out == (tmp_path / "m.ply").read_bytes()

    def test_other_formats_are_named(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        buffer = io.BytesIO()
        np.save(buffer, trimesh.creation.icosphere(3).vertices)
        feed(monkeypatch, buffer.getvalue())
        assert main(["surface", "-", "--input-format", "npy", "-o", str(tmp_path / "m.stl"), "--quiet"]) == 0

    def test_a_file_of_another_suffix_is_read_as_the_format_says(
        self, study: Path, tmp_path: Path, temporary: Path, capfdbinary: Any
    ) -> None:
        other = Path(shutil.copy(study, tmp_path / "a scan.dat"))
        assert main(["reconstruct", str(study), *OPTIONS, "-o", str(tmp_path / "a.ply"), "--quiet"]) == 0
        line = ["reconstruct", str(other), *OPTIONS, "--quiet", "-o", str(tmp_path / "b.ply")]
        assert main(line) == 4
        assert main([*line, "--input-format", "".join(study.suffixes)[1:]]) == 0
        assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()
        assert main([*line, "--input-format", "nrrd"]) == 4
        said = capfdbinary.readouterr().err
        assert b"a scan.dat" in said.splitlines()[-1]
        assert b"input.nrrd" not in said
        assert list(temporary.iterdir()) == []

    def test_a_folder_has_no_format(self, tmp_path: Path, capfdbinary: Any) -> None:
        assert main(["inspect", str(tmp_path), "--input-format", "dcm"]) == 2
        assert b"a format is that of one file" in capfdbinary.readouterr().err

    def test_a_cloud_of_another_suffix_too(self, tmp_path: Path) -> None:
        np.savetxt(tmp_path / "c.dat", trimesh.creation.icosphere(3).vertices)
        line = ["surface", str(tmp_path / "c.dat"), "-o", str(tmp_path / "m.stl"), "--quiet"]
        assert main([*line, "--input-format", "xyz"]) == 0

    @pytest.mark.parametrize("data", [b"", b"no numbers", b"1 2\n", b"1 2 nan\n"])
    def test_faults_are_one_line_that_names_no_temporary_file(
        self, data: bytes, monkeypatch: pytest.MonkeyPatch, temporary: Path, tmp_path: Path, capfdbinary: Any
    ) -> None:
        feed(monkeypatch, data)
        assert main(["surface", "-", "-o", str(tmp_path / "m.stl")]) == 4
        (said,) = capfdbinary.readouterr().err.decode().splitlines()
        assert ERROR.match(said)
        assert "File: -" in said
        assert str(temporary) not in said
        assert list(temporary.iterdir()) == []


@pytest.mark.skipif(not FULL.exists(), reason="this system has no /dev/full")
class TestRoom:
    @pytest.mark.parametrize("line", [
        ["--help"], ["man"], ["inspect", "s.nii"], ["inspect", "s.nii", "--json"],
        ["reconstruct", "s.nii", *OPTIONS, "-o", "m.stl"],
        ["reconstruct", "s.nii", *OPTIONS, "-o", "-", "--format", "stl"],
        ["reconstruct", ".", *OPTIONS, "--each", "-o", "out"],
    ])  # fmt: skip
    def test_a_full_disk_is_one_line_and_no_bug(self, line: list[str], study: Path) -> None:
        command = [sys.executable, "-c", PROGRAM, *line, *(["--quiet"] if "-" in line else [])]
        with FULL.open("wb") as full:
            done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, cwd=study.parent)
        said = [one for one in done.stderr.decode().splitlines() if one.startswith(("error", "Trace", "Exception"))]
        assert done.returncode == 8
        assert len(said) == 1
        assert "no space left on device" in said[0]
        assert ERROR.match(said[0])

    def test_a_temporary_folder_too_small_for_what_comes_in(self, tmp_path: Path) -> None:
        import resource

        def limit() -> None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))

        line = [sys.executable, "-c", PROGRAM, "inspect", "-"]
        environment = {**os.environ, "TMPDIR": str(tmp_path)}
        done = subprocess.run(line, input=bytes(10**6), capture_output=True, env=environment, preexec_fn=limit)
        (said,) = done.stderr.decode().splitlines()
        assert done.returncode == 8
        assert "TMPDIR" in said
        assert list(tmp_path.iterdir()) == []


def test_no_temporary_folder_is_no_bug(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfdbinary: Any) -> None:
    with monkeypatch.context() as patched:
        patched.setattr("tempfile.tempdir", str(tmp_path / "none"))
        assert main(["surface", "-", "-o", str(tmp_path / "m.stl")]) == 8
    assert b"TMPDIR" in capfdbinary.readouterr().err


class TestPrivacy:
    def test_nothing_is_left_of_a_study_after_a_kill(self, study: Path, tmp_path: Path) -> None:
        private = tmp_path / "private"
        private.mkdir()
        line = [sys.executable, "-c", PROGRAM, "inspect", "-"]
        environment = {**os.environ, "TMPDIR": str(private)}
        with subprocess.Popen(line, stdin=subprocess.PIPE, env=environment, start_new_session=True) as child:
            assert child.stdin is not None
            child.stdin.write(study.read_bytes().ljust(2**21))  # more than waits in buffers
            child.stdin.flush()
            assert until(lambda: any(path.stat().st_size for path in private.glob("tomomesh-*/input.nii")))
            os.killpg(child.pid, signal.SIGKILL)
        assert until(lambda: not list(private.iterdir()))


class TestPipes:
    @pytest.mark.parametrize("line", [["--help"], ["man"], ["inspect", "s.nii", "--json"]])
    def test_a_reader_that_leaves_is_no_fault(self, line: list[str], study: Path) -> None:
        inside, outside = os.pipe()
        os.close(inside)
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, *line], stdout=outside, stderr=subprocess.PIPE, cwd=study.parent
        )
        os.close(outside)
        assert (done.returncode, done.stderr) == (0, b"")

    def test_what_is_inspected_goes_on_as_json(self, study: Path) -> None:
        line = [sys.executable, "-c", PROGRAM, "inspect", "-", "--json"]
        done = subprocess.run(line, input=study.read_bytes(), capture_output=True, check=True)
        assert json.loads(done.stdout)["slices_rows_columns"] == [8, 9, 10]


class TestOfTheCaller:
    @pytest.mark.parametrize("ends", [[], ["--no-such-option"]])
    def test_streams_are_put_back_as_they_were_found(self, ends: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
        out, err = (io.TextIOWrapper(io.BytesIO(), "ascii", kind) for kind in ("strict", "backslashreplace"))
        monkeypatch.setattr(sys, "stdout", out)
        monkeypatch.setattr(sys, "stderr", err)
        assert main(["inspect", "h\u00e4upter", *ends]) in (2, 3)
        assert (out.errors, err.errors) == ("strict", "backslashreplace")
        err.write("\u00fc")
        err.flush()
        said = err.buffer.getvalue()
        assert said.count(b"\\xfc") == 1
        assert b"\\xe4" not in said
        assert ends or b"h?upter" in said

    def test_streams_that_were_closed_by_then_are_left(self, monkeypatch: pytest.MonkeyPatch) -> None:
        out = io.TextIOWrapper(io.BytesIO(), "ascii")
        monkeypatch.setattr(sys, "stdout", out)
        monkeypatch.setattr("tomomesh.cli._told", lambda arguments: out.close())
        main([])
        assert out.closed
