"""Labels laid onto the grid of a study."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import GeometryError
from ..model.lazy import LazyVoxels
from .slabwise.cut import HERE
from .slabwise.sources import Placed

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ..model.boxes import Box
    from ..model.volume import Volume
    from .slabwise.cut import Cutting

NEAR = 0.1
"""Voxels by which labels may lie off the study's, at any corner. Spacings and directions of four or five digits, as
programs write them, come to .01 to .06 voxels over 256 of them; half a voxel would be another one."""
SAME = 0.01
"""Voxels from which on that is told. Affines in files have 32 bits, 6e-8, times some 1,000 voxels from the first to the
last: a hundred times that."""
MOST_DIGITS = 17
"""Digits that tell any two floats apart."""
HINT = "labels on the study's own grid, or the labels alone as the study"


def onto_grid(labels: Volume, study: Volume, cutting: Cutting = HERE) -> Volume:
    """Lay labels onto a study's grid, background where they hold nothing.

    Parameters
    ----------
    labels : Volume
        On the study's own lattice: the same voxels, up to the order and the direction of their axes, a whole number
        of voxels away. They may cover a part of it, and reach beyond.
    study : Volume
    cutting : Cutting, optional
        Who counts them.

    Returns
    -------
    Volume
        Of the study's shape; notes say which part of it is covered, and count the labels beyond it, which are left
        out.

    Raises
    ------
    GeometryError
        Where the voxels differ, lie between those of the study, or outside of it altogether.
    """
    steps, offset, off = _whole_steps(labels, study)
    if off > SAME:
        told = f"the labels lie up to {off:.2g} voxels beside those of the study: taken for the same"
        labels = replace(labels, notes=(*labels.notes, told))
    if labels.shape == study.shape and np.array_equal(steps, np.eye(3)) and not offset.any():
        return labels
    turned, low = _turned(labels.voxels, steps[::-1, ::-1], offset[::-1])
    start, stop = np.maximum(low, 0), np.minimum(low + turned.shape[:3], study.shape)
    if (start >= stop).any():
        raise GeometryError("the labels lie outside of the study", found=_box(labels), expected=_box(study), hint=HINT)
    within = turned[_slices(start - low, stop - low)]
    placed = Placed(within, tuple(start.tolist()), study.shape)
    voxels: Any = LazyVoxels.of(placed) if labels.in_parts else placed.read(_slices(np.zeros(3, int), study.shape))
    covered = " x ".join(map(str, (stop - start)[::-1]))
    notes = (
        *labels.notes,
        f"the labels cover {covered} of the study's {' x '.join(map(str, study.shape[::-1]))} voxels",
    )
    held = [cutting.of(part).sum(_labelled) for part in (turned, within)]
    lost = held[0] - held[1]
    beyond = (f"labeled voxels beyond the study, left out: {lost}",) if lost else ()
    return replace(study, voxels=voxels, unit=labels.unit, notes=notes + beyond)


def _whole_steps(labels: Volume, study: Volume) -> tuple[NDArray[np.int64], NDArray[np.int64], float]:
    """Return the axes (3, 3) and the first voxel (3,) of labels in whole voxels (i, j, k) of a study.

    The third is how many voxels of the study the farthest corner of the labels lies off.
    """
    ways = np.linalg.solve(study.affine, labels.affine)
    steps, offset = np.rint(ways[:3, :3]), np.rint(ways[:3, 3])
    one_each = all((np.abs(steps).sum(axis=axis) == 1).all() for axis in (0, 1))
    corners = np.array(list(np.ndindex(2, 2, 2))) * (np.array(labels.shape[::-1]) - 1.0)
    away = corners @ (ways[:3, :3] - steps).T + (ways[:3, 3] - offset)
    off = float(np.linalg.norm(away, axis=1).max())
    if not one_each or np.linalg.norm(np.ptp(away, axis=0)) > NEAR:
        told = f", {off:.2g} voxels off at the farthest corner" if one_each else ""
        found, expected = _told_apart(labels, study)
        raise GeometryError(
            "the labels do not fit the study", found=found + told,
            expected=f"{expected}, as the study, or a part of it", hint=HINT,
        )  # fmt: skip
    if off > NEAR:
        apart = float(np.linalg.norm(study.affine[:3, :3] @ away.T, axis=0).max())
        raise GeometryError(
            "the labels lie elsewhere than the study", found=f"{apart:.4g} mm off its voxels, {off:.2g} of one",
            expected="whole voxels of the study's own grid", hint=HINT,
        )  # fmt: skip
    return steps.astype(np.int64), offset.astype(np.int64), off


def _told_apart(labels: Volume, study: Volume) -> tuple[str, str]:
    """Put two grids into words, with as many digits as tell them apart."""
    for digits in range(3, MOST_DIGITS + 1):
        found, expected = (_described(volume, digits) for volume in (labels, study))
        if found.split(" voxels of ")[1] != expected.split(" voxels of ")[1]:
            break
    return found, expected


def _described(volume: Volume, digits: int) -> str:
    sizes = " x ".join(map(str, volume.shape[::-1]))
    spacing = " x ".join(f"{length:.{digits + 2}g}" for length in volume.spacing_mm)
    columns = np.round(volume.affine[:3, :3] / np.array(volume.spacing_mm), digits) + 0.0
    axes = " ".join(f"({', '.join(f'{cosine:.{digits}g}' for cosine in column)})" for column in columns.T)
    return f"{sizes} voxels of {spacing} mm, axes {axes}"


def _turned(voxels: Any, steps: NDArray[np.int64], offset: NDArray[np.int64]) -> tuple[Any, NDArray[np.int64]]:
    """Return voxels with the axes of a study, and where the first of them lies; steps and offset are (K, J, I)."""
    order = np.abs(steps).argmax(axis=1)
    backward = steps[np.arange(3), order] < 0
    turned = voxels.transpose((*order.tolist(), *range(3, voxels.ndim)))
    low = offset - np.where(backward, np.array(turned.shape[:3]) - 1, 0)
    return turned[tuple(slice(None, None, -1 if flip else 1) for flip in backward)], low


def _slices(start: NDArray[np.int64], stop: ArrayLike) -> tuple[slice, ...]:
    return tuple(slice(a, b) for a, b in zip(start.tolist(), np.asarray(stop).tolist(), strict=True))


def _labelled(voxels: NDArray[Any], box: Box) -> int:
    return int(np.count_nonzero(voxels))


def _box(volume: Volume) -> str:
    """Put the box around the centers of all voxels into words."""
    corners = volume.to_mm(np.array(list(np.ndindex(2, 2, 2))) * (np.array(volume.shape[::-1]) - 1.0))
    low, high = corners.min(axis=0), corners.max(axis=0)
    return " x ".join(f"{a:.4g} to {b:.4g}" for a, b in zip(low, high, strict=True)) + " mm"
