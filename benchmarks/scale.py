"""Past one process: many studies on two workers; studies larger than the memory, slab by slab, against in memory."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from functools import partial
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

import nibabel
import numpy as np

from bench import at_most, costs, header, holds, note
from tomomesh import phantom

if TYPE_CHECKING:
    from numpy.typing import NDArray

STUDIES = 20
WALL, CPU = 0.6, 1.1
SIZE, SLABS = 512, (32, 64, 100, 512)
CHUNK = 64
"""Voxels along each axis of a chunk of Zarr."""
WAVES = 48.0
"""Voxels of a wave of the shape that is made on the fly, a gyroid within an ellipsoid."""
SLOWER, SMALLER = 1.3, 0.25
LARGE, WORKER, SLOPE = (1536, 1024, 1024), 3072.0, 1.05
PROGRAM = """
import json, resource, sys
from tomomesh.cli import main
code = main(sys.argv[2:])
peak = int(open("/proc/self/status").read().split("VmHWM:")[1].split()[0]) / 1024
spent = [sum(resource.getrusage(whose)[:2]) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
json.dump({"peak": peak, "children": children, "cpu": sum(spent)}, open(sys.argv[1], "w"))
sys.exit(code)
"""
"""A run that tells its own peak in MiB, and the CPU seconds of it and of the workers that it has waited for."""


class Taken(NamedTuple):
    """What a run took: CPU seconds, MiB of its own and of the largest of its workers."""

    cpu: float
    peak: float
    worker: float


def main() -> None:
    parts = {"many": many_studies, "slabs": in_slabs, "large": larger_than_memory}
    asked = sys.argv[1:] or [*parts]
    header("Past one process and past the memory", "dask", "distributed", "zarr")
    for name in asked:
        with TemporaryDirectory() as place:
            parts[name](Path(place))


def in_slabs(place: Path) -> None:
    """Compare runs slab by slab with those in memory: bytes, CPU time, peak memory."""
    shape = (SIZE, SIZE, SIZE)
    for kind, options in {
        "labels": ("--select", "1"),
        "gray": ("--lower", "0", "--way", "voxels"),
        "networks": ("--lower", "0", "--way", "ring"),
    }.items():
        source = place / f"{kind}.zarr"
        write_volume(source, shape, kind)
        common = [*options, "--spacing", "1", "1", "1", "--no-divide", "--no-remesh"]
        whole = taken(place, source, "whole", common)
        expected = digest(place / "whole.ply")
        note(f"{kind}, {SIZE} cubed, in memory", f"{whole.cpu:.3g} CPU s, {whole.peak:.0f} MiB")
        for slab in SLABS:
            found = taken(place, source, "slabs", [*common, "--memory", "8GB", "--slab", str(slab)])
            figure = f"{kind}, slabs of {slab}"
            holds(f"{figure}: the same bytes", digest(place / "slabs.ply") == expected)
            at_most(f"{figure}: CPU over in memory", found.cpu / whole.cpu, SLOWER)
            if slab == CHUNK:
                at_most(f"{figure}: peak over in memory", found.peak / whole.peak, SMALLER)
            else:
                note(f"{figure}: peak over in memory", f"{found.peak / whole.peak:.3g}")


def larger_than_memory(place: Path) -> None:
    """Take a study of 1.6 G voxels with two workers, and smaller ones of the same kind, and compare by their faces."""
    cells, seconds = [], []
    for shape in ((256, 256, 256), (512, 512, 512), LARGE):
        source = place / "labels.zarr"
        write_volume(source, shape, "labels")
        options = [
            "--select",
            "1",
            "--spacing",
            "1",
            "1",
            "1",
            "--no-divide",
            "--no-remesh",
            "--workers",
            "2",
            "--slab",
            "64",
        ]
        (place / "large.json").unlink(missing_ok=True)
        found = taken(place, source, "large", [*options, "--report", str(place / "large.json")])
        report = json.loads((place / "large.json").read_text())["quality"]
        cells.append(report["vertices"])
        seconds.append(found.cpu)
        size = " x ".join(map(str, shape))
        note(f"labels, {size}, two workers", f"{report['faces']} faces, {found.cpu:.4g} CPU s")
        holds(f"labels, {size}: closed, manifold", report["closed"] and report["manifold"])
        at_most(f"labels, {size}: peak of a worker", found.worker, WORKER, "MiB")
    for (few, many), (before, after) in zip(pairwise(cells), pairwise(seconds), strict=True):
        at_most(f"slope of CPU, {few} to {many} cells", float(np.log(after / before) / np.log(many / few)), SLOPE)


def taken(place: Path, source: Path, name: str, options: list[str]) -> Taken:
    """Reconstruct a study in a process of its own."""
    told, mesh = place / "taken.json", place / f"{name}.ply"
    mesh.unlink(missing_ok=True)
    line = ["reconstruct", str(source), "-o", str(mesh), "--quiet", *options]
    subprocess.run([sys.executable, "-c", PROGRAM, str(told), *line], check=True)
    found = json.loads(told.read_text())
    return Taken(found["cpu"], found["peak"], found["children"])


def digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_volume(path: Path, shape: tuple[int, int, int], kind: str) -> None:
    """Write a Zarr array layer of chunks by layer of chunks."""
    import zarr

    dtype = np.uint8 if kind == "labels" else np.int16
    array = zarr.create_array(path, shape=shape, chunks=(CHUNK,) * 3, dtype=dtype, overwrite=True)
    for start in range(0, shape[0], CHUNK):
        levels = solid(shape, start) if kind == "networks" else gyroid(shape, start)
        array[start : start + CHUNK] = levels > 0 if kind == "labels" else np.round(levels).astype(np.int16)


def gyroid(shape: tuple[int, int, int], start: int) -> NDArray[Any]:
    """Return levels of some slices, over 0 on one side of a gyroid within an ellipsoid."""
    k, j, i = (axis * (2 * np.pi / WAVES) for axis in _axes(shape, start))
    waves = np.sin(i) * np.cos(j) + np.sin(j) * np.cos(k) + np.sin(k) * np.cos(i)
    return np.asarray(400 * np.minimum(waves, 20 * solid(shape, start) / 400))


def solid(shape: tuple[int, int, int], start: int) -> NDArray[Any]:
    """Return levels of some slices, over 0 within an ellipsoid."""
    parts = [(axis - (size - 1) / 2) / (0.45 * size) for axis, size in zip(_axes(shape, start), shape, strict=True)]
    return 400 * (1 - np.sqrt(sum(part**2 for part in parts)))


def _axes(shape: tuple[int, int, int], start: int) -> list[NDArray[Any]]:
    stop = min(start + CHUNK, shape[0])
    return [one.astype(np.float32) for one in np.ogrid[start:stop, : shape[1], : shape[2]]]


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
