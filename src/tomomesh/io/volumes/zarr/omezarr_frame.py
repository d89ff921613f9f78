"""Axes, units and transformations of an OME-Zarr image (0.4, 0.5 and 0.6), to patient millimeters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError, GeometryError
from ....model.units import millimeters
from ..affine import UNTURNED, brought_to_mm, check_affine, check_spacing, passed_over, required_spacing
from .origins import AlongAxes, origin_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ....settings import ReadSettings

SPACE = ("x", "y", "z")
"""The axes that a stack must have, the columns' first."""

UPRIGHT = ((0, 1), (1, 1), (2, 1))
"""Patient axis and sign of x, y and z where nothing is said."""

TOWARDS = {
    "right-to-left": (0, 1), "left-to-right": (0, -1),
    "anterior-to-posterior": (1, 1), "posterior-to-anterior": (1, -1),
    "inferior-to-superior": (2, 1), "superior-to-inferior": (2, -1),
}  # fmt: skip
"""Patient axis and sign of the format's anatomical directions (its RFC 4)."""

SCALED = "no units in the file: --spacing is the size of a voxel, and scales the translation too"
PATIENT = "no units in the file: taken for millimeters, for its axes have the directions of a patient"
"""Notes on where the unit came from."""


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

    @property
    def zyx(self) -> list[int]:
        """The places of z, y and x."""
        return [self.names.index(name) for name in reversed(SPACE)]


def axes_of(image: Any, system: str = "", *, file: str) -> Axes:
    """Return the axes that an image names.

    Parameters
    ----------
    image : dict
        One of `multiscales`.
    system : str
        Of its coordinate systems, which 0.6 has, the one to take; the first where there is none of that name.

    Raises
    ------
    FormatError
        Where they are none of a stack.
    GeometryError
        For a single slice.
    """
    systems = image.get("coordinateSystems") or [image]
    chosen = next((one for one in systems if one.get("name") == system), systems[0])
    told: list[Any] = [{"name": axis} if isinstance(axis, str) else axis for axis in chosen["axes"]]
    by_name = {str(axis["name"]): axis for axis in told}
    missing = [name for name in SPACE if name not in by_name]
    if missing == ["z"] and set(by_name) <= {"x", "y", "t", "c"}:
        raise GeometryError("the file holds one slice", file=file, found="axes = no z", expected="a stack of slices")
    if missing or len(by_name) != len(told) or not set(by_name) <= {*SPACE, "t", "c"}:
        found = f"axes = {', '.join(by_name)[:80]}"
        raise FormatError("the axes of the image are no stack's", file=file, found=found, expected="t, c, z, y, x")
    space = [by_name[name] for name in SPACE]
    units = tuple(str(axis.get("unit") or "") for axis in space)
    return Axes(tuple(by_name), units, tuple(_direction(axis) for axis in space))


def _direction(axis: Any) -> str:
    """Return the direction of an axis: RFC 4 has an object, ngff-zarr writes a bare word for nibabel's images."""
    told = axis.get("orientation") or ""
    return str(told.get("value", "") if isinstance(told, dict) else told)


def frame_of(
    axes: Axes, transformations: list[Any], finest: list[Any], settings: ReadSettings, *, writer: str, file: str
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return the affine in millimeters, LPS, and notes.

    Parameters
    ----------
    axes : Axes
        Of the image.
    transformations, finest : list of dict
        Scales and translations of a level, and of the finest, in the order in which they are done.
    writer : str
        As `origins.writer_of` tells it.

    Raises
    ------
    FormatError
        For transformations of another kind.
    GeometryError
        For distances that no scanner writes, or that are missing, and directions that are no patient's.
    """
    scale, offset = _combined(axes, transformations, file)
    check_spacing(scale.tolist(), [f"scale of {name}" for name in SPACE], file=file, hint="a store with valid scales")
    factors, notes = _factors(axes, scale, settings, file) if transformations else _given(axes, scale, settings, file)
    turned = _directions(axes, file)
    along = AlongAxes(
        np.array([row for row, _ in turned]), np.array([sign for _, sign in turned]), offset * factors,
        _combined(axes, finest, file)[1] * factors,
    )  # fmt: skip
    affine = np.eye(4)
    affine[:3, :3] = 0.0
    affine[along.rows, np.arange(3)] = along.signs * scale * factors
    affine[:3, 3], told = origin_of(along, writer)
    check_affine(affine, file=file, hint="a store with valid translations")
    return affine, ((UNTURNED,) if not any(axes.directions) else ()) + told + notes


def _factors(
    axes: Axes, scale: NDArray[np.float64], settings: ReadSettings, file: str
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return the millimeters in the units of x, y and z."""
    known = [factor for factor in map(millimeters, axes.units) if factor is not None]
    if len(known) == len(SPACE):
        told = tuple(note for factor in sorted(set(known)) for note in brought_to_mm(factor))
        return np.array(known), told + passed_over(settings.spacing)
    if settings.spacing is None and any(axes.directions) and not any(axes.units):
        return np.ones(3), (PATIENT,)
    return _given(axes, scale, settings, file)


def _given(
    axes: Axes, scale: NDArray[np.float64], settings: ReadSettings, file: str
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return the factors by which the scales become the spacing that was given."""
    named = ", ".join(unit[:20] or "none" for unit in axes.units)
    what = f"the file does not say how far its voxels are apart (units of x, y, z: {named})"
    return np.array(required_spacing(settings.spacing, file=file, what=what)) / scale, (SCALED,)


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
