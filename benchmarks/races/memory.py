"""Peak memory of every way over its input, packages included: each run of the command line in a process of its own."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np

from bench import at_most, note
from tomomesh import PointSet, TriMesh
from tomomesh.io import write_mesh, write_points
from tomomesh.model.icosphere import icosphere

if TYPE_CHECKING:
    from numpy.typing import NDArray

PROGRAM = """
import pathlib, sys
from tomomesh.cli import main
code = main(sys.argv[1:])
print(pathlib.Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0])
sys.exit(code)
"""
"""A run that tells its own peak, in KiB, as Linux counts it; what a parent is told of a child counts the parent too."""

MIB = 2**20
STUDY, LABELS = 256, 512
"""Voxels along each axis: 32 MiB of 16 bits, and 128 MiB of bytes."""
MOST_OF_LABELS = 1228.0
"""MiB for them: 1.2 GiB."""


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for figure, arguments, source in [*studies(folder), *clouds(folder), *meshes(folder)]:
            made = [] if arguments[0] == "check" else ["-o", str(folder / "made.stl")]
            peak, size = _peak([*arguments, *made, "--quiet"]), source.stat().st_size / MIB
            told = f"{figure}: peak over its input of {size:.3g} MiB"
            if source.stem == "labels":
                at_most(told, peak, MOST_OF_LABELS, "MiB")
            else:
                note(told, f"{peak:.0f} MiB, {peak / size:.3g} times")


def studies(folder: Path) -> list[tuple[str, list[str], Path]]:
    """Write studies, and return the command line of each of their ways."""
    gray, labels = folder / "gray.nii", folder / "labels.nii"
    nibabel.save(nibabel.Nifti1Image(_ball(STUDY, np.int16, -1000, 400), np.eye(4)), gray)
    nibabel.save(nibabel.Nifti1Image(_ball(LABELS, np.uint8, 0, 1), np.eye(4)), labels)
    ways = ("ring", "voxels", "contours", "components", "sphere")
    return [
        *((f"study, {way}", ["reconstruct", str(gray), "--lower", "0", *_way(way)], gray) for way in ways),
        ("labels of 512 x 512 x 512", ["reconstruct", str(labels), "--select", "1"], labels),
    ]


def _way(name: str) -> list[str]:
    return ["--contours", "components"] if name == "components" else ["--way", name]


def _ball(side: int, kind: Any, outside: int, inside: int) -> NDArray[Any]:
    z, y, x = (axis - side / 2 for axis in np.ogrid[:side, :side, :side])
    ball: NDArray[Any] = np.where(x * x + y * y + z * z < (side / 3) ** 2, kind(inside), kind(outside))
    return ball


def clouds(folder: Path) -> list[tuple[str, list[str], Path]]:
    """Write clouds, and return the command line of each of their ways."""
    rng = np.random.default_rng(0)
    ball, turns = 50 * icosphere(224)[0], rng.random((20_000, 2))
    rings = 50 * np.column_stack([np.cos(7 * turns[:, 0]), np.sin(7 * turns[:, 0]), np.rint(25 * turns[:, 1]) / 5])
    sheet = np.column_stack([100 * turns, 5 * np.sin(6 * turns[:, 0])])
    made = {
        "50k": (ball[rng.permutation(len(ball))[:50_000]], []),
        "500k": (ball, []),
        "sheet": (sheet, ["--open"]),
        "stack": (rings, []),
        "filled": (100 * rng.random((50_000, 3)), ["--filled"]),
    }
    runs = []
    for name, (positions, options) in made.items():
        path = folder / f"{name}.ply"
        write_points(PointSet.from_positions(positions), path)
        runs.append((f"cloud, {name}", ["surface", str(path), *options], path))
    return runs


def meshes(folder: Path) -> list[tuple[str, list[str], Path]]:
    """Write a mesh, and return the command lines of what is done with one."""
    path = folder / "ball.stl"
    vertices, faces = icosphere(96)
    write_mesh(TriMesh(50 * vertices, faces), path)
    print_it = ["print", str(path), "--flat-base", "2", "--hollow", "3"]
    return [("mesh checked", ["check", str(path)], path), ("mesh made a part to print", print_it, path)]


def _peak(arguments: list[str]) -> float:
    """Return the MiB that a run of the command line took at most; NaN where it is refused."""
    run = subprocess.run([sys.executable, "-c", PROGRAM, *arguments], stdout=subprocess.PIPE, text=True, check=False)
    return float(run.stdout.split()[-1]) / 1024 if run.returncode == 0 else float("nan")


if __name__ == "__main__":
    main()
