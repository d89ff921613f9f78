"""What the benchmarks share: the header, the clocks, and the table of marks."""

from __future__ import annotations

import os
import platform
import resource
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import version
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

SHARED = Path(__file__).parents[2] / "shared"
"""Data and judges beside the project; not part of it."""

Clock = Callable[[], float]


def header(title: str, *peers: str) -> None:
    """Print what was measured, when, where and with which versions, and open the table."""
    packages = ("tomomesh", "numpy", "scipy", "numba", *peers)
    print(f"# {title}\n")
    print(f"{datetime.now(UTC):%Y-%m-%d}, {os.cpu_count()} cores, {_processor()}")
    print(f"Python {platform.python_version()}, " + ", ".join(f"{p} {version(p)}" for p in packages) + "\n")
    print("| figure | found | mark | verdict |\n|---|---|---|---|")


def _processor() -> str:
    """Name the processor's model where the system tells it."""
    facts = Path("/proc/cpuinfo")
    lines = facts.read_text().splitlines() if facts.exists() else []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def note(figure: str, found: str) -> None:
    """Print a figure that has no mark."""
    print(f"| {figure} | {found} | | |", flush=True)


def at_most(figure: str, found: float, mark: float, unit: str = "") -> None:
    """Print a figure that should not pass its mark."""
    _row(figure, found, f"<= {mark:g}", unit, found <= mark)


def at_least(figure: str, found: float, mark: float, unit: str = "") -> None:
    """Print a figure that should reach its mark."""
    _row(figure, found, f">= {mark:g}", unit, found >= mark)


def holds(figure: str, found: bool) -> None:
    """Print a statement that should be true."""
    print(f"| {figure} | {'yes' if found else 'no'} | yes | {_word(found)} |", flush=True)


@contextmanager
def judged(figure: str) -> Iterator[None]:
    """Go on where a run is refused, and count it as lost."""
    from tomomesh.errors import TomomeshError  # where peers run, tomomesh is not installed

    try:
        yield
    except TomomeshError as error:
        holds(f"{figure}: not refused ({error})", False)


def _row(figure: str, found: float, mark: str, unit: str, passed: bool) -> None:
    print(f"| {figure} | {found:.3g} {unit} | {mark} {unit} | {_word(passed)} |", flush=True)


def _word(passed: bool) -> str:
    return "passed" if passed else "LOST"


def median_times(*calls: Callable[[], Any], repeats: int = 7, clock: Clock = time.perf_counter) -> list[float]:
    """Return the median seconds of each call, after one warm round; the calls take turns."""
    for call in calls:
        call()
    rounds = [[_seconds(call, clock) for call in calls] for _ in range(repeats)]
    return [median(times) for times in zip(*rounds, strict=True)]


def _seconds(call: Callable[[], Any], clock: Clock) -> float:
    start = clock()
    call()
    return clock() - start


class Cost(NamedTuple):
    """What a call or a process took: seconds of the wall clock, and of all processors together."""

    wall: float
    cpu: float


def costs(*calls: Callable[[], Any], repeats: int = 7, warm: bool = True) -> list[Cost]:
    """Return the median cost of each call, after one warm round unless it is to be cold; the calls take turns."""
    for call in calls if warm else ():
        call()
    rounds = [[_cost(call) for call in calls] for _ in range(repeats)]
    return [Cost(*(median(part) for part in zip(*taken, strict=True))) for taken in zip(*rounds, strict=True)]


def _cost(call: Callable[[], Any]) -> Cost:
    """Clock a call; the processes that it starts and waits for count too."""
    wall, cpu = time.perf_counter(), _processor_seconds()
    call()
    return Cost(time.perf_counter() - wall, _processor_seconds() - cpu)


def _processor_seconds() -> float:
    return sum(sum(resource.getrusage(whose)[:2]) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def race(figure: str, ours: Cost, peer: Cost, mark: float, *, wall: float | None = None) -> None:
    """Print our CPU time over a peer's against its mark, and the wall time's, against its own where it has one."""
    note(f"{figure}: CPU", f"{ours.cpu:.3g} s for {peer.cpu:.3g} s")
    at_most(f"{figure}: CPU, ratio", ours.cpu / peer.cpu, mark)
    note(f"{figure}: wall", f"{ours.wall:.3g} s for {peer.wall:.3g} s, ratio {ours.wall / peer.wall:.3g}")
    if wall is not None:
        at_most(f"{figure}: wall, ratio", ours.wall / peer.wall, wall)


def judge(name: str) -> Any:
    """Import a judge from the data beside the project; say so and leave where it is absent."""
    path = SHARED / "bench" / f"{name}.py"
    spec = spec_from_file_location(name, path) if path.exists() else None
    if spec is None or spec.loader is None:
        raise SystemExit(f"not measured: {name}.py is not in the shared data beside the project")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
