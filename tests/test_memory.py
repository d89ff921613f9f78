"""Peak memory of a whole run beside that of a small one, in sizes of the study: what docs/ways.md promises."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import nibabel
import numpy as np
import pytest

pytest.importorskip("resource", reason="this system does not tell the peak of a process")

if TYPE_CHECKING:
    from pathlib import Path

SIDE = 288
"""Voxels along each axis: 48 MB of 16 bits, five times what two runs differ by."""

MOST_RING, MOST_VOXELS, MOST_CONTOURS = 2.5, 2.5, 3.0
A_FACE = 450
"""Bytes a triangle of what is written."""

PROGRAM = """
import resource, sys
from pathlib import Path
from tomomesh.cli import main
small, big, *options = sys.argv[1:]
def peak(study):
    assert main(["reconstruct", study, "-o", small + ".stl", "--lower", "0", "--quiet", *options]) == 0
    own = Path("/proc/self/status")  # of this process alone; getrusage() would count its parent's
    if own.exists():
        return 1024 * int(own.read_text().split("VmHWM:")[1].split()[0])
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
before = peak(small)
print(peak(big) - before)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball in a small study and one in a large one, and a small study that is full of surface; NIfTI, not packed."""
    folder: Path = tmp_path_factory.mktemp("memory")
    turns = np.arange(96) * (2 * np.pi / 24)
    z, y, x = np.meshgrid(turns, turns, turns, indexing="ij", sparse=True)
    gyroid = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    nibabel.save(nibabel.Nifti1Image(np.where(gyroid > 0, 400, -1000).astype(np.int16), np.eye(4)), folder / "rich.nii")
    for name, side, radius in (("small", 40, 12), ("big", SIDE, 48)):
        k, j, i = (axis - side / 2 for axis in np.ogrid[:side, :side, :side])
        levels = np.where(k**2 + j**2 + i**2 <= radius**2, 400, -1000).astype(np.int16)
        nibabel.save(nibabel.Nifti1Image(levels, np.diag([0.5, 0.5, 0.5, 1])), folder / f"{name}.nii")
    return folder


def taken(folder: Path, study: str, way: str) -> float:
    """Return the bytes by which the peak of a run of a study is above that of the small one."""
    line = [sys.executable, "-c", PROGRAM, str(folder / "small.nii"), str(folder / study), "--way", way]
    return float(subprocess.run(line, capture_output=True, text=True, check=True).stdout)


@pytest.mark.parametrize(("way", "most"), [("ring", MOST_RING), ("voxels", MOST_VOXELS), ("contours", MOST_CONTOURS)])
def test_a_run_takes_a_few_times_its_study(folder: Path, way: str, most: float) -> None:
    assert taken(folder, "big.nii", way) / (2 * SIDE**3) < most


def test_a_surface_takes_so_much_a_triangle(folder: Path) -> None:
    bytes_taken = taken(folder, "rich.nii", "voxels")
    faces = ((folder / "small.nii.stl").stat().st_size - 84) / 50
    assert faces > 200_000
    assert bytes_taken / faces < A_FACE
