"""Whether slices are evenly spaced, and what is done where they are not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...errors import GeometryError

if TYPE_CHECKING:
    from numpy.typing import NDArray

EVEN = 0.01
"""Distances that differ by less than this part are even."""


def regular(heights: NDArray[np.float64], *, fill: bool, study: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Give the slices numbers by their height.

    Parameters
    ----------
    heights : (s,) float array
        Positions along the normal, rising, millimeters; two at least.
    fill : bool
        Whether slices may be interpolated.
    study : str
        The path as the user typed it.

    Returns
    -------
    levels : (s,) float array
        Slice number of each, from 0 to a whole number; whole within 1 % of a step, and then exactly,
        where the stack is regular.
    notes : tuple of str
        How many slices are interpolated.

    Raises
    ------
    GeometryError
        Where slices are missing or unevenly spaced, and `fill` is not set.
    """
    gaps = np.diff(heights)
    step = float(np.sort(gaps)[(len(gaps) - 1) // 2])
    if np.abs(gaps / step - 1).max() <= EVEN:
        return np.arange(len(heights), dtype=np.float64), ()
    holes = np.round(gaps / step)
    missing = bool(holes.min() >= 1 and (np.abs(gaps / step - holes) <= EVEN * holes).all())
    if not fill:
        raise _missing(heights, gaps, holes, study) if missing else _uneven(heights, gaps, study)
    count = max(1, round((heights[-1] - heights[0]) / step))
    levels = (heights - heights[0]) / (heights[-1] - heights[0]) * count
    levels = np.where(np.abs(levels - np.round(levels)) <= EVEN, np.round(levels), levels)
    added = count + 1 - int((levels == np.round(levels)).sum())
    return levels, (f"slices interpolated linearly: {added} of {count + 1}",)


def _missing(
    heights: NDArray[np.float64], gaps: NDArray[np.float64], holes: NDArray[np.float64], study: str
) -> GeometryError:
    where = [f"{heights[n]:.6g} to {heights[n + 1]:.6g} mm" for n in np.flatnonzero(holes > 1)]
    return GeometryError(
        f"slices are missing: {int(holes.sum()) - len(holes)}",
        file=study,
        found=f"gap = {', '.join(where[:4])}{', ...' if len(where) > 4 else ''}",
        expected=f"a slice every {gaps.min():.4g} mm",
        hint="the missing files, or --fill-gaps to interpolate them",
    )


def _uneven(heights: NDArray[np.float64], gaps: NDArray[np.float64], study: str) -> GeometryError:
    widest = int(gaps.argmax())
    return GeometryError(
        "the distance of the slices varies",
        file=study,
        found=f"distance = {gaps.min():.4g} to {gaps.max():.4g} mm, "
        f"widest from {heights[widest]:.6g} to {heights[widest + 1]:.6g} mm",
        expected=f"equal within {EVEN:.0%}",
        hint="--fill-gaps to interpolate an even stack",
    )
