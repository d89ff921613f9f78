"""Axes, units and transformations of an OME-Zarr image (OME-NGFF 0.4 and 0.5), to patient millimeters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError, GeometryError
from ..affine import GIVEN, UNTURNED, brought_to_mm, check_spacing, passed_over, required_spacing, upright  # fmt: skip

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ....settings import ReadSettings

SPACE = ("x", "y", "z")
"""The axes that a stack must have, the columns' first."""

OME_UNITS_MM = {
    "angstrom": 1e-7, "nanometer": 1e-6, "micrometer": 1e-3, "millimeter": 1.0, "centimeter": 10.0, "decimeter": 100.0,
    "meter": 1e3, "inch": 25.4,
}  # fmt: skip
"""Millimeters in the format's units of space."""

UPRIGHT = ((0, 1), (1, 1), (2, 1))
"""Patient axis and sign of x, y and z where nothing is said."""

TOWARDS = {
    "right-to-left": (0, 1), "left-to-right": (0, -1),
    "anterior-to-posterior": (1, 1), "posterior-to-anterior": (1, -1),
    "inferior-to-superior": (2, 1), "superior-to-inferior": (2, -1),
}  # fmt: skip
"""Patient axis and sign of the format's anatomical directions (its RFC 4)."""


@dataclass(frozen=True)
class Axes:
    """The axes of an image, as they are stored.

    Attributes
    ----------
    names : tuple of str
        x, y, z, t or c, slowest first.
    units, directions : tuple of str
        Of x, y and z; empty where nothing is said.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    directions: tuple[str, ...]

    def space(self, values: Any) -> NDArray[np.float64]:
        """Return the values, one an axis, of x, y and z."""
        return np.array([float(values[self.names.index(name)]) for name in SPACE])

    def zyx(self, stored: NDArray[Any]) -> NDArray[Any]:
        """Return an array as (slices, rows, columns, channels)."""
        order = [self.names.index(name) for name in reversed(SPACE)]
        rest = [axis for axis in range(stored.ndim) if axis not in order]
        turned = np.transpose(stored, (*order, *rest))
        return turned.reshape(*turned.shape[:3], -1)


def axes_of(image: Any, *, file: str) -> Axes:
    """Return the axes that an image names.

    Raises
    ------
    FormatError
        Where they are none of a stack.
    GeometryError
        For a single slice.
    """
    told: list[Any] = [{"name": axis} if isinstance(axis, str) else axis for axis in image["axes"]]
    by_name = {str(axis["name"]): axis for axis in told}
    missing = [name for name in SPACE if name not in by_name]
    if missing == ["z"] and set(by_name) <= {"x", "y", "t", "c"}:
        raise GeometryError("the file holds one slice", file=file, found="axes = no z", expected="a stack of slices")
    if missing or len(by_name) != len(told) or not set(by_name) <= {*SPACE, "t", "c"}:
        found = f"axes = {', '.join(by_name)[:80]}"
        raise FormatError("the axes of the image are no stack's", file=file, found=found, expected="t, c, z, y, x")
    space = [by_name[name] for name in SPACE]
    directions = [(axis.get("orientation") or {}).get("value", "") for axis in space]
    return Axes(tuple(by_name), tuple(str(axis.get("unit", "")) for axis in space), tuple(map(str, directions)))


def frame_of(
    axes: Axes, transformations: list[Any], settings: ReadSettings, *, file: str
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return the affine in millimeters, LPS, and notes.

    Parameters
    ----------
    axes : Axes
        Of the image.
    transformations : list of dict
        Scales and translations, in the order in which they are done.

    Raises
    ------
    FormatError
        For transformations of another kind.
    GeometryError
        For distances that no scanner writes, or that are missing, and directions that are no patient's.
    """
    scale, offset = _combined(axes, transformations, file)
    if not all(unit in OME_UNITS_MM for unit in axes.units) or not transformations:
        return upright(required_spacing(settings.spacing, file=file, what=_unknown(axes))), (GIVEN,)
    check_spacing(scale.tolist(), [f"scale of {name}" for name in SPACE], file=file, hint="a store with valid scales")
    factors = np.array([OME_UNITS_MM[unit] for unit in axes.units])
    affine = np.zeros((4, 4))
    affine[3, 3] = 1.0
    for column, (row, sign) in enumerate(_directions(axes, file)):
        affine[row, column] = sign * scale[column] * factors[column]
        affine[row, 3] = sign * offset[column] * factors[column]
    notes: tuple[str, ...] = () if any(axes.directions) else (UNTURNED,)
    notes += tuple(note for factor in sorted(set(factors.tolist())) for note in brought_to_mm(factor))
    return affine, notes + passed_over(settings.spacing)


def _unknown(axes: Axes) -> str:
    named = ", ".join(unit[:20] or "none" for unit in axes.units)
    return f"the file does not say how far its voxels are apart (units of x, y, z: {named})"


def _combined(axes: Axes, transformations: list[Any], file: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return scale and offset of x, y and z."""
    scale, offset = np.ones(3), np.zeros(3)
    for one in transformations:
        kind = str(one["type"])
        if kind not in ("scale", "translation", "identity") or (kind != "identity" and kind not in one):
            raise FormatError(
                "a transformation of the image cannot be followed",
                file=file,
                found=f"transformation = {kind[:80]}",
                expected="scale and translation, as numbers",
            )
        if kind == "scale":
            scale, offset = scale * axes.space(one[kind]), offset * axes.space(one[kind])
        elif kind == "translation":
            offset = offset + axes.space(one[kind])
    return scale, offset


def _directions(axes: Axes, file: str) -> tuple[tuple[int, int], ...]:
    """Return the patient axis and the sign of x, y and z."""
    if not any(axes.directions):
        return UPRIGHT
    found = [TOWARDS.get(direction) for direction in axes.directions]
    known = tuple(one for one in found if one is not None)
    if sorted(row for row, _ in known) != [0, 1, 2]:
        raise GeometryError(
            "the directions of the axes are no patient's",
            file=file,
            found=f"orientation = {', '.join(axes.directions)[:80]}",
            expected=" | ".join(TOWARDS),
        )
    return known
