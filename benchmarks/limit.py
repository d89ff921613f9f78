"""A cloud within a limit of memory against the same one without: bytes, peak, CPU time.

`python limit.py large` draws ten million points, and takes six minutes of the processor, 5 GiB of memory and of disk.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from hashlib import sha256
from pathlib import Path
from resource import RUSAGE_SELF, getrusage

import numpy as np

from bench import at_most, header, holds, note
from tomomesh import memory_limit, reconstruct_points

FEW, MANY = 1_000_000, 10_000_000
LIMITS = {FEW: 600, MANY: 1024}
"""MiB, by points."""
CPU, MIB = 1.3, 1024
"""The mark, and kibibytes a mebibyte, in which the system tells peaks on Linux."""


def main() -> None:
    header("Clouds within a limit of memory")
    limited(MANY if sys.argv[1:] == ["large"] else FEW)


def limited(count: int) -> None:
    """Reconstruct a sphere of so many points in a process of its own, with the limit and without."""
    most, figure = LIMITS[count], f"{count:,} points"
    with tempfile.TemporaryDirectory() as folder:
        np.save(Path(folder, "cloud.npy"), _sphere(count))
        free, held = (_alone(Path(folder, "cloud.npy"), limit) for limit in ("", f"{most}MiB"))
    holds(f"{figure}: the same bytes", free[0] == held[0])
    note(f"{figure}: peak without a limit", f"{free[1]:.0f} MiB")
    at_most(f"{figure}: peak within {most} MiB", held[1], most, "MiB")
    at_most(f"{figure}: CPU within it over without", held[2] / free[2], CPU)


def _alone(path: Path, limit: str) -> tuple[str, float, float]:
    job = "from sys import argv; from limit import once; once(*argv[1:])"
    done = subprocess.run([sys.executable, "-c", job, str(path), limit], capture_output=True, text=True, check=True)
    bytes_, peak, seconds = json.loads(done.stdout)
    return bytes_, peak, seconds


def once(path: str, limit: str) -> None:
    """Reconstruct a cloud within a limit, kernels loaded before; print what came out, its peak and its CPU time."""
    reconstruct_points(_sphere(2_000), remesh=False)
    with memory_limit(limit or None):
        points, start = np.load(path), time.process_time()
        mesh = reconstruct_points(points, remesh=False).mesh
        seconds = time.process_time() - start
    found = sha256(mesh.vertices.tobytes() + mesh.faces.tobytes()).hexdigest()
    print(json.dumps([found, getrusage(RUSAGE_SELF).ru_maxrss / MIB, seconds]))


def _sphere(count: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    places = np.random.default_rng(7).normal(size=(count, 3))
    return np.asarray(places / np.linalg.norm(places, axis=1, keepdims=True))


if __name__ == "__main__":
    main()
