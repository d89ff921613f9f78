"""Where the voxels of a NRRD file are: spaces, directions, units."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from ....errors import FormatError, GeometryError
from ....model.units import millimeters
from ..affine import (
    GIVEN,
    SPACING_HINT,
    UNTURNED,
    brought_to_mm,
    check_affine,
    check_spacing,
    passed_over,
    required_spacing,
    upright,
)
from ..raster import floats_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ....settings import ReadSettings

SPACES = {
    "left-posterior-superior": (1, 1, 1), "lps": (1, 1, 1),
    "right-anterior-superior": (-1, -1, 1), "ras": (-1, -1, 1),
    "left-anterior-superior": (1, -1, 1), "las": (1, -1, 1),
}  # fmt: skip
"""Space to the signs that carry it to LPS."""

NAMELESS = ("", "scanner-xyz", "3d-right-handed")
"""Spaces that name no patient axes; ITK, which writes such files, means LPS."""

UNTOLD = ("", "???", "none")
"""What stands for no unit."""

OTHER_KINDS = re.compile(r".*color|.*vector|.*matrix|list|time|point|normal|.*gradient|complex|quaternion|stub|scalar")
"""Kinds of axes that are none of space."""


def is_spatial(fields: Mapping[str, str], sizes: tuple[int, ...], *, file: str) -> list[bool]:
    """Tell of each axis whether it is one of space.

    Raises
    ------
    GeometryError
        Where there are fewer than three.
    FormatError
        Where there are more, or directions of another count of axes.
    """
    directions = _directions(fields)
    directions = directions if any(directions) else []
    kinds = fields.get("kinds", "").lower().split()
    if directions:
        spatial = [direction is not None for direction in directions]
    elif len(kinds) == len(sizes):
        spatial = [not OTHER_KINDS.fullmatch(kind) for kind in kinds]
    else:
        spatial = [True] * len(sizes)
    if len(spatial) != len(sizes):
        found = f"space directions = {len(spatial)}, sizes = {len(sizes)}"
        raise FormatError("the NRRD header contradicts itself", file=file, found=found, expected="as many")
    if sum(spatial) < 3:
        found = f"sizes = {fields['sizes']}"
        raise GeometryError("the file holds one slice", file=file, found=found, expected="a stack of slices")
    if sum(spatial) > 3:
        raise FormatError("the file holds several frames", file=file, found=f"sizes = {fields['sizes']}")
    return spatial


def frame_of(
    fields: Mapping[str, str], spatial: list[bool], settings: ReadSettings, *, file: str
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return the affine in millimeters, LPS, and notes.

    Raises
    ------
    GeometryError
        For distances that no scanner writes or that are missing, a singular affine, an unknown unit, and a space
        that is no patient's.
    FormatError
        For a header that cannot be understood.
    """
    directions = [direction for direction in _directions(fields) if direction is not None]
    if not directions:
        return _without_directions(fields, spatial, settings, file)
    affine = np.eye(4)
    vectors = [_vector(direction, "space directions", file) for direction in directions]
    affine[:3, :3] = np.stack(vectors, axis=1)
    origin = fields.get("spaceorigin", "")
    affine[:3, 3] = _vector(origin, "space origin", file) if origin else 0.0
    signs, notes = _signs(fields, file)
    units, more = _units(fields, file)
    affine[:3] *= (units * np.array(signs))[:, None]
    check_affine(affine, file=file, hint="a file with valid space directions")
    notes += more + (() if origin else ("no space origin in the file: the first voxel is at 0",))
    return affine, notes + passed_over(settings.spacing)


def _directions(fields: Mapping[str, str]) -> list[str | None]:
    """Return the vectors of the axes as they are spelled, None for axes that are none of space."""
    found = re.findall(r"none|nan|\([^)]*\)", fields.get("spacedirections", "").lower())
    return [None if one in ("none", "nan") else one for one in found]


def _vector(text: str, field: str, file: str) -> NDArray[np.float64]:
    vector = floats_of(text.strip().strip("()").split(","), field, file=file)
    if len(vector) != 3:
        raise FormatError(
            "a vector of the header has not three numbers", file=file, found=f"{field} = {text[:80]}"
        )  # fmt: skip
    return vector


def _signs(fields: Mapping[str, str], file: str) -> tuple[tuple[int, int, int], tuple[str, ...]]:
    space = fields.get("space", "").lower()
    if space in SPACES:
        return SPACES[space], ()
    if space in NAMELESS:
        return (1, 1, 1), (f"the space of the file, {space or 'without a name'}, is taken for LPS",)
    raise GeometryError(
        "the space of the file is no patient's",
        file=file,
        found=f"space = {space[:80]}",
        expected=" | ".join(SPACES),
        hint="the right space in the header",
    )


def _units(fields: Mapping[str, str], file: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return the millimeters in the unit of each axis of the space; none is taken for millimeters, as ITK does."""
    return _factors(re.findall(r'"([^"]*)"', fields.get("spaceunits", "")) or [""], "space units", file)


def _factors(units: list[str], field: str, file: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    found = [1.0 if unit in UNTOLD else millimeters(unit) for unit in units]
    factors = [factor for factor in found if factor is not None]
    if len(factors) < len(units) or len(units) not in (1, 3):
        told = f"{field} = {' '.join(units)[:80]}"
        raise GeometryError(
            "the unit of the coordinates is unknown",
            file=file,
            found=told,
            expected="mm | cm | m | um, as one or three",
        )
    notes = tuple(note for factor in sorted(set(factors)) for note in brought_to_mm(factor))
    return np.array(factors * (3 // len(factors))), notes


def _without_directions(
    fields: Mapping[str, str], spatial: list[bool], settings: ReadSettings, file: str
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Take the spacings that the file holds, or else those that were given."""
    words = fields.get("spacings", "").split()
    if len(words) == len(spatial):
        spacings = floats_of(words, "spacings", file=file)[spatial]
        check_spacing(spacings.tolist(), ["spacings[0]", "spacings[1]", "spacings[2]"], file=file, hint=SPACING_HINT)
        units = re.findall(r'"([^"]*)"', fields.get("units", ""))
        named = [unit for unit, one in zip(units, spatial, strict=True) if one] if len(units) == len(spatial) else [""]
        factors, notes = _factors(named, "units", file)
        return upright((spacings * factors).tolist()), (UNTURNED, *notes)
    return upright(required_spacing(settings.spacing, file=file)), (GIVEN,)
