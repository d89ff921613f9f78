"""A study to a surface: with networks and without, beside VTK's surface nets and scikit-image's marching cubes.

VTK's filter smooths sixteen times and ends there. Ours are checked to be closed manifolds, judged against their
window, and, with networks, made of even triangles; what that takes is in the rows without marks.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import SHARED, costs, note, race
from study import _surface_nets
from tomomesh import Volume, phantom, read_volume, reconstruct, window
from voxels import marched, padded, surface

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

WALL, CPU = 1.0, 1.5
"""Marks of a study with networks, over surface nets."""
BARE = 1.2
"""Mark of a study without a network, over surface nets."""
CT, BONE = SHARED / "data/dicom2stl/ct_example.nii.gz", 300.0
LABELS = SHARED / "data/derived/dev54_synth_t1/dev54_synth_t1_labels.nii.gz"
SKULL = (515, 516)


def main() -> None:
    if find_spec("vtk") is None:
        note("a study beside VTK", "not measured: vtk is not installed")
        return
    networks()
    for name, volume, lower in bare():
        without(name, volume, lower)


def networks() -> None:
    """Race `reconstruct()` at defaults, and what it does besides a surface."""
    head = phantom()
    window_of: dict[str, Any] = {"lower": head.lower, "upper": head.upper}
    ours, nets, report, uneven = costs(
        lambda: reconstruct(head.volume, **window_of),
        _surface_nets(window(head.volume, **window_of), head.volume),
        lambda: reconstruct(head.volume, **window_of).report,
        lambda: reconstruct(head.volume, remesh=False, **window_of),
    )
    race("54 slices by networks over surface nets", ours, nets, CPU, wall=WALL)
    note("54 slices by networks, report read: CPU, ratio", f"{report.cpu / nets.cpu:.3g}")
    note("54 slices by networks, --no-remesh: CPU, ratio", f"{uneven.cpu / nets.cpu:.3g}")


def bare() -> Iterator[tuple[str, Volume, float]]:
    """Yield the built-in head, and the studies beside the project where they are there."""
    head = phantom()
    yield "built-in head", head.volume, head.lower
    if CT.exists():
        yield "CT, bone", read_volume(CT), BONE
    if LABELS.exists():
        whole = read_volume(LABELS)
        chosen = np.isin(whole.voxels, SKULL).astype(np.uint8)
        yield "skull of a label map", Volume.from_stored(chosen, whole.affine), 0.5
    if not (CT.exists() and LABELS.exists()):
        note("studies without a network", "some are not measured: the shared data are not beside the project")


def without(name: str, volume: Volume, lower: float) -> None:
    """Race the mesh of a window's own voxels, checked."""
    calls: list[Callable[[], Any]] = [
        lambda: surface(volume, lower),
        _surface_nets(np.pad(window(volume, lower=lower), 1), volume),
    ]
    if find_spec("skimage") is not None:
        levels = padded(volume, lower)
        calls.append(lambda: marched(levels, lower))
    ours, nets, *cubes = costs(*calls, repeats=5)
    (whole,) = costs(lambda: reconstruct(volume, lower=lower, network="none", divide=False), repeats=1)
    race(f"{name}, --network none over surface nets", ours, nets, BARE, wall=BARE)
    for other in cubes:
        note(f"{name}, --network none over marching cubes: CPU, ratio", f"{ours.cpu / other.cpu:.3g}")
    note(f"{name}, --network none, judged and even too, over surface nets: CPU, ratio", f"{whole.cpu / nets.cpu:.3g}")


if __name__ == "__main__":
    main()
