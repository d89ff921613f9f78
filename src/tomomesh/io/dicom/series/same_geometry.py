"""Whether the slices of a series belong to one stack."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ....errors import GeometryError

if TYPE_CHECKING:
    from ..headers.header import ImageFrame

PARALLEL = 1e-3
"""Directions whose components differ by less are the same: over a slice of 300 mm they are .3 mm."""

SAME_SPACING = 1e-4
"""Spacings that differ by less than this part are the same: over 1,000 pixels they are a tenth of one."""


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
            ("PixelSpacing", frame.spacing, first.spacing, SAME_SPACING * least),
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
