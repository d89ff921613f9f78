"""Components of what is kept that are picked by a place in them: kept alone, or left out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import EmptyError
from ..isosurface.runs import Runs
from .body import Components
from .crop import NEAR

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..isosurface.run_mask import RunMask
    from ..model.volume import Volume

    Place = Sequence[float]
    Mask = NDArray[np.bool_]


def picked(
    mask: RunMask, volume: Volume, *, keep_at: Sequence[Place] | None = None, drop_at: Sequence[Place] | None = None
) -> Components:
    """Keep the components that hold some places, all of them where none are given, less those that hold others.

    Parameters
    ----------
    mask : RunMask
        Its voxels touch along faces, edges and at corners.
    volume : Volume
        The study on the same grid.
    keep_at, drop_at : sequence of (float, float, float)
        Patient millimeters; of a component any place in any of its voxels.

    Raises
    ------
    EmptyError
        Where a place lies in no component, or none is left.
    """
    runs = Runs.of(mask, corners=True)
    kept = np.full(len(runs.sizes), keep_at is None)
    for place in keep_at or ():
        kept[_component_at(runs, volume, place, "--keep-at")] = True
    for place in drop_at or ():
        kept[_component_at(runs, volume, place, "--drop-at")] = False
    if not kept.any():
        raise EmptyError(
            "no component is left", found=f"--drop-at in each of {len(kept) if keep_at is None else len(keep_at)}",
            expected="one at least",
        )  # fmt: skip
    return Components(runs.only(kept), len(kept), int(np.count_nonzero(~kept)))


def component_at(runs: Runs, volume: Volume, place: Place) -> int | None:
    """Return the component whose voxel holds a place in the patient, mm; None where there is none."""
    index = volume.to_indices(np.array([place], np.float64))[0, ::-1]
    k, j, i = (int(n) for n in np.floor(index + 0.5 + NEAR))
    inside = all(0 <= n < size for n, size in zip((k, j, i), runs.mask.shape, strict=True))
    return runs.part_at(k, j, i) if inside and runs.mask.plane(0, k)[j, i] else None


def _component_at(runs: Runs, volume: Volume, place: Place, option: str) -> int:
    found = component_at(runs, volume, place)
    if found is None:
        nearest, far = _nearest(runs.mask, volume, place)
        raise EmptyError(
            "no component that is kept lies at a place", found=f"{option} {_said(place)}",
            expected=f"a place in one; the nearest, {far:.3g} mm away, is {_said(nearest)}",
        )  # fmt: skip
    return found


def _nearest(mask: RunMask, volume: Volume, place: Place) -> tuple[Place, float]:
    """Return the middle of the voxel of each run that is nearest along it to a place, and of these the nearest."""
    rows, column = mask.rows, volume.to_indices(np.array([place], np.float64))[0, 0]
    k, j = np.divmod(rows, mask.shape[1])
    middles = volume.to_mm(np.column_stack([np.clip(column, mask.starts, mask.stops - 1), j, k]).astype(np.float64))
    away = np.sqrt(((middles - np.asarray(place)) ** 2).sum(axis=1))
    return middles[int(np.argmin(away))].tolist(), float(away.min())


def _said(place: Place) -> str:
    return " ".join(f"{side:.6g}" for side in place)
