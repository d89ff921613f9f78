"""Print a hash of everything that each way to a surface puts out: run before and after a change, and compare.

    python benchmarks/bytes.py > before; python benchmarks/bytes.py > after; diff before after

Real studies and clouds are taken too where the folder `shared` lies beside the project.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from tomomesh import (
    TomomeshError,
    Volume,
    phantom,
    read_points,
    read_volume,
    reconstruct,
    reconstruct_points,
)
from tomomesh.settings import Settings

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
STUDIES: dict[str, dict[str, Any]] = {
    "rings": {},
    "rings of 200": {"neurons": 200},
    "rings online": {"way": "ring", "training": "online"},
    "rings, one component": {"surface": "all", "largest": True},
    "chain": {"network": "chain", "allow_leaks": True},
    "components": {"contours": "components"},
    "walls": {"contours": "walls"},
    "loops": {"contours": "loops"},
    "voxels": {"network": "none"},
    "voxels, coarser": {"network": "none", "target_faces": 20_000},
    "sphere": {"network": "sphere"},
    "sphere around": {"network": "sphere", "signal": "boundary"},
    "sphere, nearest": {"network": "sphere", "signal": "boundary", "attraction": "nearest"},
    "torus": {"network": "torus"},
    "to print": {"network": "none", "flat_base": 2.0},
}
REAL: dict[str, tuple[str, dict[str, Any]]] = {
    "MR rings": ("derived/dev54_t1/dev54_t1.nii.gz", {"way": "ring"}),
    "MR loops": ("derived/dev54_t1/dev54_t1.nii.gz", {"contours": "loops"}),
    "CT bone": ("dicom2stl/ct_example.nii.gz", {"preset": "bone", "way": "ring"}),
    "CT bone, voxels": ("dicom2stl/ct_example.nii.gz", {"preset": "bone", "network": "none"}),
}
CLOUDS = {
    "contours": "clouds/contours/torus_sphere_5to1.xyz",
    "noised bunny": "clouds/wnnc/bunny_noised.xyz",
}


def digest(*parts: Any) -> str:
    """Hash arrays and documents."""
    found = hashlib.sha256()
    for part in parts:
        data = (
            np.ascontiguousarray(part).tobytes()
            if isinstance(part, np.ndarray)
            else json.dumps(part, sort_keys=True).encode()
        )
        found.update(data)
    return found.hexdigest()[:12]


def told(report: dict[str, Any]) -> dict[str, Any]:
    """Leave out of a report what does not repeat."""
    return {name: part for name, part in report.items() if name not in {"timings", "versions", "settings", "way"}}


def show(name: str, make: Any) -> None:
    """Print the hashes of one result."""
    try:
        made = make()
    except TomomeshError as error:
        print(f"{name:24} {type(error).__name__} {digest(str(error))}", flush=True)
        return
    stage_one = [] if made.segmentation is None else [made.segmentation.labels]
    part = [] if made.part is None else [made.part.mesh.vertices, made.part.mesh.faces]
    hashes = (
        digest(made.mesh.vertices, made.mesh.faces, *part),
        digest(made.points.positions, made.smoothed.vertices, *stage_one),
        digest(told(made.report)),
    )
    print(f"{name:24} mesh {hashes[0]}  stages {hashes[1]}  report {hashes[2]}", flush=True)


def clouds() -> dict[str, Any]:
    """Return clouds that are made here: a noisy torus, a half sphere, and the neurons of nothing else."""
    rng = np.random.default_rng(1)
    u, v = rng.uniform(0, 2 * np.pi, (2, 4000))
    torus = np.stack([(3 + np.cos(v)) * np.cos(u), (3 + np.cos(v)) * np.sin(u), np.sin(v)], axis=1)
    ball = rng.normal(size=(4000, 3))
    ball /= np.sqrt((ball**2).sum(axis=1))[:, None]
    return {
        "torus": (torus, {}),
        "noisy torus": (torus + rng.normal(0, 0.03, torus.shape), {}),
        "torus, nearest": (torus, {"attraction": "nearest"}),
        "ball in a ball": (np.concatenate([ball, 0.4 * ball]), {"surface": "all"}),
        "half a ball": (ball[ball[:, 2] > 0], {"open": True}),
        "half a ball, closed": (ball[ball[:, 2] > 0], {}),
        "plane": (ball * [1, 1, 0], {}),
    }


def main() -> None:
    """Print everything."""
    head = phantom()
    window: dict[str, Any] = {"lower": head.lower, "upper": head.upper}
    color = Volume(np.repeat(head.volume.voxels[..., None], 3, axis=3), head.volume.affine, head.volume.grid)
    for name, changes in STUDIES.items():
        show(name, lambda changes=changes: reconstruct(head.volume, **window, **changes))
    show("paper", lambda: reconstruct(head.volume, Settings.for_paper(), **window))
    show("truth", lambda: reconstruct(head.volume, truth=head.truth, **window))
    show("color", lambda: reconstruct(color, **window))
    for name, (points, changes) in clouds().items():
        show(name, lambda points=points, changes=changes: reconstruct_points(points, **changes))
    for name, (path, changes) in REAL.items():
        if (SHARED / path).exists():
            show(name, lambda path=path, changes=changes: reconstruct(read_volume(SHARED / path), **changes))
    for name, path in CLOUDS.items():
        if (SHARED / path).exists():
            show(name, lambda path=path: reconstruct_points(read_points(SHARED / path)))
    if not SHARED.exists():
        print(f"no {SHARED}: no real studies", file=sys.stderr)


if __name__ == "__main__":
    main()
