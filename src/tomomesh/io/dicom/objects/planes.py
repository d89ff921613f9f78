"""The parallel planes that contours lie in, axial or oblique."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ....contours.direction import axes_across
from ....contours.levels import columns_of, planes_within, slices_at, typical_gap
from ....errors import EmptyError, GeometryError
from .rings import vector_area

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

SAME_HEIGHT_MM = 1e-3
"""Heights in mm that differ by less are the same: planning systems write two or three decimals."""
MOST_OFF_PLANE = 0.25
"""Share of the distance of two planes by which a contour may leave its own: half of the way to where it would lie
nearer to another."""

TURNED = np.radians(20.0)
"""Contours whose planes are turned by more than this are of different stacks: no contour of a stack leans so much, and
the three axes are 90 degrees apart. Half and twice of it change nothing for these."""


@dataclass(frozen=True)
class Planes:
    """Parallel planes, rising along their normal within each column of contours that lie over one another.

    Attributes
    ----------
    labels : (c,) int64 array
        The plane of each contour.
    heights : (s,) float array
        Where the planes are along their normal, mm.
    apart : float
        Distance of the planes of a column, as a rule.
    width : float
        Extent of the widest contour.
    """

    labels: NDArray[np.int64]
    heights: Floats
    apart: float
    width: float

    @property
    def slices(self) -> int:
        """How many slices the planes of all columns are on."""
        return slices_at(self.heights, self.width)


def planes_of(contours: Sequence[Floats], *, file: str, thickness: float | None = None) -> Planes:
    """Find the planes of contours.

    Parameters
    ----------
    contours : sequence of (u, 3) float arrays
        Each encloses an area.
    file : str
        The path as the user typed it.
    thickness : float, optional
        How thick a contour is that is alone, mm.

    Raises
    ------
    EmptyError
        Where all lie in one plane, and have no thickness.
    GeometryError
        Where a contour leaves its plane, or the planes are not parallel.
    """
    if not contours:
        raise EmptyError("no contour encloses anything", file=file, expected="at least two slices")
    normal = _normal(contours)
    axes = axes_across(normal)
    placed = [contour @ axes.T for contour in contours]
    height = np.array([float(one[:, 2].mean()) for one in placed])
    low, high = (np.array([end(one[:, :2], axis=0) for one in placed]) for end in (np.min, np.max))
    column = columns_of(low, high)
    widths = (high - low).max(axis=1)
    width = float(widths.max())
    labels = planes_within(height, column, widths, SAME_HEIGHT_MM)
    heights = np.bincount(labels, height) / np.bincount(labels)
    each = [heights[np.unique(labels[column == one])] for one in range(column.max() + 1)]
    gaps = np.array([typical_gap(own, width) for own in each])[column]
    wide = gaps[gaps > SAME_HEIGHT_MM]
    if len(wide) == 0 and thickness is None:
        raise EmptyError(
            "contours on one slice enclose no volume", file=file, found="1 slice", expected="at least two slices",
            hint="--thickness, for a slab",
        )  # fmt: skip
    apart = float(np.median(wide)) if len(wide) else thickness or 0.0
    off = np.array([np.abs(one[:, 2] - level).max() for one, level in zip(placed, height, strict=True)])
    if off.max() > MOST_OFF_PLANE * apart:
        raise GeometryError(
            "the contours do not lie in parallel planes",
            file=file,
            found=f"contour {int(off.argmax()) + 1} is {off.max():.3g} mm off its plane",
            expected=f"at most {MOST_OFF_PLANE * apart:.3g} mm across ({', '.join(f'{n:.3g}' for n in normal)})",
        )
    return Planes(labels, heights, apart, width)


def directions(contours: Sequence[Floats]) -> int:
    """Count the directions of the planes of contours (u, 3), where there are several with two contours each; else 0."""
    areas = np.array([vector_area(contour) for contour in contours])
    normals = areas / np.linalg.norm(areas, axis=1)[:, None]
    near = np.abs(normals @ normals.T) > np.cos(TURNED)
    count, direction = scipy.sparse.csgraph.connected_components(scipy.sparse.csr_array(near), directed=False)
    return int(count) if count > 1 and np.bincount(direction).min() > 1 else 0


def _normal(contours: Sequence[Floats]) -> Floats:
    """Return the common normal of contours, whichever way round they run; its largest component is positive."""
    areas = np.array([vector_area(contour) for contour in contours])
    leading = areas[np.argmax((areas**2).sum(axis=1))]
    total = (areas * np.sign(areas @ leading)[:, None]).sum(axis=0)
    return np.asarray(total / np.linalg.norm(total) * np.sign(total[np.argmax(np.abs(total))]))
