"""Starts that go wrong: FAULTS rows 37 and 38, the kernels' cache and Ctrl-C before the first line."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest

from doors import as_program
from studies import write_nifti
from test_faults_studies import AFFINE, ball
from tomomesh.kernels.native.code import Code
from tomomesh.kernels.native.code import folder as cache

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the cache's place is set by XDG_CACHE_HOME on Linux")

STARTS = 8
NEEDED = ("edges.order_half_edges", "positions.first_equal", "shapes.face_sizes")


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return write_nifti(tmp_path / "s.nii", ball(AFFINE), AFFINE)


def line_of(study: Path, mesh: Path) -> list[str]:
    """Return a short run; the window's own boundary needs few kernels."""
    return ["reconstruct", str(study), "-o", str(mesh), "--lower", "50", "--network", "none", "--quiet"]


def cached(folder: Path) -> Path:
    """Return a cache home with a copy of this user's warm cache."""
    if not cache().is_dir():
        pytest.skip("the kernels were not compiled yet")
    shutil.copytree(cache(), folder / "tomomesh" / cache().name)
    return folder


def garbage(path: Path) -> None:
    path.write_bytes(b"garbage" * 100)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def emptied(path: Path) -> None:
    path.write_bytes(b"")


@pytest.mark.parametrize("damage", [garbage, cut, emptied])
def test_a_broken_cache_is_made_anew(study: Path, tmp_path: Path, damage: Callable[[Path], None]) -> None:
    """Kernels that every run needs are broken."""
    home = cached(tmp_path / "cache")
    broken = [home / "tomomesh" / cache().name / f"measure.{name}" for name in NEEDED]
    for path in broken:
        damage(path)
    done = as_program(line_of(study, tmp_path / "m.ply"), env={"XDG_CACHE_HOME": str(home)})
    assert done.returncode == 0, done.stderr
    assert len(done.stderr.splitlines()) <= 1
    assert (tmp_path / "m.ply").exists()
    assert all(Code.unpacked(path.read_bytes()) for path in broken)


CALLS = """
import numpy as np
from tomomesh.kernels.remeshing.links import after, face_shape
assert after(5) == 3
assert face_shape(np.eye(3), 0, 1, 2)[3] > 0
"""


def test_a_cache_that_cannot_be_written(tmp_path: Path) -> None:
    """Neither the cache nor home are folders: not even root may write there."""
    (tmp_path / "none").touch()
    env = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "none"), "HOME": str(tmp_path / "none")}
    done = subprocess.run([sys.executable, "-c", CALLS], env=env, capture_output=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")


def test_eight_cold_starts_at_once(tmp_path: Path) -> None:
    """All compile and write the same kernels; `benchmarks/crash.py` does it with whole runs."""
    env = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cold")}
    starts = [
        subprocess.Popen([sys.executable, "-c", CALLS], env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for _ in range(STARTS)
    ]
    said = [start.communicate(timeout=500) for start in starts]
    assert [start.returncode for start in starts] == [0] * STARTS, said
    assert {words for _, words in said} == {b""}
    kept = [path for path in (tmp_path / "cold").rglob("*") if path.is_file()]
    assert sorted(path.name for path in kept) == ["remeshing.links.after", "remeshing.links.face_shape"]
    assert all(Code.unpacked(path.read_bytes()) for path in kept)


STOPPED = """
import os, signal, subprocess, threading
from tomomesh.kernels.native import workers
from tomomesh.kernels.dynamics.projections import renew_projections
from tomomesh.kernels.threads import in_blocks

processes = []
class Noted(subprocess.Popen):
    def __init__(self, *given, **named):
        super().__init__(*given, **named)
        processes.append(self)
        print(self.pid, flush=True)
        threading.Timer(0.2, os.kill, [os.getpid(), signal.SIGINT]).start()

workers.subprocess.Popen = Noted
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
in_blocks(lambda start, stop: renew_projections(), 8, block=1, threads=2)
"""


def test_ctrl_c_while_threads_wait_for_a_kernel(tmp_path: Path) -> None:
    """The run ends though its kernel is not there yet, and what compiles ends with it."""
    env = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cold")}
    done = subprocess.run([sys.executable, "-c", STOPPED], env=env, capture_output=True, text=True, check=False)
    assert "KeyboardInterrupt" in done.stderr
    assert not list((tmp_path / "cold").rglob("*"))
    for pid in map(int, done.stdout.split()):
        _ended(pid)


def _ended(pid: int) -> None:
    """Wait until a process is gone; what reads the end of its input ends at once."""
    for _ in range(1000):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    raise AssertionError(f"{pid} is still there")


INTERRUPT = """
import signal, sys
from tomomesh.__main__ import main

left = int(sys.argv.pop(1))
def interrupt(frame, event, argument):
    global left
    left -= 1
    if left == 0:
        sys.setprofile(None)
        signal.raise_signal(signal.SIGINT)

signal.signal(signal.SIGINT, signal.default_int_handler)
sys.setprofile(interrupt)
sys.exit(main())
"""


@pytest.mark.parametrize("calls", [2, 30, 300, 3000, 30000])
def test_interrupted_while_it_starts(calls: int) -> None:
    """From the program's first line on there is no traceback, at whatever call Ctrl-C comes."""
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPT, str(calls), "inspect", "nowhere.nii"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert "Traceback" not in done.stderr
    assert done.returncode == 130
    assert len(done.stderr.splitlines()) <= 2
