"""Thick slices: surfaces of slabs made of thin studies, beside those of peers, against the surface of the thin study.

``python benchmarks/slabs.py [--study 01 13 MR CT] [--thick 2 4 6] [--data levels labels] [--quick] [--each]``
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.ndimage import distance_transform_edt, label

from bench import SHARED, at_most, header, judged, note
from slab_peers import ITK, ITK_PACKAGE, PEERS, SINC, cubes
from tomomesh import Volume, read_volume, reconstruct
from tomomesh.measure.distance import distance_to_surface
from tomomesh.measure.links import Links
from tomomesh.measure.report import area_samples
from tomomesh.measure.shape import lengths_and_turns, shapes_of_edges
from tomomesh.measure.tree import Tree
from tomomesh.segmentation.otsu import otsu_threshold

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from slab_peers import Floats, Peer
    from tomomesh.model.mesh import TriMesh

SKULL = (515, 516)
STUDIES: dict[str, tuple[str, tuple[int, ...], float | None]] = {
    "01": ("synthseg/training_seg_01.nii.gz", SKULL, 0.5),
    "13": ("synthseg/training_seg_13.nii.gz", SKULL, 0.5),
    "MR": ("volrender/seg3D/MR.nii.gz", (), None),
    "CT": ("dicom2stl/ct_example.nii.gz", (), 300.0),
}
"""Label heads, of which the skull is taken; a head of gray levels, whose skin is what lies above Otsu's level; and one
whose bone is what lies above 300 HU, of slices so thick that pairs of them tell more than slabs of four."""
USUAL = ("01", "13", "MR")
WAYS: dict[str, dict[str, Any]] = {
    "defaults": {},
    "--way voxels": {"way": "voxels"},
    "--way contours": {"way": "contours"},
}
COMMON = 12
"""Slices that every thickness divides: of the thin study as many are left as whole slabs of each hold."""
MARGIN = 4
"""Voxels that are kept around the structure."""
SAMPLES = 100_000
"""Samples of each surface. The standard error of their mean is 0.3 % of the spread."""
BALL_MM = 5.0
"""Radius of the ball that must reach a place of the skin from outside for it to count. Chosen: nostrils and the canals
of the ears are narrower than the ball is wide, what lies between lips and behind ears is left out too."""
SHARE = 0.88
"""Of the best peer's distance: the mark."""


@dataclass(frozen=True)
class Thin:
    """A thin study, the level of its surface, and which part of that counts (``None``: all)."""

    volume: Volume
    level: float
    ball_mm: float | None = None


@dataclass(frozen=True)
class Truth:
    """A true surface, which of its faces count, and samples of these."""

    mesh: TriMesh
    counts: NDArray[np.bool_]

    @cached_property
    def tree(self) -> Tree:
        return Tree.of_faces(self.mesh)

    @cached_property
    def samples(self) -> Floats:
        return area_samples(self.mesh, SAMPLES, leave_out=~self.counts)

    @cached_property
    def volume_mm3(self) -> float:
        return float(self.mesh.face_volumes.sum())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--study", nargs="+", choices=STUDIES, default=list(USUAL))
    parser.add_argument("--thick", nargs="+", type=int, choices=(2, 3, 4, 6), default=[4, 6], help="slices of a slab")
    parser.add_argument("--data", nargs="+", choices=("levels", "labels"), default=["levels", "labels"])
    parser.add_argument("--quick", action="store_true", help="a quarter of each study alone")
    parser.add_argument("--each", action="store_true", help="all that is measured of every peer")
    asked = parser.parse_args()
    itk = (ITK_PACKAGE,) if ITK in PEERS else ()
    header("Slabs of thin slices, against the surface of the thin study", "vtk", "scikit-image", *itk)
    for name in asked.study:
        if not (SHARED / "data" / STUDIES[name][0]).exists():
            note(name, "not measured: the shared data are not here")
            continue
        study = thin(name, quick=asked.quick)
        true = truth(study)
        for thick in asked.thick:
            for data in asked.data:
                case(f"{name}, {thick} slices, {data}", study, true, thick, data, each=asked.each)


def case(told: str, study: Thin, true: Truth, thick: int, data: str, *, each: bool) -> None:
    """Measure all peers, then every way of ours, on one set of slabs; the marks are for the defaults."""
    slabs = majority(study.volume, thick, study.level) if data == "labels" else slab(study.volume, thick)
    level = 0.5 if data == "labels" else study.level
    peers = {name: timed(peer, slabs, level, thick, true) for name, peer in PEERS.items()}
    for name, found in peers.items() if each else ():
        note(f"{told}: {name}", in_words(found))
    note(f"{told}: mean mm", ", ".join(f"{name} {found['mean']:.3f}" for name, found in peers.items()))
    best, turn = min(found["mean"] for found in peers.values()), peers[SINC]["turn"]
    for name, changes in WAYS.items():
        with judged(f"{told}: {name}"):
            found = timed(ours(changes, data), slabs, level, thick, true)
            note(f"{told}: {name}, {found['mean'] / best:.3f} of the best peer's", in_words(found))
            if not changes:
                at_most(f"{told}: {name}: mean of both ways over the best peer's", found["mean"] / best, SHARE)
                at_most(f"{told}: {name}: mean turn over windowed sinc's {turn:.1f} degrees", found["turn"] / turn, 1)


def timed(make: Peer, slabs: Volume, level: float, thick: int, true: Truth) -> dict[str, float]:
    """Make a surface, and measure it and the time that it takes; ITK works in a process of its own, not in CPU s."""
    start, cpu = time.perf_counter(), time.process_time()
    mesh = make(slabs, level, thick)
    took = {"seconds": time.perf_counter() - start, "cpu_s": time.process_time() - cpu, "faces": len(mesh.faces)}
    return score(mesh, true) | took


def in_words(found: dict[str, float]) -> str:
    return (
        f"there {found['there']:.3f}, back {found['back']:.3f}, mean {found['mean']:.3f} mm, turn {found['turn']:.1f} "
        f"degrees, volume {found['volume']:.3f}, {found['faces']:,} faces, {found['seconds']:.1f} s, "
        f"{found['cpu_s']:.1f} CPU s"
    )


def score(mesh: TriMesh, true: Truth) -> dict[str, float]:
    """Measure mean distances to the truth and back in mm, mean turn in degrees, and volume over the true one.

    A sample of the mesh counts where the nearest face of the true surface does.
    """
    away, face = true.tree.nearest(area_samples(mesh, SAMPLES))
    there = float(away[true.counts[face]].mean())
    back = float(distance_to_surface(true.samples, mesh).mean())
    links = Links(mesh)
    turn = shapes_of_edges(*lengths_and_turns(links), int((links.uses == 2).sum()))["mean_turn_deg"]
    volume = float(mesh.face_volumes.sum()) / true.volume_mm3
    return {"there": there, "back": back, "mean": (there + back) / 2, "turn": turn, "volume": volume}


def thin(name: str, *, quick: bool = False) -> Thin:
    """Read a thin study, cropped to its structure: levels 0 and 1 of a label head, gray levels of the other."""
    file, labels, level = STUDIES[name]
    volume = read_volume(SHARED / "data" / file)
    levels = np.isin(volume.voxels, labels) if labels else volume.voxels
    ball_mm = BALL_MM if level is None else None
    level = otsu_threshold(levels) if level is None else level
    volume = replace(volume, voxels=levels.astype(np.float32))
    box = _box(volume.voxels > level, quick=quick)
    return Thin(volume.cropped(box), level, ball_mm)


def _box(mask: NDArray[np.bool_], *, quick: bool) -> tuple[slice, slice, slice]:
    """Return the part around a structure, of whole slabs; for a quick look the left half of its upper half."""
    ranges = []
    for axis in range(3):
        found = np.flatnonzero(mask.any(axis=tuple(other for other in range(3) if other != axis)))
        ranges.append((max(int(found[0]) - MARGIN, 0), min(int(found[-1]) + MARGIN + 1, mask.shape[axis])))
    (low, high), rows, (left, right) = ranges
    if quick:
        low, left = (low + high) // 2, (left + right) // 2
    slabs = -(-(high - low) // COMMON) * COMMON
    low = max(min(low, mask.shape[0] - slabs), 0)
    slabs = min(slabs, (mask.shape[0] - low) // COMMON * COMMON)
    return slice(low, low + slabs), slice(*rows), slice(left, right)


def truth(study: Thin) -> Truth:
    """Return marching cubes of the thin study; of a skin, what a ball can touch from outside counts."""
    mesh = cubes(study.volume, study.level, 1)
    counts = np.ones(len(mesh.faces), bool)
    return Truth(mesh, counts if study.ball_mm is None else _reached(study, mesh, study.ball_mm))


def _reached(study: Thin, mesh: TriMesh, ball_mm: float) -> NDArray[np.bool_]:
    """Tell which faces a ball touches that rolls about the study; a voxel's width is allowed for the lattice."""
    spacing = study.volume.spacing_mm[::-1]
    around = int(2 * ball_mm / min(spacing)) + 2
    free = distance_transform_edt(np.pad(study.volume.voxels <= study.level, around, constant_values=True), spacing)
    parts = label(free > ball_mm)[0]
    to_ball = distance_transform_edt(parts != parts[0, 0, 0], spacing)
    index = np.rint(study.volume.to_indices(mesh.corners.mean(axis=1))).astype(int) + around
    i, j, k = index.T
    return np.asarray(to_ball[k, j, i] <= ball_mm + max(spacing))


def slab(volume: Volume, thick: int) -> Volume:
    """Average every so many slices, as a scanner with thick slices does; labels become partial volumes."""
    return _thicker(volume, _groups(volume, thick).mean(axis=1, dtype=np.float32), thick)


def majority(volume: Volume, thick: int, level: float) -> Volume:
    """Label every slab by most of its slices: 0 or 1.

    A tie goes to the slice above the slab's middle and to that below it by turns: always out or always in would take
    or give a tenth of the skull's volume.
    """
    inside = _groups(volume, thick) > level
    votes = 2 * inside.sum(axis=1) - thick
    middle = np.where(np.arange(len(votes)) % 2, thick // 2, (thick - 1) // 2)
    tie = inside[np.arange(len(votes)), middle]
    return _thicker(volume, np.where(votes == 0, tie, votes > 0).astype(np.uint8), thick)


def _groups(volume: Volume, thick: int) -> Floats:
    slabs = volume.shape[0] // thick
    return volume.voxels[: slabs * thick].reshape(slabs, thick, *volume.shape[1:])


def _thicker(volume: Volume, voxels: Floats, thick: int) -> Volume:
    """Return slabs, each at the middle of its slices."""
    affine = volume.affine.copy()
    affine[:3, 3] += (thick - 1) / 2 * affine[:3, 2]
    affine[:3, 2] *= thick
    return Volume.from_stored(voxels, affine)


def ours(changes: dict[str, Any], data: str) -> Peer:
    def run(slabs: Volume, level: float, thick: int) -> TriMesh:
        chosen: dict[str, Any] = {"select": (1,)} if data == "labels" else {"lower": level}
        return reconstruct(slabs, **chosen, **changes).mesh

    return run


if __name__ == "__main__":
    main()
