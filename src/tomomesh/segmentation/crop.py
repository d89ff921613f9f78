"""The part of a study that matters."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ..errors import EmptyError
from ..isosurface.run_mask import RunMask

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.boxes import Box
    from ..model.volume import Volume
    from ..settings import CropSettings

NEAR = 1e-6
"""Share of a voxel by which its center may lie outside of a box and still count as in it. Centers are computed to some
1e-12 of a voxel: a side typed with six digits behind the point meets them."""


def crop(volume: Volume, asked: CropSettings, axis: int) -> tuple[Volume, Box]:
    """Return the part of a study that is asked for, a view, and which of its voxels along K, J and I these are.

    Parameters
    ----------
    volume : Volume
        The whole study.
    asked : CropSettings
        A box in patient millimeters, a range of slices, or both.
    axis : int
        The patient axis across the slices, 0 left, 1 posterior, 2 superior; they are counted from 0 along it.

    Raises
    ------
    EmptyError
        Where the study has no such slices, or nothing of it lies in the box; it names what the study has.
    """
    low, high = np.zeros(3, np.int64), np.array(volume.shape)
    if asked.slice_range is not None:
        low[2 - axis], high[2 - axis] = _slices(volume.shape[2 - axis], asked.slice_range)
    if asked.roi is not None:
        first, last = _sides(volume, asked.roi)
        low, high = np.maximum(low, first), np.minimum(high, last)
        if (low >= high).any():
            raise _outside(volume, asked.roi)
    box = slice(low[0], high[0]), slice(low[1], high[1]), slice(low[2], high[2])
    return volume.cropped(box), box


def inside_roi(volume: Volume, roi: tuple[float, ...] | None) -> RunMask | None:
    """Tell which voxels of a part (K, J, I) have their centers in a box of patient millimeters; None where all have.

    On an oblique or sheared grid the voxels that hold a box hold more than the box.

    Raises
    ------
    EmptyError
        Where none has.
    """
    if roi is None or not _turned(volume):
        return None
    found = RunMask.of(_slice_inside(volume, roi, k) for k in range(volume.shape[0]))
    if not found.count:
        raise _outside(volume, roi)
    return found


def _slice_inside(volume: Volume, roi: tuple[float, ...], k: int) -> NDArray[np.bool_]:
    """Tell the same of one slice, (1, J, I)."""
    found = np.ones((1, *volume.shape[1:]), np.bool_)
    j, i = (np.arange(size, dtype=np.float64) for size in volume.shape[1:])
    for row, low, high in zip(volume.affine[:3], roi[::2], roi[1::2], strict=True):
        slack = NEAR * float(np.abs(row[:3]).max())
        places = row[0] * i[None, :] + row[1] * j[:, None] + (row[2] * float(k) + row[3])
        found &= (places >= low - slack) & (places <= high + slack)
    return found


def _turned(volume: Volume) -> bool:
    """Tell whether an index axis runs along more than one patient axis, by over `NEAR` of a voxel at its end."""
    reach = np.abs(volume.affine[:3, :3]) * volume.shape[::-1]
    return int((reach > NEAR * min(volume.spacing_mm)).sum()) > 3


def _slices(count: int, asked: tuple[int, int]) -> tuple[int, int]:
    first, last = (n + count if n < 0 else n for n in asked)
    if not 0 <= first <= last < count:
        raise EmptyError(
            "the study has no such slices", found=f"--slice-range = {asked[0]} {asked[1]}",
            expected=f"FIRST and LAST from 0 to {count - 1}, or from {-count} to -1, FIRST not behind LAST",
        )  # fmt: skip
    return first, last + 1


def _sides(volume: Volume, roi: tuple[float, ...]) -> NDArray[np.int64]:
    """Return the first voxel along K, J and I whose center a box may hold, and that after the last, (2, 3)."""
    corners = np.array(list(product(*(roi[n : n + 2] for n in (0, 2, 4)))))
    places = volume.to_indices(corners)[:, ::-1]
    ends = np.ceil(places.min(axis=0) - NEAR), np.floor(places.max(axis=0) + NEAR) + 1
    return np.asarray(np.clip(ends, 0, volume.shape), np.int64)


def _outside(volume: Volume, roi: tuple[float, ...]) -> EmptyError:
    ends = volume.to_mm(np.array(list(product(*((0.0, size - 1.0) for size in volume.shape[::-1])))))
    told = zip("xyz", ends.min(axis=0), ends.max(axis=0), strict=True)
    return EmptyError(
        "the box holds no voxel of the study", found=f"--roi = {' '.join(f'{side:g}' for side in roi)}",
        expected="a box within " + ", ".join(f"{axis} {low:.6g} to {high:.6g}" for axis, low, high in told) + " mm",
    )  # fmt: skip
