"""Slices in order along their normal, and the affine that they share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ....errors import FormatError, GeometryError
from ...volumes.affine import check_affine, check_spacing
from ..headers.kinds import class_of
from ..headers.multiframe import DOSE, PROJECTIONS, no_slices
from .regular import regular
from .same_geometry import ROUGH, check_same_geometry, in_words, middle_of, off_unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ....settings import ReadSettings
    from ..headers.header import ImageFrame

SAME_PLACE = 0.01
"""Slices that are nearer than this part of a pixel are at the same position: it is far above the rounding of headers,
and no scanner's slices are so thin."""

ON_LINE = 0.1
"""Origins may leave their straight line by this part of a pixel, which interpolation would not show."""

TILTED = 0.1
"""Degrees of gantry tilt from which on it is mentioned: over a stack of 300 mm they are half a millimeter."""


@dataclass(frozen=True)
class SliceLine:
    """Where the slices begin and how they go on: origin and step in millimeters, number of each slice."""

    origin: NDArray[np.float64]
    step: NDArray[np.float64]
    levels: NDArray[np.float64]
    notes: tuple[str, ...]


class Unplaced(NamedTuple):
    """Why the distance of the slices is not known, in the words of an error, and of a note once it is given."""

    what: str
    found: str
    instead: str
    note: str


NOWHERE = Unplaced(
    "slices have no position", "ImagePositionPatient = missing", "",
    "slices without positions, in the order of their numbers",
)  # fmt: skip
FIRST_ALONE = Unplaced(
    "the file tells where its first frame lies, but no other", "SpacingBetweenSlices = missing", "",
    "frames without positions, one behind the other along their normal",
)  # fmt: skip
ONE = Unplaced("the series has one slice", "slices = 1", "the folder of the series, or ", "one slice")


@dataclass(frozen=True)
class Stack:
    """Frames along the normal of the slices.

    Attributes
    ----------
    places : list of lists of ImageFrame
        The frames at each position, rising along the normal; more than one where a position repeats.
    levels : (s,) float array
        Slice number at which each place lies: whole where the stack is regular.
    affine : (4, 4) float array
        Index (column, row, slice) to millimeters, LPS.
    notes : tuple of str
        What was decided.
    """

    places: list[list[ImageFrame]]
    levels: NDArray[np.float64]
    affine: NDArray[np.float64]
    notes: tuple[str, ...]


def stacked(frames: list[ImageFrame], settings: ReadSettings, *, study: str) -> Stack:
    """Order the frames of a series, whatever order their files had.

    Parameters
    ----------
    frames : list of ImageFrame
        Of one series.
    settings : ReadSettings
        `spacing_z` stands in for positions, `spacing` for all distances; `fill_gaps` and
        `resample_slices` allow gaps and other distances.
    study : str
        The path as the user typed it.

    Raises
    ------
    GeometryError
        Where the frames do not make one regular stack.
    """
    check_same_geometry(frames)
    _check_slices(frames[0])
    if class_of(frames[0].header) == DOSE:  # its planes may lie anywhere, and its values are meant to be interpolated
        settings = replace(settings, fill_gaps=True, resample_slices=True)
    middle, notes = middle_of(frames)
    pixel, axes = pixel_of(middle, settings), axes_of(middle)
    normal = np.cross(axes[0], axes[1])
    lost = [frame for frame in frames if frame.position is None]
    if lost:
        places, first = _numbered(frames), _first_place(frames)
        origin, unplaced = (np.zeros(3), NOWHERE) if first is None else (first, FIRST_ALONE)
        line = _along(normal, origin, _given(settings), len(places), lost[0].path.name, unplaced)
    else:
        places = placed(frames, normal, SAME_PLACE * min(pixel))
        line = _line(places, normal, settings, min(pixel), study)
    affine = np.eye(4)
    affine[:3] = np.column_stack([axes[0] * pixel[0], axes[1] * pixel[1], line.step, line.origin])
    check_affine(affine, file=study, hint="a series with a valid geometry")
    return Stack(places, line.levels, affine, notes + line.notes)


def _check_slices(frame: ImageFrame) -> None:
    """Refuse frames that no distance makes slices."""
    if what := no_slices(frame.header):
        raise FormatError(
            "the frames of the file are no slices",
            file=frame.path.name,
            found=what,
            expected="slices of one volume",
            hint="a series of slices that was computed from them" if PROJECTIONS in what else "",
        )


def _first_place(frames: list[ImageFrame]) -> NDArray[np.float64] | None:
    """Return where a file begins that tells the place of its first frame alone; None for slices of several files."""
    return frames[0].position if all(frame.path == frames[0].path for frame in frames) else None


def _given(settings: ReadSettings) -> float | None:
    """Return the distance of the slices that the user gave."""
    return settings.spacing_z or (settings.spacing[2] if settings.spacing else None)


def pixel_of(frame: ImageFrame, settings: ReadSettings) -> tuple[float, float]:
    """Return the distance of the columns and of the rows, mm.

    Raises
    ------
    GeometryError
        Where there is none, or none that is possible.
    """
    if frame.spacing is None and settings.spacing:
        return settings.spacing[0], settings.spacing[1]
    if frame.spacing is None:
        raise GeometryError(
            "the slices have no spacing",
            file=frame.path.name,
            found="PixelSpacing = missing",
            expected="the distance of the pixels in mm",
            hint="--spacing x y z",
            flags=["--spacing"],
        )
    x, y = float(frame.spacing[0]), float(frame.spacing[1])
    check_spacing((x, y), ("PixelSpacing", "PixelSpacing"), file=frame.path.name, hint="a corrected header")
    return x, y


def axes_of(frame: ImageFrame) -> NDArray[np.float64]:
    """Return the directions of the columns and of the rows (2, 3); those of an axial slice where there are none.

    They are of unit length and at right angles, whatever their rounding in the file has made of them.

    Raises
    ------
    GeometryError
        Where they are not at right angles.
    """
    if frame.axes is None and frame.position is None:
        return np.eye(3)[:2]
    axes = np.full((2, 3), np.nan) if frame.axes is None else frame.axes
    if not off_unit(axes) <= ROUGH:
        raise GeometryError(
            "the directions of the slices are invalid",
            file=frame.path.name,
            found=f"ImageOrientationPatient = {in_words(frame.axes)}",
            expected="two unit vectors at right angles",
        )
    axes = axes / np.linalg.norm(axes, axis=1)[:, None]
    straight = axes - axes[::-1] * (axes[0] @ axes[1] / 2)  # each gives half of what they share
    return np.asarray(straight / np.linalg.norm(straight, axis=1)[:, None])


def _numbered(frames: list[ImageFrame]) -> list[list[ImageFrame]]:
    """Order frames by their numbers."""
    keyed = {frame.instance: frame for frame in frames}
    if len(frames) > 1 and (None in keyed or len(keyed) < len(frames)):
        raise GeometryError(
            "slices have neither positions nor numbers",
            file=frames[0].path.name,
            found="InstanceNumber = missing or repeated",
            expected="a number of its own in every slice",
        )
    return [[frame] for _, frame in sorted(keyed.items(), key=lambda item: item[0] or 0)]


def _along(
    normal: NDArray[np.float64], origin: NDArray[np.float64], distance: float | None, count: int, name: str,
    unplaced: Unplaced,
) -> SliceLine:  # fmt: skip
    """Go along the normal by a distance that the user gave."""
    if distance is None:
        raise GeometryError(
            unplaced.what,
            file=name,
            found=unplaced.found,
            expected="two positions and more, or the distance of the slices",
            hint=f"{unplaced.instead}--spacing-z mm",
            flags=["--spacing-z"],
        )
    levels = np.arange(count, dtype=np.float64)
    return SliceLine(origin, normal * distance, levels, (f"{unplaced.note}: {distance:g} mm apart, as given",))


def placed(frames: list[ImageFrame], normal: NDArray[np.float64], nearest: float) -> list[list[ImageFrame]]:
    """Order frames, all with a position, along their normal (3,); those nearer than `nearest` mm are together.

    Raises
    ------
    GeometryError
        For a position that is no number.
    """
    positions = np.array([frame.position for frame in frames])
    if not np.isfinite(positions).all():
        worst = frames[int(np.argmin(np.isfinite(positions).all(axis=1)))]
        raise GeometryError(
            "a slice's position is invalid",
            file=worst.path.name,
            found=f"ImagePositionPatient = {in_words(worst.position)}",
        )
    heights = positions @ normal
    order = sorted(range(len(frames)), key=lambda n: (heights[n], str(frames[n].path), frames[n].number))
    starts = np.diff(heights[order], prepend=-np.inf) >= nearest
    places: list[list[ImageFrame]] = []
    for n, new in zip(order, starts, strict=True):
        if new:
            places.append([])
        places[-1].append(frames[n])
    return places


def _line(
    places: list[list[ImageFrame]],
    normal: NDArray[np.float64],
    settings: ReadSettings,
    pixel: float,
    study: str,
) -> SliceLine:
    """Follow the positions of the slices: the step keeps the shear of a tilted gantry."""
    origins, distance = np.array([place[0].position for place in places]), _given(settings)
    if len(places) == 1:
        return _along(normal, origins[0], distance, 1, places[0][0].path.name, ONE)
    heights = origins @ normal
    levels, notes = regular(heights, settings, pixel=pixel, study=study)
    way = origins[-1] - origins[0]
    share = (heights - heights[0]) / (heights[-1] - heights[0])
    off = np.abs(origins - origins[0] - share[:, None] * way).max(axis=1)
    if off.max() > ON_LINE * pixel:
        raise GeometryError(
            "the slices do not lie on a straight line",
            file=places[int(off.argmax())][0].path.name,
            found=f"off the line = {off.max():.3g} mm",
            expected=f"at most {ON_LINE * pixel:.3g} mm",
        )
    tilt = tilt_of(way, normal)
    notes += (f"gantry tilt of {tilt:.1f} degrees: the axes are sheared",) if tilt > TILTED else ()
    notes += ("the given distance of the slices is not used: they have positions",) if distance else ()
    return SliceLine(origins[0], way / levels[-1], levels, notes)


def tilt_of(way: NDArray[np.float64], normal: NDArray[np.float64]) -> float:
    """Return the angle between the way from the first slice to the last (3,) and their normal (3,), degrees."""
    # by the sine too: near 0 degrees, an error of 1e-8 in the cosine alone is a hundredth of a degree
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(normal, way)), normal @ way)))
