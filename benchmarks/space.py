"""One network in space: its own faces beside marching cubes of the same window."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage
from skimage.measure import marching_cubes

from bench import SHARED, at_most, header, holds, note
from tomomesh import Volume, phantom, read_volume, reconstruct
from tomomesh.measure.distance import distance_to_surface
from tomomesh.model.mesh import TriMesh
from tomomesh.segmentation.otsu import otsu_threshold
from tomomesh.segmentation.space import pieces_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

DERIVED = SHARED / "data" / "derived"
STRUCTURES = {"ventricles": (4, 43, 14, 15), "white matter": (2, 41)}


def main() -> None:
    header("One network in space, 2,562 neurons", "scikit-image")
    for name, network, volume, lower in cases():
        compared(name, network, volume, lower)
    skull()


def cases() -> Iterator[tuple[str, str, Volume, float]]:
    """Yield a name, a network, a study and its lower limit."""
    yield "torus", "torus", torus(), 50.0
    yield "built-in head, skin", "sphere", phantom().volume, 60.0
    if not DERIVED.is_dir():
        note("two heads", "not measured: the shared data are not beside the project")
        return
    labels = read_volume(DERIVED / "dev54_synth_t1" / "dev54_synth_t1_labels.nii.gz")
    for name, wanted in STRUCTURES.items():
        yield name, "sphere", replace(labels, voxels=np.isin(labels.voxels, wanted).view(np.uint8)), 0.5
    head = read_volume(DERIVED / "dev54_t1" / "dev54_t1.nii.gz")
    yield "head, Otsu's window", "sphere", head, otsu_threshold(head.voxels)


def torus() -> Volume:
    """Paint a torus of tube 9 and ring 22 voxels."""
    k, j, i = np.indices((40, 80, 80)) - np.array([19.5, 39.5, 39.5])[:, None, None, None]
    away = np.hypot(np.hypot(i, j) - 22, k)
    return Volume.from_stored(np.asarray(100 * np.clip(0.5 + (9 - away) / 2, 0, 1), np.uint8), np.eye(4))


def compared(name: str, network: str, volume: Volume, lower: float) -> None:
    """Lay a network around a window, and measure both ways."""
    begun = time.perf_counter()
    made = reconstruct(volume, lower=lower, network=network, allow_far=True)  # one network may be far: that is measured
    seconds = time.perf_counter() - begun
    quality, column = made.report["quality"], volume.spacing_mm[0]
    other = cubes_of(volume, lower)
    there = distance_to_surface(made.mesh.vertices, other) / column
    back = distance_to_surface(other.vertices, made.mesh) / column
    holds(f"{name}: closed, outward, of its genus", quality["sound"] and quality["genus"] == (network == "torus"))
    at_most(f"{name}: faces that pass through others", quality["self_intersections"], 0)
    at_most(f"{name}: to marching cubes, mean", float(there.mean()), 1.0, "columns")
    at_most(f"{name}: back, mean", float(back.mean()), 1.0, "columns")
    note(f"{name}: back, 95 % and largest", f"{np.percentile(back, 95):.2f} and {back.max():.1f} columns")
    note(f"{name}: time", f"{seconds:.1f} s")


def cubes_of(volume: Volume, lower: float) -> TriMesh:
    """Return marching cubes of a window, its cavities filled and its small pieces left out."""
    kept, _ = pieces_of(volume.voxels > lower)
    filled = np.asarray(ndimage.binary_fill_holes(kept), bool)
    levels: NDArray[np.float64] = np.where(kept, volume.voxels, np.minimum(volume.voxels, lower)).astype(np.float64)
    levels[filled & ~kept] = lower + 1
    vertices, faces, _, _ = marching_cubes(np.pad(levels, 1, constant_values=float(levels.min())), lower)
    return TriMesh(volume.to_mm(vertices[:, ::-1].astype(np.float64) - 1), faces.astype(np.int64))


def skull() -> None:
    """Lay a sphere along the middle of the built-in head's skull, whose place is known."""
    head = phantom()
    made = reconstruct(head.volume, lower=head.lower, upper=head.upper, network="sphere")
    away = distance_to_surface(head.truth.vertices, made.mesh)
    at_most("built-in head, skull: from the exact middle surface, mean", float(away.mean()), 0.3, "mm")


if __name__ == "__main__":
    main()
