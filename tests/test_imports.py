"""Imports at the door: what a way does not need is not imported by it."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from conftest import COMPILED
from studies import write_nifti
from test_faults_studies import AFFINE, ball

if TYPE_CHECKING:
    from pathlib import Path

HEAVY = {
    "numba", "llvmlite", "scipy.ndimage", "scipy.spatial", "scipy.sparse", "scipy.interpolate", "scipy.optimize",
    "trimesh", "matplotlib", "nibabel", "pydicom", "PIL", "tqdm", "manifold3d",
}  # fmt: skip
"""Packages that take a twentieth of a second or more."""
OTHER_WAYS = ("tomomesh.ways.clouds", "tomomesh.printing", "tomomesh.opensurface", "tomomesh.show")


def loaded_after(program: str) -> set[str]:
    """Return the modules that there are after a program in a process of its own."""
    told = f"{program}\nimport sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_the_pipeline_imports_nothing_heavy() -> None:
    found = loaded_after("import tomomesh.pipeline")
    assert not found & HEAVY
    assert not [name for name in found if name.startswith(OTHER_WAYS)]


@pytest.mark.skipif(not COMPILED, reason="minutes without the compiler")
@pytest.mark.parametrize("more", [[], ["--network", "none"]])
def test_a_study_imports_what_it_needs(tmp_path: Path, more: list[str]) -> None:
    study = write_nifti(tmp_path / "s.nii", ball(AFFINE), AFFINE)
    line = ["reconstruct", str(study), "-o", str(tmp_path / "m.stl"), "--lower", "50", "--quiet", *more]
    program = f"from tomomesh.cli import main; assert main({line!r}) == 0"
    loaded_after(program)  # compiles what is not in the cache
    found = loaded_after(program)
    assert not found & (HEAVY - {"llvmlite"})
    assert not [name for name in found if name.startswith(OTHER_WAYS[1:])]
