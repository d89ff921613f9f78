"""Print what half and twice of each chosen number does to meshes whose truth is known.

    python benchmarks/constants.py pointcloud.cloud pointcloud.samples

For each number that a module defines: by how much the mean distance to the truth and the volume or area change, the
worst over some made clouds, stacks and networks, or what fails. Numbers of compiled kernels are baked in: edit them.
"""

from __future__ import annotations

import importlib
import re
import sys
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tomomesh import TomomeshError, Volume, reconstruct, reconstruct_points

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

COUNT = 3000
CASES = {
    "pointcloud": ("torus", "noisy"),
    "contours": ("stack",),
    "opensurface": ("half a ball",),
    "segmentation": ("components", "walls"),
    "measure": ("components", "walls", "stack"),
}
"""What the numbers of each folder are tried on."""
OUTER, INNER, MIDDLE = 28.0, 20.0, np.array([39.0, 39.0, 31.0])
"""Radii and middle of a thick shell, mm."""
NOISE = 0.05
"""Of the noisy torus of radii 3 and 1: a quarter of the distance of its points."""


def around(places: Floats) -> Floats:
    """Return the distance to a torus of radii 3 and 1."""
    return np.asarray(np.hypot(np.hypot(places[:, 0], places[:, 1]) - 3, places[:, 2]) - 1)


@cache
def clouds() -> dict[str, tuple[Floats, dict[str, Any], Callable[[Floats], Floats]]]:
    """Return clouds, how each is meshed, and the distance to its truth."""
    rng = np.random.default_rng(7)
    u, v = rng.uniform(0, 2 * np.pi, (2, 3 * COUNT))
    u, v = (angle[rng.random(3 * COUNT) < (3 + np.cos(v)) / 4][:COUNT] for angle in (u, v))
    torus = np.stack([(3 + np.cos(v)) * np.cos(u), (3 + np.cos(v)) * np.sin(u), np.sin(v)], axis=1)
    noisy = np.concatenate([torus + rng.normal(0, NOISE, torus.shape), rng.uniform(-5, 5, (30, 3))])
    ball = rng.normal(size=(COUNT, 3))
    ball /= np.sqrt((ball**2).sum(axis=1))[:, None]
    stack = []
    for height in np.arange(-0.9, 0.91, 0.2):
        for radius in (3 + np.sqrt(1 - height**2), 3 - np.sqrt(1 - height**2)):
            turn = np.linspace(0, 2 * np.pi, int(90 * radius), endpoint=False)
            stack.append(np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full(len(turn), height)], axis=1))
    rings = np.concatenate(stack)
    rings[:, :2] += rng.normal(0, 0.01, (len(rings), 2))
    return {
        "torus": (torus, {}, around),
        "noisy": (noisy, {}, around),
        "half a ball": (ball[ball[:, 2] > 0], {"open": True}, lambda x: np.sqrt((x**2).sum(axis=1)) - 1),
        "stack": (rings, {}, around),
    }


def measured(name: str) -> tuple[float, float]:
    """Return the mean distance of a mesh to its truth, and its volume, or area where it is open."""
    if name in clouds():
        points, changes, distance = clouds()[name]
        made = reconstruct_points(points, threads=1, **changes)
        size = made.mesh.corners
        area = np.sqrt((np.cross(size[:, 1] - size[:, 0], size[:, 2] - size[:, 0]) ** 2).sum(axis=1)).sum() / 2
        return float(np.abs(distance(made.mesh.vertices)).mean()), float(area)
    made = reconstruct(shell(), lower=50.0, contours=name, neurons=60, threads=1)
    radius = np.sqrt(((made.mesh.vertices - MIDDLE) ** 2).sum(axis=1))
    off = np.minimum(np.abs(radius - OUTER), np.abs(radius - INNER))
    return float(off.mean()), float(made.report["quality"]["area_mm2"])


@cache
def shell() -> Volume:
    """Return a study of a thick shell, with two specks beside it: 16 slices 3 mm apart, 2 mm pixels, soft borders."""
    z, y, x = (np.indices((22, 40, 40)).T * [3.0, 2.0, 2.0]).T - np.reshape(
        [MIDDLE[2], MIDDLE[1], MIDDLE[0]], (3, 1, 1, 1)
    )
    radius = np.sqrt(x**2 + y**2 + z**2)
    levels = 100 * np.clip(0.5 + np.minimum(OUTER - radius, radius - INNER) / 2, 0, 1)
    levels[2, 3:5, 3:5] = levels[11, 3:9, 3:9] = 100
    return Volume.from_stored(levels.astype(np.int16), np.diag([2.0, 2.0, 3.0, 1.0]))


def results(names: tuple[str, ...]) -> dict[str, tuple[float, float] | str]:
    """Measure each case; where it is refused, return the kind of the error."""
    found: dict[str, tuple[float, float] | str] = {}
    for name in names:
        try:
            found[name] = measured(name)
        except (TomomeshError, ArithmeticError, ValueError, IndexError) as fault:
            found[name] = type(fault).__name__
    return found


def numbers_of(module: Any) -> Iterator[tuple[str, Any]]:
    """Yield the numbers that a module itself defines."""
    text = Path(module.__file__).read_text(encoding="utf-8")
    for name, value in vars(module).items():
        defined = re.search(rf"^(?:[A-Z_]+, )*{name}(?:, [A-Z_]+)* = ", text, re.MULTILINE)
        parts = value if isinstance(value, tuple) else (value,)
        if name.isupper() and defined and all(isinstance(one, (int, float)) for one in parts):
            yield name, value


def scaled(value: Any, factor: float) -> Any:
    """Return a number, or each of several, times a factor; whole ones stay whole, one at least."""
    if isinstance(value, tuple):
        return tuple(scaled(one, factor) for one in value)
    return max(int(value * factor), 1) if isinstance(value, int) else value * factor


@contextmanager
def other(module: Any, name: str, new: Any) -> Iterator[None]:
    """Put a number in the place of another, in its module and wherever it was imported from there."""
    old, tail = getattr(module, name), module.__name__.rpartition(".")[2]
    own = [
        one
        for key, one in list(sys.modules.items())
        if key.startswith("tomomesh") and getattr(one, name, None) is old
        if one is module or re.search(rf"from \S*\b{tail} import .*\b{name}\b", Path(one.__file__ or "").read_text())
    ]
    for one in own:
        setattr(one, name, new)
    try:
        yield
    finally:
        for one in own:
            setattr(one, name, old)


def told(before: dict[str, Any], after: dict[str, Any]) -> str:
    """Say what changed most: distance and area, in percent, or what fails."""
    failed = [
        f"{name}: {after[name]}" for name in before if isinstance(after[name], str) and after[name] != before[name]
    ]
    if failed:
        return "fails " + ", ".join(failed)
    changes = [
        (after[name][part] / before[name][part] - 1, what, name)
        for name in before
        if not isinstance(before[name], str)
        for part, what in ((0, "distance"), (1, "area"))
    ]
    worst, what, name = max(changes, key=lambda one: abs(one[0]))
    return "nothing" if worst == 0 else f"{what} {worst:+.1%} ({name})"


def main() -> None:
    """Print a row a number."""
    known: dict[tuple[str, ...], dict[str, Any]] = {}
    for path in sys.argv[1:]:
        cases = CASES[path.partition(".")[0]]
        before = known.setdefault(cases, results(cases))
        module = importlib.import_module(f"tomomesh.{path}")
        for name, value in list(numbers_of(module)):
            row = []
            for factor in (0.5, 2.0):
                with other(module, name, scaled(value, factor)):
                    row.append(told(before, results(cases)))
            print(f"{path} | {name} | {value} | {row[0]} | {row[1]}", flush=True)


if __name__ == "__main__":
    main()
