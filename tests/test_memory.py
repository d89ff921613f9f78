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

PROGRAM = """
import resource, sys
from tomomesh.cli import main
small, big, *options = sys.argv[1:]
def peak(study):
    assert main(["reconstruct", study, "-o", small + ".stl", "--lower", "0", "--quiet", *options]) == 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
before = peak(small)
print(peak(big) - before)
"""


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """A ball of 48 voxels in a small study and in a large one, as NIfTI that is not packed."""
    folder: Path = tmp_path_factory.mktemp("memory")
    for name, side, radius in (("small", 40, 12), ("big", SIDE, 48)):
        k, j, i = (axis - side / 2 for axis in np.ogrid[:side, :side, :side])
        levels = np.where(k**2 + j**2 + i**2 <= radius**2, 400, -1000).astype(np.int16)
        nibabel.save(nibabel.Nifti1Image(levels, np.diag([0.5, 0.5, 0.5, 1])), folder / f"{name}.nii")
    return str(folder / "small.nii"), str(folder / "big.nii")


@pytest.mark.parametrize(("way", "most"), [("ring", 4.0), ("voxels", 5.0), ("contours", 6.0)])
def test_a_run_takes_a_few_times_its_study(studies: tuple[str, str], way: str, most: float) -> None:
    line = [sys.executable, "-c", PROGRAM, *studies, "--way", way]
    told = subprocess.run(line, capture_output=True, text=True, check=True).stdout
    assert float(told) / (2 * SIDE**3) < most
