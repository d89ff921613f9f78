"""Kill runs at random moments and start eight at once on a cold cache: what is left each time.

    python benchmarks/crash.py [--kills 200] [--starts 8] [--seed 0]

Each run writes a mesh, points and a report over older ones. A run that was killed must leave each file whole, the
old one or the new one, and nothing else once the next run has written there. Half of the moments fall into the time
of writing, which is a small part of a run.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest import mock

NAMES = ("m.ply", "p.ply", "r.json")
OLD = b"old"


def line_of(study: Path, folder: Path) -> list[str]:
    mesh, points, report = (str(folder / name) for name in NAMES)
    return ["reconstruct", str(study), "-o", mesh, "--points", points, "--report", report, "--lower", "50", "--quiet"]


def study_in(folder: Path) -> Path:
    """Write a ball, from its formula."""
    import nibabel
    import numpy as np

    places = np.indices((40, 40, 20)) - np.array([20, 20, 10]).reshape(3, 1, 1, 1)
    ball = np.clip(50 + 20 * (8 - np.sqrt((places**2).sum(axis=0))), 0, 100).astype(np.int16)
    nibabel.save(nibabel.Nifti1Image(ball, np.eye(4)), folder / "s.nii")
    return folder / "s.nii"


def forked(line: list[str], writes: Path | None = None) -> int:
    """Start a run in a copy of this process; it tells of its first write by making a file."""
    child = os.fork()
    if child:
        return child
    from tomomesh.cli import main
    from tomomesh.cli.outputs import write as outputs

    write = outputs.write_surface

    def told(*arguments: Any) -> None:
        if writes is not None:
            writes.touch()
        write(*arguments)

    for module in (outputs, sys.modules["tomomesh.cli.commands"]):
        mock.patch.object(module, "write_surface", told).start()
    os._exit(main(line))


def kill_once(line: list[str], folder: Path, rng: random.Random, seconds: tuple[float, float], late: bool) -> str:
    """Kill a run at a random moment, and tell what each file is and what else is there."""
    for name in NAMES:
        (folder / name).write_bytes(OLD)
    writes = folder.parent / "writes"
    writes.unlink(missing_ok=True)
    child = forked(line, writes)
    while late and not writes.exists() and os.waitpid(child, os.WNOHANG) == (0, 0):
        time.sleep(0.0005)
    time.sleep(rng.uniform(0, seconds[late]))
    try:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    except (ProcessLookupError, ChildProcessError):
        pass
    new = sum((folder / name).read_bytes() != OLD for name in NAMES)
    return f"{new} of {len(NAMES)} new, {len(list(folder.iterdir())) - len(NAMES)} unfinished"


def whole(path: Path) -> bool:
    """Whether a file is the old one, or the one that an undisturbed run writes (its report but for the times)."""
    import json

    data = path.read_bytes()
    if data == OLD:
        return True
    undisturbed = (path.parent.parent / "whole" / path.name).read_bytes()
    return bool(json.loads(data)) if path.suffix == ".json" else data == undisturbed


def kill(count: int, seed: int) -> None:
    for name in ("tomomesh.cli.commands", "tomomesh.pipeline"):  # what every run would import, before it is copied
        import_module(name)
    rng, tally, torn = random.Random(seed), Counter[str](), 0
    with tempfile.TemporaryDirectory() as place:
        folders = [Path(place, name) for name in ("out", "whole")]
        for folder in folders:
            folder.mkdir()
        study = study_in(Path(place))
        began = time.perf_counter()
        os.waitpid(forked(line_of(study, folders[1])), 0)
        lasts = time.perf_counter() - began
        for number in range(count):
            tally[kill_once(line_of(study, folders[0]), folders[0], rng, (lasts, lasts / 10), bool(number % 2))] += 1
            torn += sum(not whole(folders[0] / name) for name in NAMES)
        os.waitpid(forked(line_of(study, folders[0])), 0)
        left = sorted({path.name for path in folders[0].iterdir()} - set(NAMES))
    print(f"{count} kills in runs of {lasts:.2f} s: {torn} files torn, {len(left)} left after the next run")
    for what, times in sorted(tally.items()):
        print(f"  {times:4d}  {what}")


def start_cold(count: int) -> None:
    with tempfile.TemporaryDirectory() as place:
        study, env = study_in(Path(place)), {**os.environ, "XDG_CACHE_HOME": str(Path(place, "cache"))}
        meshes = [Path(place, f"{number}.ply") for number in range(count)]
        program = "import sys; from tomomesh.__main__ import main; sys.exit(main())"
        began = time.perf_counter()
        runs = [
            subprocess.Popen(
                [sys.executable, "-c", program, "reconstruct", str(study), "-o", str(mesh), "--lower", "50", "--quiet"],
                env=env, stderr=subprocess.PIPE,
            )
            for mesh in meshes
        ]  # fmt: skip
        said = [run.communicate()[1] for run in runs]
        good = sum(run.returncode == 0 for run in runs)
        same = len({mesh.read_bytes() for mesh in meshes if mesh.exists()}) == 1
    print(
        f"{count} cold starts at once, {time.perf_counter() - began:.0f} s: {good} good, "
        f"{'the same bytes' if same else 'DIFFERENT bytes'}, {sum(map(bool, said))} said anything"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--starts", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    if chosen.kills:
        kill(chosen.kills, chosen.seed)
    if chosen.starts:
        start_cold(chosen.starts)
