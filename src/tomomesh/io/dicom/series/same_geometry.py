"""Whether the slices of a series belong to one stack."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ....errors import GeometryError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..headers.header import ImageFrame

PARALLEL = 1e-3
"""Directions whose components differ by less are the same: over a slice of 300 mm they are .3 mm."""

SAME_SPACING, NEAR_SPACING = 1e-4, 1e-3
"""Spacings that differ by less than the first part are the same: over 1,000 pixels they are a tenth of one. Up to the
second they are told: a number with three decimals in some slices and all in others, half a pixel over 500."""

ROUGH, ROUNDED = 0.02, 2e-3
"""Lengths of the directions may be off 1, and their cosine off 0, by the first: rounding to two decimals moves a length
by up to .005 times the root of 3, which is .009, and a cosine by twice that. More than the second, which is that of
three decimals, is told."""


def check_same_geometry(frames: list[ImageFrame]) -> None:
    """Refuse slices that differ in size, spacing or direction.

    Raises
    ------
    GeometryError
        It names the field and the two files.
    """
    first = frames[0]
    least = 0.0 if first.spacing is None else float(np.abs(first.spacing).min())
    for frame in frames[1:]:
        fields = [
            ("Rows, Columns", frame.size, first.size, 0.0),
            ("PixelSpacing", frame.spacing, first.spacing, NEAR_SPACING * least),
            ("ImageOrientationPatient", frame.axes, first.axes, PARALLEL),
        ]
        for field, found, expected, tolerance in fields:
            if not _same(found, expected, tolerance):
                raise GeometryError(
                    f"slices of one series differ in {field}",
                    file=frame.path.name,
                    found=f"{field} = {in_words(found)}",
                    expected=f"{in_words(expected)}, as in {first.path.name}",
                    hint="a folder with the slices of one stack",
                )


def middle_of(frames: list[ImageFrame]) -> tuple[ImageFrame, tuple[str, ...]]:
    """Return the first of frames of the same geometry, with the median spacing and directions of all, and notes.

    So it does not matter which of them is the first.
    """
    first, notes = frames[0], tuple[str, ...]()
    if first.axes is not None:
        axes = np.median([frame.axes for frame in frames if frame.axes is not None], axis=0)
        first = replace(first, axes=axes)
        if (off := off_unit(axes)) > ROUNDED:
            notes = (f"ImageOrientationPatient is {off:.2g} off unit vectors at right angles: it was made straight",)
    if first.spacing is not None:
        spacings = np.array([frame.spacing for frame in frames])
        with np.errstate(invalid="ignore"):  # of infinite ones, which are refused later
            off = float(np.ptp(spacings, axis=0).max())
        if off > SAME_SPACING * float(np.abs(spacings).min()):
            notes += (f"PixelSpacing differs by up to {off:.2g} mm from slice to slice: its median was taken",)
        first = replace(first, spacing=np.median(spacings, axis=0))
    return first, notes


def off_unit(axes: NDArray[np.float64]) -> float:
    """Return by how much directions (2, 3) are off unit vectors at right angles: in length, or in their cosine."""
    lengths = np.linalg.norm(axes, axis=1)
    cosine = abs(float(axes[0] @ axes[1])) / max(float(lengths.prod()), np.finfo(float).tiny)
    return max(float(np.abs(lengths - 1).max()), cosine)


def _same(found: object, expected: object, tolerance: float) -> bool:
    if found is None or expected is None:
        return found is expected
    a, b = np.asarray(found, np.float64), np.asarray(expected, np.float64)
    return np.array_equal(a, b, equal_nan=True) or bool(np.abs(a - b).max() <= tolerance)


def in_words(values: object) -> str:
    """Put the numbers of a field into words."""
    if values is None:
        return "missing"
    return ", ".join(f"{value:g}" for value in np.asarray(values, np.float64).ravel())
