"""The lattice of frames that need not be on every slice: of a segmentation, whose empty slices are left out."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ....errors import GeometryError
from ...files.source import third_party
from ..headers.values import numbers
from ..series.regular import EVEN
from ..series.same_geometry import check_same_geometry, in_words
from ..series.stack import ON_LINE, SAME_PLACE, stacked

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ....settings import ReadSettings
    from ..headers.header import ImageFrame

    Floats = NDArray[np.float64]


def lattice_of(frames: list[ImageFrame], settings: ReadSettings, *, study: str) -> tuple[Floats, NDArray[np.int64]]:
    """Find the slice of each frame, whatever their order.

    Parameters
    ----------
    frames : list of ImageFrame
        Of one file; several may lie on one slice, and none on others.
    settings : ReadSettings
        `spacing_z` is the distance of the slices where the file does not say.
    study : str
        The path as the user typed it.

    Returns
    -------
    affine : (4, 4) float array
        Index (column, row, slice) to millimeters, LPS.
    levels : (f,) int64 array
        Slice number of each frame, from 0.

    Raises
    ------
    GeometryError
        Where frames have no place, or do not lie a whole number of slices apart.
    """
    check_same_geometry(frames)
    positions = _positions(frames)
    affine = stacked(frames[:1], replace(settings, spacing_z=1.0), study=study).affine
    heights = (positions - positions[0]) @ affine[:3, 2]
    first, last = int(heights.argmin()), int(heights.argmax())
    nearest = SAME_PLACE * float(np.sqrt((affine[:3, :2] ** 2).sum(axis=0)).min())
    step = _step(heights, nearest, settings.spacing_z or _said(frames[0]))
    if step is None:
        settings = replace(settings, spacing_z=_said(frames[0], "SliceThickness"))
        return stacked(frames[:1], settings, study=study).affine, np.zeros(len(frames), np.int64)
    levels = np.rint((heights - heights[first]) / step)
    affine[:3, 2] = (positions[last] - positions[first]) / levels[last] if levels[last] else step * affine[:3, 2]
    affine[:3, 3] = positions[first]
    _check(positions, levels, affine, nearest * ON_LINE / SAME_PLACE, study)
    return affine, levels.astype(np.int64)


def _positions(frames: list[ImageFrame]) -> Floats:
    positions = np.array([np.full(3, np.nan) if frame.position is None else frame.position for frame in frames])
    lost = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if len(lost):
        worst = frames[lost[0]]
        raise GeometryError(
            "a frame has no place in the patient",
            file=worst.path.name,
            found=f"frame {worst.number + 1}: ImagePositionPatient = {in_words(worst.position)}",
            expected="three finite numbers in every frame",
        )
    return positions


def _said(frame: ImageFrame, keyword: str = "SpacingBetweenSlices") -> float | None:
    """Return a distance that the file gives for all of its frames."""
    with third_party("pydicom", frame.path.name):
        shared = frame.header.get("SharedFunctionalGroupsSequence") or [{}]
        measures = shared[0].get("PixelMeasuresSequence") or [{}]
        value = numbers(measures[0].get(keyword), 1, keyword, frame.path.name)
    return None if value is None or not np.isfinite(value[0]) or value[0] == 0 else abs(float(value[0]))


def _step(heights: Floats, nearest: float, said: float | None) -> float | None:
    """Return the distance of the slices: what is said where it fits, else the least distance of two frames."""
    gaps = np.diff(np.sort(heights))
    gaps = gaps[gaps > nearest]
    if not len(gaps) or (said and _whole(gaps / said)):
        return said
    return float(gaps.min())


def _whole(shares: Floats) -> bool:
    counts = np.rint(shares)
    return bool(counts.min() >= 1 and (np.abs(shares - counts) <= EVEN).all())


def _check(positions: Floats, levels: Floats, affine: Floats, allowed: float, study: str) -> None:
    """Refuse frames between the slices, or off the straight line of their first voxels."""
    away = positions - positions[levels.argmin()] - levels[:, None] * affine[:3, 2]
    across = away @ np.cross(affine[:3, 0], affine[:3, 1])
    across /= np.linalg.norm(np.cross(affine[:3, 0], affine[:3, 1]))
    step = float(np.linalg.norm(affine[:3, 2]))
    for off, most, what in (
        (np.abs(across), EVEN * step, "the frames are not a whole number of slices apart"),
        (np.abs(away).max(axis=1), max(allowed, EVEN * step), "the frames do not lie on a straight line"),
    ):
        if off.max() > most:
            raise GeometryError(
                what,
                file=study,
                found=f"frame {int(off.argmax()) + 1} is {off.max():.3g} mm off",
                expected=f"at most {most:.3g} mm with slices {step:.4g} mm apart",
            )
