"""Clouds beside MeshLib: CPU time of clean points, of noisy ones, and of a million; and how much memory those take.

`python -m races.clouds large` draws ten million points, and takes a quarter of an hour.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path
from resource import RUSAGE_SELF, getrusage
from typing import TYPE_CHECKING

import numpy as np

from bench import SHARED, at_most, costs, judge, note, race

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Cloud = NDArray[np.float64]

SHAPES = {
    "rocker-arm": "common3d/rocker-arm.obj",
    "bunny": "odedstein/bunny/bunny.obj",
    "skull": "odedstein/skull/skull_low_resolution.obj",
}
SEED, NOISE, FEW, MANY, MOST = 7, 0.003, 50_000, 1_000_000, 10_000_000
PEER, MIB = "meshlib", 1024
"""The package of the peer; kibibytes a mebibyte, in which the system tells peaks on Linux."""


def main() -> None:
    if not (SHARED / "data").exists():
        note("clouds", "not measured: there is no shared data beside the project")
        return
    if sys.argv[1:] == ["large"]:
        _large(MOST, 4096)
        return
    for name in SHAPES:
        _clean(name)
    noisy = _cloud("bunny", FEW, NOISE)
    at_most("50,000 points of a bunny, .3 % noise: CPU", costs(lambda: _ours(noisy), repeats=3)[0].cpu, 0.7, "s")
    _large(MANY, 460)


def _clean(name: str) -> None:
    """Race for 50,000 clean points of a shape, turn by turn."""
    points = _cloud(name, FEW)
    if find_spec(PEER) is None:
        note(f"50,000 points of a {name}: CPU", f"{costs(lambda: _ours(points), repeats=3)[0].cpu:.3g} s, no {PEER}")
        return
    ours, theirs = costs(lambda: _ours(points), lambda: _meshlib(points), repeats=3)
    race(f"50,000 points of a {name}", ours, theirs, 0.5)


def _large(count: int, memory: float) -> None:
    """Race for so many points of a bunny, each in a process of its own, whose peak is told in MiB."""
    figure = f"{count:,} points of a bunny"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cloud.npy"
        np.save(path, _cloud("bunny", count))
        ours, peak = _alone("ours", path)
        at_most(f"{figure}: peak memory", peak, memory, "MiB")
        if find_spec(PEER) is None:
            note(f"{figure}: CPU", f"{ours:.3g} s, no {PEER}")
            return
        theirs, peak = _alone(PEER, path)
    note(f"{figure}: CPU", f"{ours:.3g} s for {theirs:.3g} s")
    note(f"{figure}: {PEER}'s peak memory", f"{peak:.0f} MiB")
    at_most(f"{figure}: CPU, ratio", ours / theirs, 1 / 3)


def _alone(method: str, path: Path) -> tuple[float, float]:
    """Return CPU seconds and peak MiB of a method in a process of its own."""
    job = "from sys import argv; from races.clouds import once; once(*argv[1:])"
    done = subprocess.run([sys.executable, "-c", job, method, str(path)], capture_output=True, text=True, check=True)
    seconds, peak = json.loads(done.stdout)
    return seconds, peak


def once(method: str, path: str) -> None:
    """Run a method on a cloud and print what it took; its kernels are loaded before."""
    points, run = np.load(path), METHODS[method]
    run(points[:2_000] if method == PEER else _sphere(2_000))
    start = time.process_time()
    run(points)
    print(json.dumps([time.process_time() - start, getrusage(RUSAGE_SELF).ru_maxrss / MIB]))


def _sphere(count: int) -> Cloud:
    places = np.random.default_rng(SEED).normal(size=(count, 3))
    return np.asarray(places / np.linalg.norm(places, axis=1, keepdims=True))


def _cloud(name: str, count: int, noise: float = 0.0) -> Cloud:
    """Draw a cloud as `peers.py` does, of positions that 32 bits hold."""
    import trimesh

    mesh = trimesh.load(SHARED / "data" / SHAPES[name], process=True, force="mesh")
    return np.asarray(judge("cloud").cloud(mesh, count, noise, SEED).astype(np.float32).astype(np.float64))


def _ours(points: Cloud) -> None:
    from tomomesh import reconstruct_points

    assert len(reconstruct_points(points).mesh.faces)


def _meshlib(points: Cloud) -> None:
    from meshlib import mrmeshnumpy, mrmeshpy

    mrmeshpy.triangulatePointCloud(mrmeshnumpy.pointCloudFromPoints(points))


METHODS = {"ours": _ours, PEER: _meshlib}


if __name__ == "__main__":
    main()
