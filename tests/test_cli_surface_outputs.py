"""Outputs of the command for points: refused before any work, whole, or as they were."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest

from conftest import sphere
from test_cli import ERROR
from test_cli_surface import PLY, refused, saved
from tomomesh.cli import main

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture


class TestOutputs:
    """FAULTS rows 35 to 37."""

    @pytest.fixture
    def cloud(self, tmp_path: Path) -> str:
        return saved(sphere(600), tmp_path)

    def test_what_cannot_be_written_is_refused_before_any_work(
        self, cloud: str, folder: Path, capsys: CaptureFixture[str]
    ) -> None:
        for output, code in (("no/m.ply", 8), ("m.vtk", 2), ("m", 2), ("m.ply.gz", 2)):
            assert main(["surface", "nowhere.npy", "-o", str(folder / output)]) == code
            assert len(capsys.readouterr().err.splitlines()) == 1
        assert main(["surface", cloud, "-o", cloud]) == 2
        assert main(["surface", "nowhere.npy", "-o", str(folder / "m.ply"), "--report", "no/r.json"]) == 8
        assert list(folder.iterdir()) == []

    def test_the_output_may_not_be_the_input(self, folder: Path, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        (tmp_path / "cloud.ply").write_text(PLY.format(1) + "0 0 0\n")
        before = (tmp_path / "cloud.ply").read_bytes()
        (folder / "link.ply").symlink_to(tmp_path / "cloud.ply")
        assert main(["surface", str(tmp_path / "cloud.ply"), "-o", str(folder / "link.ply")]) == 2
        assert "input" in capsys.readouterr().err
        assert (tmp_path / "cloud.ply").read_bytes() == before

    @pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
    def test_a_folder_that_may_not_be_written_to(self, cloud: str, folder: Path, capsys: CaptureFixture[str]) -> None:
        folder.chmod(0o500)
        refused(cloud, folder, 8, capsys)

    def test_a_full_disk_leaves_the_old_output(self, cloud: str, folder: Path) -> None:
        (folder / "m.ply").write_text("old")
        line = ["surface", cloud, "-o", str(folder / "m.ply"), "--quiet"]
        done = subprocess.run(
            [sys.executable, "-c", f"import sys, tomomesh.cli as c; sys.exit(c.main({line!r}))"],
            capture_output=True, text=True, preexec_fn=_small_files, check=False,
        )  # fmt: skip
        assert done.returncode == 8, done.stderr
        assert ERROR.match(done.stderr.strip())
        assert [path.name for path in folder.iterdir()] == ["m.ply"]
        assert (folder / "m.ply").read_text() == "old"

    @pytest.mark.parametrize(
        ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -signal.SIGKILL)]
    )
    def test_signals_leave_the_old_output(self, number: int, code: int, cloud: str, folder: Path) -> None:
        (folder / "m.ply").write_text("old")
        ready = folder.parent / "ready"
        program = (
            "import sys, pathlib, signal, time, tomomesh.finish as p, tomomesh.cli as c\n"
            "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell's background jobs ignore it
            f"def wait(*a, **k):\n    pathlib.Path({str(ready)!r}).touch()\n    while True: time.sleep(0.01)\n"
            "p.check_promise = wait\n"
            f"sys.exit(c.main({['surface', cloud, '-o', str(folder / 'm.ply')]!r}))"
        )
        running = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE)
        while not ready.exists():
            assert running.poll() is None, running.communicate()
            time.sleep(0.01)
        running.send_signal(number)
        _, said = running.communicate(timeout=60)
        assert running.returncode == code
        assert b"Traceback" not in said
        assert [path.name for path in folder.iterdir()] == ["m.ply"]
        assert (folder / "m.ply").read_text() == "old"


def _small_files() -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
