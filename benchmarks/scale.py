"""Past one process: many studies on two workers against one, and one after the other."""

from __future__ import annotations

import subprocess
import sys
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import nibabel
import numpy as np

from bench import at_most, costs, header, holds, note
from tomomesh import phantom

STUDIES = 20
WALL, CPU = 0.6, 1.1


def main() -> None:
    header("Many studies: two workers against one", "dask", "distributed")
    with TemporaryDirectory() as place:
        many_studies(Path(place))


def many_studies(place: Path) -> None:
    """Reconstruct heads that differ in their noise: in turn, on one worker, and on two; each from start to end."""
    write_studies(place / "studies")
    subprocess.run(line(place / "studies" / "00.nii", place / "warm.ply"), check=True)  # kernels are compiled
    ways = {"one": ("--workers", "1"), "two": ("--workers", "2"), "in turn": ()}
    found = {}
    for name, options in ways.items():
        (found[name],) = costs(partial(run, place, name, options), repeats=1, warm=False)
        note(f"{STUDIES} studies, {name}: wall, CPU", f"{found[name].wall:.3g} s, {found[name].cpu:.3g} s")
    one, two, in_turn = found.values()
    at_most("two workers over one: wall", two.wall / one.wall, WALL)
    at_most("two workers over one: CPU", two.cpu / one.cpu, CPU)
    note("two workers over in turn: wall, CPU", f"{two.wall / in_turn.wall:.3g}, {two.cpu / in_turn.cpu:.3g}")
    meshes = [[path.read_bytes() for path in sorted((place / name).glob("*.ply"))] for name in ways]
    holds("the same bytes", len(meshes[0]) == STUDIES and meshes[0] == meshes[1] == meshes[2])


def write_studies(folder: Path) -> None:
    folder.mkdir()
    for number in range(STUDIES):
        volume = phantom(seed=number).volume
        spacing = np.diag([*np.abs(volume.affine[:3, :3]).max(axis=0)[::-1], 1.0])
        nibabel.save(nibabel.Nifti1Image(np.ascontiguousarray(volume.voxels.T), spacing), folder / f"{number:02}.nii")


def run(place: Path, name: str, options: tuple[str, ...]) -> None:
    """Reconstruct all studies in a process of its own."""
    many = ["--each", "--format", "ply", "--force"]
    subprocess.run([*line(place / "studies", place / name), *many, *options], check=True)


def line(study: Path, output: Path) -> list[str]:
    program = [sys.executable, "-m", "tomomesh", "reconstruct"]
    return [*program, str(study), "-o", str(output), "--quiet", "--lower", "200"]


if __name__ == "__main__":
    main()
