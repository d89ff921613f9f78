"""All series of a study, from their headers alone: what each is, and what would be refused."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import GeometryError, TomomeshError
from ...names import shown
from ..files import read_frames
from .choice import grouped
from .regular import steps_between
from .same_geometry import check_same_geometry, middle_of
from .stack import SAME_PLACE, axes_of, pixel_of, placed, stacked, tilt_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ....settings import ReadSettings
    from ..headers.header import ImageFrame

UNREADABLE = "unreadable"
LOCALIZERS = "localizers"


@dataclass(frozen=True)
class SliceSpacing:
    """Where the slices of a series are, as far as their headers tell.

    Attributes
    ----------
    distances_mm : (least, greatest) or None
        Distance of neighboring slices along their normal.
    gaps_mm : tuple of (low, high)
        Heights along the normal between which slices are missing from a regular stack.
    missing : int
        How many are missing.
    tilt_deg : float or None
        Angle between the way from the first slice to the last and their normal.
    repeats : int
        How many slices are at the position of another.
    """

    distances_mm: tuple[float, float] | None = None
    gaps_mm: tuple[tuple[float, float], ...] = ()
    missing: int = 0
    tilt_deg: float | None = None
    repeats: int = 0


@dataclass(frozen=True)
class Series:
    """One series of a study.

    Attributes
    ----------
    number : int
        By which `ReadSettings.series` takes it.
    description, modality : str
        As its header has them, on one line; empty where it has none.
    slices : int
        Those at the position of another counted too.
    size : (rows, columns)
        In pixels.
    pixel_mm : (x, y) or None
        Distance of the columns and of the rows.
    slice_spacing : SliceSpacing
        Where the slices are.
    refused : TomomeshError or None
        Why it cannot be read as it is; None where the headers speak for it.
    """

    number: int
    description: str
    modality: str
    slices: int
    size: tuple[int, int]
    pixel_mm: tuple[float, float] | None
    slice_spacing: SliceSpacing
    refused: TomomeshError | None

    @property
    def told(self) -> dict[str, Any]:
        """All of it, ready for JSON."""
        rows, columns = self.size
        return {
            "number": self.number,
            "description": self.description,
            "modality": self.modality,
            "slices": self.slices,
            "rows": rows,
            "columns": columns,
            "pixel_mm": self.pixel_mm,
            "distances_mm": self.slice_spacing.distances_mm,
            "tilt_deg": self.slice_spacing.tilt_deg,
            "missing": self.slice_spacing.missing,
            "gaps_mm": self.slice_spacing.gaps_mm,
            "repeats": self.slice_spacing.repeats,
            "refused": None if self.refused is None else self.refused.told,
        }


@dataclass(frozen=True)
class Listing:
    """The series of a study.

    Attributes
    ----------
    series : tuple of Series
    left_out : tuple of (reason, count)
        What belongs to none.
    files : int
        How many belong to one; 1 for a segmentation, which has no series.
    segments : tuple of (number, label)
        Those of a segmentation.
    """

    series: tuple[Series, ...] = ()
    left_out: tuple[tuple[str, int], ...] = ()
    files: int = 0
    segments: tuple[tuple[int, str], ...] = ()

    @property
    def told(self) -> list[dict[str, Any]]:
        """The series, ready for JSON; descriptions, which people write freely, only where there is a choice to make."""
        alone = len(self.series) == 1
        return [one.told | ({"description": None} if alone else {}) for one in self.series]


def list_dicom(files: list[Path], settings: ReadSettings, *, study: str, others: Counter[str]) -> Listing:
    """List the series among some files; no pixels are decoded.

    Parameters
    ----------
    files : list of Path
        Files in any order.
    settings : ReadSettings
        Under which each series would be read.
    study : str
        The path as the user typed it.
    others : Counter
        Entries that were passed over before, by reason.

    Raises
    ------
    FormatError
        For a series number that is none.
    """
    reading = read_frames(files)
    series, localizers = grouped(reading.frames)
    left_out = others + reading.others + Counter({LOCALIZERS: localizers, UNREADABLE: len(reading.bad)})
    listed = tuple(_described(number, members, settings, study) for number, members in enumerate(series, 1))
    return Listing(listed, tuple(sorted(left_out.items())), len({frame.path for frame in reading.frames}))


def _described(number: int, members: list[ImageFrame], settings: ReadSettings, study: str) -> Series:
    first = members[0]
    words = [_word(first.header.get("SeriesDescription")), f"stack {_word(first.stack)}" if first.stack else ""]
    return Series(
        number,
        ", ".join(filter(None, words)),
        _word(first.header.get("Modality")),
        len(members),
        first.size,
        None if first.spacing is None else (float(first.spacing[0]), float(first.spacing[1])),
        _slice_spacing(members, settings),
        _refusal(members, settings, study),
    )


def _word(value: object) -> str:
    return shown(value) if value else ""


def _refusal(members: list[ImageFrame], settings: ReadSettings, study: str) -> TomomeshError | None:
    try:
        stacked(members, settings, study=study)
    except TomomeshError as fault:
        return fault
    return None


def _slice_spacing(members: list[ImageFrame], settings: ReadSettings) -> SliceSpacing:
    """Follow the slices of a series, if they are parallel and have positions."""
    if any(frame.position is None for frame in members):
        return SliceSpacing()
    try:
        check_same_geometry(members)
        middle, _ = middle_of(members)
        normal = np.cross(*axes_of(middle))
        places = placed(members, normal, SAME_PLACE * min(pixel_of(middle, settings)))
    except GeometryError:
        return SliceSpacing()
    origins = np.array([place[0].position for place in places])
    repeats = len(members) - len(places)
    return _between(origins, normal, repeats) if len(places) > 1 else SliceSpacing(repeats=repeats)


def _between(origins: NDArray[np.float64], normal: NDArray[np.float64], repeats: int) -> SliceSpacing:
    """Measure the way from slice to slice; their first voxels are `origins` (s, 3), two at least."""
    heights = origins @ normal
    gaps = np.diff(heights)
    steps, whole = steps_between(gaps)
    wide = np.flatnonzero((steps > 1) & whole)
    return SliceSpacing(
        (float(gaps.min()), float(gaps.max())),
        tuple((float(heights[n]), float(heights[n + 1])) for n in wide),
        int((steps[wide] - 1).sum()),
        tilt_of(origins[-1] - origins[0], normal),
        repeats,
    )
