"""Which of the series in a folder is read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ....errors import GeometryError, UsageError
from ..headers.values import numbers

if TYPE_CHECKING:
    from ..headers.header import ImageFrame

NO_NUMBER = float("inf")
"""The place of a series without a number."""


@dataclass(frozen=True)
class Choice:
    """The frames of the series that is read, and what was left out."""

    frames: list[ImageFrame]
    notes: tuple[str, ...]


def choose(frames: list[ImageFrame], wanted: int | None, *, folder: str) -> Choice:
    """Take the series that is wanted, or the only one that can be a stack.

    Parameters
    ----------
    frames : list of ImageFrame
        All frames of the folder.
    wanted : int, optional
        Number of a series in the table, from 1.
    folder : str
        The path as the user typed it.

    Raises
    ------
    GeometryError
        Where several series could be meant: the error holds their table.
    UsageError
        Where the table has no such number.
    """
    series, localizers = grouped(frames)
    notes = (f"localizers left out: {localizers}",) if localizers else ()
    if wanted is not None:
        return Choice(_wanted(series, wanted, folder), notes)
    stacks = [number for number, members in enumerate(series) if len(members) > 1]
    if len(series) > 1 and len(stacks) == 1:
        note = f"series {stacks[0] + 1} of {len(series)} was taken: the only one with more than one slice"
        return Choice(series[stacks[0]], (*notes, note))
    if len(series) > 1:
        raise GeometryError(
            f"the folder holds {len(series)} series",
            file=folder,
            found=table(series),
            expected="one series",
            hint="--series N",
            flags=["--series"],
        )
    return Choice(series[0], notes)


def stacks_among(frames: list[ImageFrame]) -> list[int]:
    """Return the numbers, from 1, of the series with more than one slice; localizers are none."""
    return [number for number, members in enumerate(grouped(frames)[0], 1) if len(members) > 1]


def _wanted(series: list[list[ImageFrame]], wanted: int, folder: str) -> list[ImageFrame]:
    if not 1 <= wanted <= len(series):
        raise UsageError(
            "there is no such series",
            file=folder,
            found=table(series),
            expected=f"--series 1 to {len(series)}",
        )
    return series[wanted - 1]


def _is_localizer(frame: ImageFrame) -> bool:
    kind = frame.header.get("ImageType") or []
    return "LOCALIZER" in ([kind] if isinstance(kind, str) else list(kind))


def grouped(frames: list[ImageFrame]) -> tuple[list[list[ImageFrame]], int]:
    """Sort frames into series: by series number, identifier, and stack within an enhanced file.

    Returns
    -------
    series : list of lists of ImageFrame
        In the order of their numbers in the table.
    localizers : int
        How many frames are left out as such; none where there is nothing else.

    Raises
    ------
    FormatError
        For a series number that is none.
    """
    images = [frame for frame in frames if not _is_localizer(frame)] or frames
    groups: dict[tuple[float, str, str], list[ImageFrame]] = {}
    for frame in images:
        number = numbers(frame.header.get("SeriesNumber"), 1, "SeriesNumber", frame.path.name)
        place = NO_NUMBER if number is None else float(number[0])
        key = (place, str(frame.header.get("SeriesInstanceUID", "")), frame.stack)
        groups.setdefault(key, []).append(frame)
    return [groups[key] for key in sorted(groups)], len(frames) - len(images)


def table(series: list[list[ImageFrame]]) -> str:
    """Put series into words: number, description, slices, spacing."""
    return "; ".join(f"{number}: {_row(members)}" for number, members in enumerate(series, 1))


def _row(members: list[ImageFrame]) -> str:
    first = members[0]
    description = str(first.header.get("SeriesDescription") or "no description")
    spacing = "unknown" if first.spacing is None else " x ".join(f"{mm:.4g}" for mm in first.spacing)
    description += f", stack {first.stack}" if first.stack else ""
    return f"{description}, slices {len(members)}, {spacing}{_distance(members)} mm"


def _distance(members: list[ImageFrame]) -> str:
    """Return the distance of the slices, as far as their positions tell."""
    places = [frame.position for frame in members if frame.position is not None]
    axes = members[0].axes
    if axes is None or len(places) < 2 or len(places) < len(members):
        return ""
    heights = np.sort(np.array(places) @ np.cross(axes[0], axes[1]))
    return f" x {np.median(np.diff(heights)):.4g}"
