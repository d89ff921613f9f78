"""Structures of a head by a ring for every outline and by one ring a slice, both beside marching cubes."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import SHARED, at_most, header, holds, judge, note
from tomomesh import read_volume, reconstruct
from tomomesh.measure.contour import crossings, crossings_between
from tomomesh.measure.distance import distance_to_surface
from tomomesh.measure.report import area_samples, compare
from tomomesh.model.mesh import TriMesh
from tomomesh.segmentation.contours.loops import trace
from tomomesh.segmentation.contours.train import train_contours
from tomomesh.settings import NetworkSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh import Volume

STUDY = "data/derived/dev54_synth_t1/dev54_synth_t1_labels.nii.gz"
STRUCTURES = {"skull": (515, 516), "ventricles": (4, 43, 14, 15), "white matter": (2, 41)}
MARKS = {"skull": (0.25, 0.42), "ventricles": (0.24, 0.32), "white matter": (0.28, 0.37)}
"""Mean distances to and from marching cubes that the boundary of the voxels themselves had, mm."""
NEARLY = 1.15
"""Of these: the mark for networks."""
VOLUME = 0.02
"""Share of the labels' volume by which a surface may differ."""
CT = "data/dicom2stl/ct_example.nii.gz"
NEURONS = 400
SEEDS = 100


def main() -> None:
    header("Several contours in a slice: two-sided walls, and structures of a head", "scikit-image")
    walls()
    path = SHARED / STUDY
    if not path.exists():
        raise SystemExit("not measured: the shared data are not beside the project")
    volume = read_volume(path)
    for name, labels in STRUCTURES.items():
        structure(name, volume, labels)
    bone()


def walls() -> None:
    """Measure two rings on two walls of known place, 80 neurons in all."""
    band = judge("band")
    images = np.stack([band.slice_image("walls", seed=seed) for seed in range(SEEDS)])
    mask = (images > 200) & (images <= 500)
    for kind in ("walls", "components"):
        found = train_contours(mask, NetworkSettings(contours=kind, neurons=80))
        slices = [[ring.codebook[:, ::-1] for ring in found.on(k)] for k in range(SEEDS)]
        lines = band.lines("walls")
        holds(f"{kind}: two rings in every slice", all(len(rings) == 2 for rings in slices))
        for side, line in zip(("outer", "inner"), lines, strict=True):
            away = [_to_line(rings, line) for rings in slices]
            at_most(f"{kind}: mean distance to the {side} line, {SEEDS} seeds", float(np.mean(away)), 0.13, "px")
        farthest = max(float(band.coverage(np.concatenate(rings), "walls").max()) for rings in slices)
        at_most(f"{kind}: farthest point of a line from a neuron", farthest, 8, "px")
        tangles = sum(int(crossings_between(rings).sum()) for rings in slices)
        at_most(f"{kind}: crossings", tangles, 0)
    one = train_contours(mask, NetworkSettings(contours="loops", neurons=80))
    note("loops: rings of a slice", f"{len(one) / SEEDS:.3g}")
    holds("loops: no crossing", not any(crossings(ring.codebook) for ring in one.contours))


def _to_line(rings: list[NDArray[np.float64]], line: NDArray[np.float64]) -> float:
    """Return the mean distance to a line of the ring that is nearest to it."""
    ends = np.linspace(0, len(line), 4000, endpoint=False).astype(int)
    each = [np.sqrt(((ring[:, None] - line[ends]) ** 2).sum(axis=2)).min(axis=1).mean() for ring in rings]
    return float(min(each))


def structure(name: str, volume: Volume, labels: tuple[int, ...]) -> None:
    """Compare the surfaces of a structure with marching cubes on the same labels."""
    mask = np.isin(volume.voxels, labels)
    peer = marched(volume, mask)
    pixel = min(volume.spacing_mm[:2])
    for kind, neurons in (("loops", None), ("loops", NEURONS), ("loops", 58), ("one", 200), ("one", 58)):
        start = time.perf_counter()
        # one ring a slice is no skull, and would be refused for it: shown to tell what rings for every outline gain
        found = reconstruct(volume, select=labels, contours=kind, neurons=neurons, allow_far=kind == "one")
        seconds = time.perf_counter() - start
        away, told = compare(found.mesh, peer), f"{name}, {kind}, {neurons or 'counted'} neurons"
        ways = {"to marching cubes": away["mean_mm"], "from marching cubes": away["back_mean_mm"]}
        if kind == "one":
            note(told, ", ".join(f"{way} {mean:.3f} mm" for way, mean in ways.items()))
            continue
        marks = [pixel] * 2 if neurons else [NEARLY * mark for mark in MARKS[name]]
        for (way, mean), mark in zip(ways.items(), marks, strict=True):
            at_most(f"{told}: mean distance {way}", mean, mark, "mm")
        _sides(told, found.mesh, peer, volume, mask, pixel)
        quality = found.report["quality"]
        holds(f"{told}: closed and manifold", bool(quality["sound"] and quality["sound_after_welding"]))
        note(f"{told}: pieces, faces through others", f"{quality['components']}, {quality['self_intersections']}")
        over = quality["volume_mm3"] / _volume(volume, mask)
        note(f"{told}: volume over the labels' own", f"{over:.3f}")
        if neurons is None:
            at_most(f"{told}: difference from it", abs(over - 1), VOLUME)
        note(f"{told}: time", f"{seconds:.1f} s")


def _volume(volume: Volume, mask: NDArray[np.bool_]) -> float:
    return float(mask.sum() * np.prod(volume.spacing_mm))


def _sides(told: str, mesh: TriMesh, peer: TriMesh, volume: Volume, mask: NDArray[np.bool_], pixel: float) -> None:
    """Measure outer and inner surface each by itself: what lies next to a hole of its slice is inner."""
    samples = area_samples(peer, 20_000)
    away = distance_to_surface(samples, mesh)
    inner = _in_holes(samples, volume, mask)
    if inner.mean() < 0.2:
        return
    for side, chosen in (("outer", ~inner), ("inner", inner)):
        at_most(
            f"{told}: mean distance from the {side} surface of marching cubes", float(away[chosen].mean()), pixel, "mm"
        )


def _in_holes(places: NDArray[np.float64], volume: Volume, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which places lie nearer to a hole of their slice than to its outside."""
    from scipy.ndimage import distance_transform_edt, label

    outside = np.stack([_outside(label(~np.pad(plane, 1))[0])[1:-1, 1:-1] for plane in mask])
    to_outside, to_hole = (np.stack([distance_transform_edt(~p) if p.any() else np.full(p.shape, 1e9) for p in planes])
                           for planes in (outside, ~mask & ~outside))  # fmt: skip
    index = np.linalg.solve(volume.affine[:3, :3], (places - volume.affine[:3, 3]).T).T
    i, j, k = (np.rint(index).astype(int).clip(0, np.array(mask.shape[::-1]) - 1)).T
    return np.asarray(to_hole[k, j, i] < to_outside[k, j, i])


def _outside(background: NDArray[Any]) -> NDArray[np.bool_]:
    return np.asarray(background == background[0, 0])


def bone() -> None:
    """Measure the bone of a CT, whose true surface is not known, against the boundary of its own window."""
    volume = read_volume(SHARED / CT)
    mask = volume.voxels > 300
    found = reconstruct(volume, preset="bone", contours="loops", neurons=NEURONS)
    away = compare(found.mesh, marched(volume, mask))
    quality = found.report["quality"]
    holds("CT bone, loops: closed and manifold", bool(quality["sound"] and quality["sound_after_welding"]))
    pixel = min(volume.spacing_mm[:2])
    at_most("CT bone, loops: mean distance to the window's boundary", away["mean_mm"], pixel, "mm")
    at_most("CT bone, loops: mean distance from the window's boundary", away["back_mean_mm"], pixel, "mm")
    holes = sum(loop.area < 0 for plane in mask for loop in trace(plane))
    note("CT bone: holes of the window in all slices", f"{holes}")
    note("CT bone, loops: volume over the window's own", f"{quality['volume_mm3'] / _volume(volume, mask):.3f}")


def marched(volume: Volume, mask: NDArray[np.bool_]) -> TriMesh:
    """Return scikit-image's marching cubes of a mask, in patient millimeters."""
    from skimage.measure import marching_cubes

    places, faces, _, _ = marching_cubes(np.pad(mask, 1).astype(np.float32), 0.5)
    return TriMesh(volume.to_mm(places[:, ::-1] - 1.0), faces.astype(np.int64))


if __name__ == "__main__":
    main()
