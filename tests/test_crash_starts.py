"""Starts that go wrong: FAULTS rows 37 and 38, the kernels' cache and Ctrl-C before the first line."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from doors import as_program
from studies import write_nifti
from test_faults_studies import AFFINE, ball
from tomomesh.kernels.compile import CACHE

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the cache's place is set by XDG_CACHE_HOME on Linux")

STARTS = 8


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return write_nifti(tmp_path / "s.nii", ball(AFFINE), AFFINE)


def line_of(study: Path, mesh: Path) -> list[str]:
    """Return a short run; the window's own boundary needs few kernels."""
    return ["reconstruct", str(study), "-o", str(mesh), "--lower", "50", "--network", "none", "--quiet"]


def cached(folder: Path) -> Path:
    """Return a cache home with a copy of this user's warm cache."""
    if not CACHE.is_dir():
        pytest.skip("the kernels were not compiled yet")
    shutil.copytree(CACHE, folder / "tomomesh" / CACHE.name)
    return folder


def garbage(path: Path) -> None:
    path.write_bytes(b"garbage" * 100)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def emptied(path: Path) -> None:
    path.write_bytes(b"")


@pytest.mark.parametrize("damage", [garbage, cut, emptied])
def test_a_broken_cache_is_made_anew(study: Path, tmp_path: Path, damage: Callable[[Path], None]) -> None:
    """Three kernels that every run needs are broken; the others are deleted with them, so few are warm again."""
    home = cached(tmp_path / "cache")
    for path in sorted((home / "tomomesh" / CACHE.name).rglob("*voxels*.nb?"))[:3]:
        damage(path)
    done = as_program(line_of(study, tmp_path / "m.ply"), env={"XDG_CACHE_HOME": str(home)})
    assert done.returncode == 0, done.stderr
    assert len(done.stderr.splitlines()) <= 1
    assert (tmp_path / "m.ply").exists()


def test_a_cache_that_cannot_be_written(study: Path, tmp_path: Path) -> None:
    """Neither the cache nor home are folders: not even root may write there."""
    (tmp_path / "none").touch()
    env = {"XDG_CACHE_HOME": str(tmp_path / "none"), "HOME": str(tmp_path / "none")}
    done = as_program(["inspect", str(study)], env=env)
    assert done.returncode == 0, done.stderr
    assert len(done.stderr.splitlines()) <= 1


def test_eight_cold_starts_at_once(tmp_path: Path) -> None:
    """All compile and write the same kernels; `benchmarks/crash.py` does it with whole runs."""
    program = "from tomomesh.kernels.measure import polygons; from tomomesh.kernels.isosurface import surface_nets"
    env = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cold")}
    starts = [
        subprocess.Popen([sys.executable, "-c", program], env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for _ in range(STARTS)
    ]
    said = [start.communicate(timeout=500) for start in starts]
    assert [start.returncode for start in starts] == [0] * STARTS, said
    assert {words for _, words in said} == {b""}
    assert any((tmp_path / "cold").rglob("*.nbc"))


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
