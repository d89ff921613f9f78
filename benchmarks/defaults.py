"""What a person gets at defaults: near the data, whole, with even triangles, on every way; and in what time.

``python benchmarks/defaults.py [--row structures bone studies head ways planes]``
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import SHARED, at_least, at_most, header, holds, judged, note
from labels import STRUCTURES, STUDY, marched
from pieces import DUST, pieces_of_labels, pieces_of_mesh
from slab_peers import cubes, smoothed
from tomomesh import Settings, Volume, phantom, read_points, read_volume, reconstruct, reconstruct_points
from tomomesh.measure.report import compare
from tomomesh.measure.shape import triangle_shapes
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tomomesh.model.mesh import TriMesh
    from tomomesh.results import Surface

    Floats = NDArray[Any]
    Mask = NDArray[np.bool_]

NEAR = {"skull": (0.25, 0.42), "ventricles": (0.24, 0.32), "white matter": (0.28, 0.37)}
"""Mean distances to and from marching cubes, mm, that ``--way voxels`` had when the marks were set."""
CONTOURS: dict[str, Any] = {"contours": "loops"}
CT = "dicom2stl/ct_example.nii.gz"
BODY, BODY_LABELS = "totalsegmentator/example_ct_dicom", "totalsegmentator/example_seg_dicom.nii.gz"
ORGANS = {
    "spleen": (1,),
    "liver": (5,),
    "colon": (20,),
    "vertebrae": (32, 33),
    "ribs": (97, 98, 99, 100, 101, 102, 109, 110, 111, 112, 113, 114),
}
TILTED = "dcm_qa_ct/In/GE"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--row", nargs="+", choices=ROWS, default=list(ROWS))
    asked = parser.parse_args()
    header("At defaults", "vtk", "scikit-image")
    for row in asked.row:
        with judged(row):
            ROWS[row]()


def shared(path: str) -> bool:
    """Tell whether a study lies beside the project, and say so where it does not."""
    found = (SHARED / path).exists()
    if not found:
        note(path, "not measured: the shared data are not here")
    return found


def timed(told: str, run: Callable[[], Surface]) -> Surface:
    """Run a way once, and print its name and its time."""
    start, cpu = time.perf_counter(), time.process_time()
    found = run()
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    note(f"{told}: way, time", f"{found.report['way']['name']}, {seconds:.2f} s, {cpu:.2f} CPU s")
    return found


def structures() -> None:
    """Compare structures of a simulated head, whose labels are exact, with marching cubes of the labels."""
    if not shared(STUDY):
        return
    volume = read_volume(SHARED / STUDY)
    for name, labels in STRUCTURES.items():
        mask = np.isin(volume.voxels, labels)
        peer = marched(volume, mask)
        for told, changes, more in ((f"{name}, defaults", {}, 1.0), (f"{name}, contours", CONTOURS, 1.15)):
            with judged(told):
                mesh = timed(told, partial(reconstruct, volume, select=labels, **changes)).mesh
                away, (to, back) = compare(mesh, peer), NEAR[name]
                full(told, mesh, np.count_nonzero(mask) * volume.voxel_mm3, 2)
                at_most(f"{told}: mean distance to marching cubes", away["mean_mm"], more * to, "mm")
                at_most(f"{told}: mean distance from marching cubes", away["back_mean_mm"], more * back, "mm")
                whole(told, mesh, mask, volume)


def full(told: str, mesh: TriMesh, volume_mm3: float, percent: float) -> None:
    """Compare the volume of a mesh with what it should be."""
    over = float(mesh.face_volumes.sum()) / volume_mm3
    at_most(f"{told}: volume off its data's own, found {over:.3f} of it", 100 * abs(over - 1), percent, "%")


def whole(told: str, mesh: TriMesh, mask: Mask, volume: Volume) -> None:
    """Compare pieces and handles with those of the voxels, dust left out of both."""
    ours, voxels = pieces_of_mesh(mesh, DUST * volume.voxel_mm3), pieces_of_labels(mask)
    for what, found, (low, high) in zip(("pieces", "handles"), ours, voxels, strict=True):
        holds(f"{told}: {what}, found {found}, of the voxels {low} to {high}", low <= found <= high)


def bone() -> None:
    """Compare the bone of a CT with marching cubes of its gray levels, and with these smoothed as 3D Slicer does."""
    if not shared(f"data/{CT}"):
        return
    volume, told = read_volume(SHARED / "data" / CT), "CT, bone, defaults"
    found = timed(told, partial(reconstruct, volume, preset="bone"))
    levels, level = as_kept(found, volume)
    exact, pixel = cubes(levels, level, 1), min(volume.spacing_mm)
    mask = Volume.from_stored((levels.voxels > level).astype(np.float32), levels.affine)
    away, turn = compare(found.mesh, exact), turns(found.mesh)
    at_most(f"{told}: mean distance to marching cubes", away["mean_mm"] / pixel, 0.06, "voxel")
    at_most(f"{told}: mean distance from marching cubes", away["back_mean_mm"] / pixel, 0.06, "voxel")
    for name, peer in (("levels", smoothed(exact)), ("mask", smoothed(cubes(mask, 0.5, 1)))):
        theirs, mark = compare(peer, exact), f"windowed sinc's on the {name}"
        at_most(f"{told}: mean turn between faces over {mark}", turn / turns(peer), 0.75)
        at_most(f"{told}: distance to over {mark}", away["mean_mm"] / theirs["mean_mm"], 1)
        at_most(f"{told}: distance from over {mark}", away["back_mean_mm"] / theirs["back_mean_mm"], 1)


def as_kept(found: Surface, volume: Volume) -> tuple[Volume, float]:
    """Return gray levels whose window is what was kept: mirrored at the level where they are not; and the level."""
    segmentation = found.segmentation
    assert segmentation is not None
    study, level = segmentation.volume, float(found.report["window"]["lower"])
    levels = study.voxels.astype(np.float32)
    other = (levels > level) != segmentation.mask
    window = np.count_nonzero(volume.voxels > level)
    note("kept of the window's voxels", f"{100 * np.count_nonzero(segmentation.mask) / window:.1f} %")
    return Volume.from_stored(np.where(other, 2 * np.float32(level) - levels, levels), study.affine), level


def turns(mesh: TriMesh) -> float:
    return triangle_shapes(mesh)["mean_turn_deg"]


def studies() -> None:
    """Compare structures of a body and bones of two CT studies with their own voxels."""
    if shared(f"data/{BODY_LABELS}"):
        volume = read_volume(SHARED / "data" / BODY_LABELS)
        for name, labels in ORGANS.items():
            mask = np.isin(volume.voxels, labels)
            with judged(f"body, {name}"):
                found = timed(f"body, {name}", partial(reconstruct, volume, select=labels))
                follows(f"body, {name}", found, marched(volume, mask), volume, mask)
    for told, path, uneven in (("body, bone", BODY, False), ("tilted head, bone", TILTED, True)):
        if shared(f"data/{path}"):
            volume = read_volume(SHARED / "data" / path, settings=ReadSettings(resample_slices=uneven))
            with judged(told):
                found = timed(told, partial(reconstruct, volume, preset="bone"))
                levels, level = as_kept(found, volume)
                follows(told, found, cubes(levels, level, 1), levels, levels.voxels > level)


def follows(told: str, found: Surface, peer: TriMesh, volume: Volume, mask: Mask) -> None:
    """Hold a surface against its voxels: 3 % of the volume, half a voxel both ways."""
    full(told, found.mesh, np.count_nonzero(mask) * volume.voxel_mm3, 3)
    away, voxel = compare(found.mesh, peer), min(volume.spacing_mm)
    at_most(f"{told}: mean distance to marching cubes", away["mean_mm"] / voxel, 0.5, "voxel")
    at_most(f"{told}: mean distance from marching cubes", away["back_mean_mm"] / voxel, 0.5, "voxel")


def head() -> None:
    """Compare the built-in head with its exact surface."""
    known, told = phantom(), "built-in head, defaults"
    found = timed(told, partial(reconstruct, known.volume, lower=known.lower, upper=known.upper, truth=known.truth))
    truth, quality = found.report["truth"], found.report["quality"]
    at_most(f"{told}: mean distance to the exact surface", truth["mean_mm"], 0.15, "mm")
    at_most(f"{told}: 95 % of the distances", truth["p95_mm"], 0.35, "mm")
    note(
        f"{told}: from the exact surface, mean and 95 %", f"{truth['back_mean_mm']:.3f}, {truth['back_p95_mm']:.3f} mm"
    )
    holds(f"{told}: one component of genus 0", (quality["components"], quality["genus"]) == (1, 0))


def ways() -> None:
    """Look at the triangles of every way."""
    for told, run in every_way().items():
        with judged(told):
            found = timed(told, run)
            angles = np.percentile(smallest_angles(found.mesh), [1, 50])
            at_least(f"{told}: 1 % of the faces' smallest angles", angles[0], 25, "degrees")
            at_least(f"{told}: median of the faces' smallest angles", angles[1], 45, "degrees")
            at_most(f"{told}: faces through others", found.report["quality"]["self_intersections"], 0)


def every_way() -> dict[str, Callable[[], Surface]]:
    """Return a run of every way: of the built-in head, and of what lies beside the project."""
    known = phantom()
    window: dict[str, Any] = {"lower": known.lower, "upper": known.upper}
    runs: dict[str, Callable[[], Surface]] = {
        "rings, built-in head": partial(reconstruct, known.volume, **window),
        "paper, built-in head": partial(reconstruct, known.volume, Settings.for_paper(), **window),
        "voxels, built-in head": partial(reconstruct, known.volume, network="none", **window),
    }
    if shared(STUDY):
        volume = read_volume(SHARED / STUDY)
        for name, labels in STRUCTURES.items():
            runs[f"contours, {name}"] = partial(reconstruct, volume, select=labels, **CONTOURS)
            runs[f"voxels, {name}"] = partial(reconstruct, volume, select=labels, network="none")
        runs["sphere, ventricles"] = partial(reconstruct, volume, select=STRUCTURES["ventricles"], network="sphere")
    clouds = SHARED / "data" / "clouds"
    if shared("data/clouds"):
        noisy, stack = (
            read_points(clouds / path) for path in ("wnnc/bunny_noised.xyz", "contours/torus_sphere_5to1.xyz")
        )
        runs["cloud, noisy scan"] = partial(reconstruct_points, noisy)
        runs["nearest, noisy scan"] = partial(reconstruct_points, noisy, attraction="nearest")
        runs["stack, torus and ball"] = partial(reconstruct_points, stack)
    return runs


def smallest_angles(mesh: TriMesh) -> Floats:
    """Return the smallest angle of each face, degrees: that opposite of its shortest side."""
    sides = np.linalg.norm(mesh.corners - np.roll(mesh.corners, 1, axis=1), axis=2)
    a, b, c = np.sort(sides, axis=1).T
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = (b * b + c * c - a * a) / (2 * b * c)
    return np.asarray(np.degrees(np.arccos(np.nan_to_num(cosine, nan=1.0).clip(-1, 1))))


def planes() -> None:
    """Close two balls in one cloud, slices 6 mm apart, one's planes a little above the other's."""
    heights = 6.0 * np.arange(-5, 6)
    small, large = (np.sqrt(radius**2 - heights**2) for radius in (32, 36))
    for above in (0.5, 1.0, 3.0):
        told = f"two objects, planes {above:g} mm apart"
        with judged(told):
            points = np.concatenate([*circles(0, 0, small, heights), *circles(80, 10, large, heights + above)])
            found = timed(told, partial(reconstruct_points, points))
            pieces, genus = (found.report["quality"][name] for name in ("components", "genus"))
            holds(f"{told}: two pieces of genus 0, found {pieces}, {genus}", (pieces, genus) == (2, 0))
            full(told, found.mesh, frusta(small, 6.0) + frusta(large, 6.0), 2)


def circles(x: float, y: float, radii: Floats, heights: Floats) -> list[Floats]:
    """Return a circle of points a millimeter apart on each plane."""
    rings = []
    for radius, height in zip(radii, heights, strict=True):
        turn = np.linspace(0, 2 * np.pi, round(2 * np.pi * radius), endpoint=False)
        rings.append(
            np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn), np.full(len(turn), height)])
        )
    return rings


def frusta(radii: Floats, step: float) -> float:
    """Return the volume of cones cut off, one between each two circles."""
    a, b = radii[:-1], radii[1:]
    return float((np.pi * step / 3 * (a * a + a * b + b * b)).sum())


ROWS: dict[str, Callable[[], None]] = {
    row.__name__: row for row in (structures, bone, studies, head, ways, planes)
}  # fmt: skip


if __name__ == "__main__":
    main()
