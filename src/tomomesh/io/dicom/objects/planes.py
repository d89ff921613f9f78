"""The parallel planes that contours lie in, axial or oblique."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ....errors import EmptyError, GeometryError
from .rings import vector_area

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

SAME_HEIGHT_MM = 1e-3
"""Heights in mm that differ by less are the same: planning systems write two or three decimals."""
ONE_PLANE = 0.1
"""Contours nearer than this share of the planes' median distance lie in one plane: no stack has slices so uneven."""
MOST_OFF_PLANE = 0.25
"""Share of the least distance of two planes by which a contour may leave its own: half of the way to where it would
lie nearer to another."""


@dataclass(frozen=True)
class Planes:
    """Parallel planes, rising along their normal.

    Attributes
    ----------
    labels : (c,) int64 array
        The plane of each contour.
    heights : (s,) float array
        Where the planes are along their normal, mm.
    """

    labels: NDArray[np.int64]
    heights: Floats


def planes_of(contours: Sequence[Floats], *, file: str) -> Planes:
    """Find the planes of contours.

    Parameters
    ----------
    contours : sequence of (u, 3) float arrays
        Each encloses an area.
    file : str
        The path as the user typed it.

    Raises
    ------
    EmptyError
        Where all lie in one plane.
    GeometryError
        Where a contour leaves its plane, or the planes are not parallel.
    """
    if not contours:
        raise EmptyError("no contour encloses anything", file=file, expected="at least two slices")
    normal = _normal(contours)
    along = [contour @ normal for contour in contours]
    height = np.array([float(one.mean()) for one in along])
    order = np.argsort(height, kind="stable")
    gaps = np.diff(height[order])
    apart = gaps[gaps > SAME_HEIGHT_MM]
    if not len(apart):
        raise EmptyError(
            "contours on one slice enclose no volume", file=file, found="1 slice", expected="at least two slices"
        )
    labels = np.empty(len(height), np.int64)
    labels[order] = np.cumsum(np.concatenate([[False], gaps > ONE_PLANE * np.median(apart)]))
    heights = np.bincount(labels, height) / np.bincount(labels)
    off = np.array([np.abs(one - heights[label]).max() for one, label in zip(along, labels, strict=True)])
    most = MOST_OFF_PLANE * float(np.diff(heights).min())
    if off.max() > most:
        raise GeometryError(
            "the contours do not lie in parallel planes",
            file=file,
            found=f"contour {int(off.argmax()) + 1} is {off.max():.3g} mm off its plane",
            expected=f"at most {most:.3g} mm across ({', '.join(f'{n:.3g}' for n in normal)})",
        )
    return Planes(labels, heights)


def _normal(contours: Sequence[Floats]) -> Floats:
    """Return the common normal of contours, whichever way round they run; its largest component is positive."""
    areas = np.array([vector_area(contour) for contour in contours])
    leading = areas[np.argmax((areas**2).sum(axis=1))]
    total = (areas * np.sign(areas @ leading)[:, None]).sum(axis=0)
    return np.asarray(total / np.linalg.norm(total) * np.sign(total[np.argmax(np.abs(total))]))
