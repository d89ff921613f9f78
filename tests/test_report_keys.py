"""The report's keys, way by way, held by a golden file: `python tests/test_report_keys.py` writes it anew."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tomomesh import Volume, reconstruct, reconstruct_labels, reconstruct_points, segment

GOLDEN = Path(__file__).parent / "report_keys.json"
ROOT = Path(__file__).parents[1]
STUDIES: dict[str, dict[str, Any]] = {
    "rings": {},
    "grid": {"network": "grid", "allow_leaks": True},
    "loops": {"contours": "loops"},
    "voxels": {"network": "none"},
    "space": {"network": "sphere", "neurons": 42},
    "coarser": {"network": "none", "target_faces": 1000},
    "print": {"network": "none", "flat_base": 1.0},
}
CLOUDS: dict[str, dict[str, Any]] = {
    "cloud": {},
    "nearest": {"attraction": "nearest"},
    "stack": {},
    "sheet": {"open": True},
    "flat": {},
    "filled": {"filled": True},
    "fill_holes": {"fill_holes": True},
    "half planes": {},
}


def ball() -> Volume:
    """Return a ball of radius 6 mm, its gray levels falling outward."""
    away = np.sqrt(((np.indices((16, 16, 16)) - 7.5) ** 2).sum(axis=0))
    return Volume.from_stored((100 * np.clip(6.5 - away, 0, 1)).astype(np.float32), np.eye(4))


def cloud(name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return a sphere's samples, some of them, contours of them, their shadow on a plane, or points that fill it."""
    if name == "filled":
        lattice = np.indices((11, 11, 11)).reshape(3, -1).T - 5.0
        return np.asarray(lattice[(lattice**2).sum(axis=1) < 25])
    points = np.random.default_rng(0).normal(size=(1200, 3))
    points /= np.sqrt((points**2).sum(axis=1))[:, None]
    if name == "stack":
        angle, heights = np.linspace(0, 2 * np.pi, 60, endpoint=False), np.linspace(-0.9, 0.9, 10)
        rings = [np.sqrt(1 - z**2) * np.stack([np.cos(angle), np.sin(angle)]) for z in heights]
        return np.concatenate(
            [np.column_stack([*ring, np.full(60, z)]) for ring, z in zip(rings, heights, strict=True)]
        )
    if name == "half planes":
        turn, angle = np.meshgrid(np.arange(12) * np.pi / 12, np.linspace(0, 2 * np.pi, 60, endpoint=False))
        away = np.sin(angle)
        return np.stack([away * np.cos(turn), away * np.sin(turn), np.cos(angle)], axis=-1).reshape(-1, 3)
    kept = points[:, 2] > {"sheet": 0, "fill_holes": -0.8}.get(name, -np.inf)
    return points[kept] * [1, 1, name != "flat"]


def keys_of(report: dict[str, Any]) -> dict[str, Any]:
    """Return the sections in their order, each with its keys; those of settings and versions are held elsewhere."""
    kept = {name: sorted(part) if isinstance(part, dict) else [] for name, part in report.items()}
    return kept | {"settings": [], "versions": []}


def reports() -> dict[str, dict[str, Any]]:
    """Return the keys of each way's report."""
    found = {name: keys_of(reconstruct(ball(), lower=40.0, **asked).report) for name, asked in STUDIES.items()}
    labels = Volume.from_stored((ball().voxels > 40).astype(np.uint8), np.eye(4))
    found["walls"] = keys_of(reconstruct_labels(labels, shared_walls=True)[1].report)
    found["stage one"] = keys_of(segment(ball(), lower=40.0).report)
    return found | {name: keys_of(reconstruct_points(cloud(name), **asked).report) for name, asked in CLOUDS.items()}


@pytest.fixture(scope="module")
def found() -> dict[str, dict[str, Any]]:
    return reports()


@pytest.mark.parametrize("way", [*STUDIES, *CLOUDS, "stage one"])
def test_a_report_has_the_keys_that_it_had(way: str, found: dict[str, dict[str, Any]]) -> None:
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))
    assert list(found[way].items()) == list(golden[way].items())


def test_every_time_that_a_way_tells_has_a_row_and_no_other() -> None:
    page = (ROOT / "docs" / "report.md").read_text(encoding="utf-8")
    section = page.partition("## timings\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `(?:timings\.)?(\w+)` \| s \|", section, re.MULTILINE)
    sources = (path for path in (ROOT / "src").rglob("*.py") if path.name != "stage.py")
    clocked = (re.findall(r'\b(?:timed|measured)\(\s*"(\w+)"', path.read_text(encoding="utf-8")) for path in sources)
    assert sorted(rows) == sorted({f"{name}_s" for names in clocked for name in names} | {"total_s"})
    told = {key for report in json.loads(GOLDEN.read_text(encoding="utf-8")).values() for key in report["timings"]}
    assert told | {"truth_s"} == set(rows)


if __name__ == "__main__":
    GOLDEN.write_text(json.dumps(reports(), indent=1) + "\n", encoding="utf-8")
