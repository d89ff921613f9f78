"""Print what half and twice of each chosen number does to meshes whose truth is known.

    python benchmarks/constants.py pointcloud.cloud pointcloud.samples

For each number that a module defines: by how much the mean distance to the truth and the volume or area change, the
worst over some made clouds, stacks, studies and parts, or what fails.
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
from tomomesh.kernels.compile import Kernel
from tomomesh.kernels.native import compiler
from tomomesh.measure.thickness import walls_and_gaps

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from tomomesh.results import Surface

    Floats = NDArray[np.float64]

COUNT = 3000
ANY_POINTS = ("torus", "noisy", "noisier", "holes", "thin")
IN_SPACE = ("ball in space", "nearest", "torus in space")
CASES: dict[str, tuple[str, ...]] = {
    "pointcloud": ANY_POINTS,
    "contours": ("stack",),
    "opensurface": ("half a ball",),
    "segmentation": ("rings", "components", "walls"),
    "segmentation.space": IN_SPACE,
    "som": ("rings", "online", "components", "walls", *IN_SPACE),
    "model": IN_SPACE,
    "measure": ("components", "walls", "stack"),
    "isosurface": ("soft", "mask"),
    "dynamics": ("rings", "ball in space", *ANY_POINTS),
    "printing": ("hollow",),
    "ways": ("rings", "ball in space", *ANY_POINTS),
    "kernels.pointcloud": ANY_POINTS,
    "kernels.pointcloud.sheet": ("half a ball",),
    "kernels.dynamics": ("ball in space", *ANY_POINTS),
    "kernels.measure": ("walls and gaps",),
    "kernels.som": ("rings", "online"),
}
"""What the numbers of each folder are tried on; of one with several entries the longest counts."""
STUDIES: dict[str, dict[str, Any]] = {
    "rings": {"way": "ring", "neurons": 60},
    "online": {"way": "ring", "neurons": 60, "training": "online"},
    "components": {"neurons": 60, "contours": "components"},
    "walls": {"neurons": 60, "contours": "walls"},
    "soft": {"network": "none"},
    "mask": {"network": "none"},
    "ball in space": {"network": "sphere", "signal": "boundary"},
    "nearest": {"network": "sphere", "signal": "boundary", "attraction": "nearest"},
    "torus in space": {"network": "torus", "neurons": 600},
    "hollow": {"network": "none", "hollow": 2.0},
    "walls and gaps": {"network": "none"},
}
"""How each study of a thick shell, or a torus, is meshed."""
OUTER, INNER, MIDDLE = 28.0, 20.0, np.array([39.0, 39.0, 31.0])
"""Radii and middle of a thick shell, mm."""
RING, TUBE = 24.0, 9.0
"""Radii of a torus around the same middle, mm."""
NOISE = 0.05
"""Of the noisy torus of radii 3 and 1: a quarter of the distance of its points.

The noisier one has three times that, the thin disk a fifth.
"""


def around(places: Floats) -> Floats:
    """Return the distance to a torus of radii 3 and 1."""
    return np.asarray(np.hypot(np.hypot(places[:, 0], places[:, 1]) - 3, places[:, 2]) - 1)


FLAT = np.array([1.0, 1.0, 0.15])
"""Half axes of a thin disk."""


def beside_disk(places: Floats) -> Floats:
    """Return the distance to a flat ellipsoid, to first order."""
    at, slope = places / FLAT, 2 * places / FLAT**2
    return np.asarray(((at**2).sum(axis=1) - 1) / np.sqrt((slope**2).sum(axis=1)))


def _outside(places: Floats, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Tell which points (n,) lie outside of six round holes, two to seven sampling distances wide."""
    middles, radii = rng.choice(places, 6, replace=False), np.linspace(0.2, 0.7, 6)
    apart = np.sqrt(((places[:, None] - middles) ** 2).sum(axis=2))
    return np.asarray((apart > radii).all(axis=1))


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
        "noisier": (torus + rng.normal(0, 3 * NOISE, torus.shape), {}, around),
        "holes": (torus[_outside(torus, rng)], {}, around),
        "thin": (0.2 * NOISE * rng.normal(size=ball.shape) + ball * FLAT, {}, beside_disk),
        "half a ball": (ball[ball[:, 2] > 0], {"open": True}, lambda x: np.sqrt((x**2).sum(axis=1)) - 1),
        "stack": (rings, {}, around),
    }


def measured(name: str) -> tuple[float, float]:
    """Return the mean distance of a mesh to its truth, and its area."""
    if name in clouds():
        points, changes, distance = clouds()[name]
        mesh = reconstruct_points(points, threads=1, **changes).mesh
        return float(np.abs(distance(mesh.vertices)).mean()), float(mesh.face_areas.sum())
    made = meshed(name)
    if name == "walls and gaps":
        walls, gaps = walls_and_gaps(made.mesh, threads=1)
        wide = [np.minimum(found.widths, 2 * OUTER) for found in (walls, gaps)]
        return float(np.abs(wide[0] - (OUTER - INNER)).mean()), float(wide[1].mean())
    if made.part is None:
        return beside_truth(name, made.mesh.vertices), float(made.mesh.face_areas.sum())
    added = made.part.mesh.vertices[len(made.mesh.vertices) :]
    radius, wall = np.sqrt(((added - MIDDLE) ** 2).sum(axis=1)), STUDIES[name]["hollow"]
    off = np.minimum(np.abs(radius - OUTER + wall), np.abs(radius - INNER - wall))
    return float(off.mean()), float(made.part.mesh.face_areas.sum())


def meshed(name: str) -> Surface:
    """Mesh a study."""
    kind = "torus" if name.startswith("torus") else "mask" if name == "mask" else "shell"
    return reconstruct(study(kind), lower=50.0, threads=1, **STUDIES[name])


def beside_truth(name: str, places: Floats) -> float:
    """Return the mean distance of places to the nearer border of what a study shows."""
    away = places - MIDDLE
    if name.startswith("torus"):
        return float(np.abs(np.hypot(np.hypot(away[:, 0], away[:, 1]) - RING, away[:, 2]) - TUBE).mean())
    radius = np.sqrt((away**2).sum(axis=1))
    return float(np.minimum(np.abs(radius - OUTER), np.abs(radius - INNER)).mean())


@cache
def study(kind: str) -> Volume:
    """Return a study of a torus, or a thick shell with two specks beside it: 22 slices 3 mm apart, 2 mm pixels."""
    z, y, x = (np.indices((22, 40, 40)).T * [3.0, 2.0, 2.0]).T - np.reshape(MIDDLE[::-1], (3, 1, 1, 1))
    radius = np.sqrt(x**2 + y**2 + z**2)
    inside = np.minimum(OUTER - radius, radius - INNER)
    if kind == "torus":
        inside = TUBE - np.hypot(np.hypot(x, y) - RING, z)
    levels = 100.0 * (inside > 0) if kind == "mask" else 100 * np.clip(0.5 + inside / 2, 0, 1)
    if kind != "torus":
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
        if one is module
        or re.search(rf"from \S*\b{tail} import ([^\n(]*|\([^)]*)\b{name}\b", Path(one.__file__ or "").read_text())
    ]
    for value in (new, old):
        for one in own:
            setattr(one, name, value)
        recompile(own, name)
        if value is new:
            yield


def recompile(modules: list[Any], name: str) -> None:
    """Compile anew, callees first, the kernels in which a number of some modules is baked in."""
    stale: set[str] = set()
    compiler.dispatcher.cache_clear()
    compiler.inner.cache_clear()
    for module in [one for key, one in sys.modules.items() if key.startswith("tomomesh.kernels")]:
        for key, found in list(vars(module).items()):
            if isinstance(found, Kernel) and found.__module__ == module.__name__:
                used = set(found.function.__code__.co_names)
                if used & stale or (name in used and module in modules):
                    found.call = compiler.dispatcher(found)
                    stale.add(key)


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
        cases = CASES[max((folder for folder in CASES if path.startswith(folder)), key=len)]
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
