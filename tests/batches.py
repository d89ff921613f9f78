"""Batches of studies, what they leave, and waiting for processes."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tomomesh.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

OPTIONS = ["--each", "--lower", "50", "--format", "ply"]
WAIT_S = 60.0
"""Most that processes may take to end on a busy machine."""


def ball(side: int) -> Any:
    """Return a ball of 100 in 0."""
    k, j, i = (axis - (side - 1) / 2 for axis in np.ogrid[:side, :side, :side])
    return np.where(k**2 + j**2 + i**2 < (0.35 * side) ** 2, 100, 0).astype(np.uint8)


def batch(folder: Path, out: str, *options: str) -> int:
    return main(["reconstruct", str(folder), "-o", str(folder.parent / out), *OPTIONS, *options])


def table(folder: Path, out: str) -> list[dict[str, str]]:
    """Return the rows of a table, without what is about time."""
    with (folder.parent / out / "reports.csv").open(newline="", encoding="utf-8") as file:
        return [row | {"seconds": ""} for row in csv.DictReader(file)]


def codes(folder: Path, out: str) -> dict[str, str]:
    return {row["name"]: row["exit_code"] for row in table(folder, out)}


def results(folder: Path, out: str) -> dict[str, object]:
    """Return what a batch has left: bytes of meshes, reports without what is about time, and names of all else."""
    found: dict[str, object] = {}
    for path in sorted((folder.parent / out).iterdir()):
        found[path.name] = path.read_bytes() if path.suffix == ".ply" else None
        if path.suffix == ".json":
            report = json.loads(path.read_text())
            del report["timings"], report["batch"]["seconds"]
            found[path.name] = report
    return found


def as_alone(folder: Path, out: str) -> bool:
    """Tell whether a batch has left the very same as one that does one study after the other."""
    if not (folder.parent / "alone").exists():
        assert batch(folder, "alone", "--quiet") == 10
    return results(folder, out) == results(folder, "alone") and table(folder, out) == table(folder, "alone")


def until(true: Callable[[], Any]) -> None:
    """Wait for something that comes about soon."""
    for _ in range(int(WAIT_S / 0.05)):
        if true():
            return
        time.sleep(0.05)
    raise AssertionError("it did not come about")


def children_of(process: subprocess.Popen[str]) -> list[Any]:
    """Return a process's children, and theirs."""
    psutil = pytest.importorskip("psutil", reason="it comes with distributed")
    return list(psutil.Process(process.pid).children(recursive=True))


class SchedulerAndWorker:
    """A scheduler, and a worker of its own unless none is wanted, in processes that can be killed."""

    def __init__(self, folder: Path, *, worker: bool = True) -> None:
        self._file, self._env = folder / "scheduler.json", {**os.environ, "TMPDIR": str(folder)}
        common = ["--scheduler-file", str(self._file), "--no-dashboard"]
        self._lines = (
            ["distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", *common],
            ["distributed.cli.dask_worker", "--host", "127.0.0.1", "--nthreads", "1", "--no-nanny", *common],
        )[: 1 + worker]  # fmt: skip

    def __enter__(self) -> tuple[subprocess.Popen[bytes], Path]:
        self._processes = []
        for module, *options in self._lines:
            line = [sys.executable, "-m", module, *options]
            nowhere = subprocess.DEVNULL
            self._processes.append(subprocess.Popen(line, env=self._env, stdout=nowhere, stderr=nowhere))
            until(self._file.exists)
        return self._processes[0], self._file

    def __exit__(self, *fault: object) -> None:
        for process in self._processes:
            process.kill()
            process.wait()
