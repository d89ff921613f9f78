"""What `tomomesh inspect` tells a person."""

from __future__ import annotations

from textwrap import TextWrapper
from typing import TYPE_CHECKING, Any

from ..summary.stage_one import limit_in_words, of_way
from .series_table import TILTED, table_of

if TYPE_CHECKING:
    from collections.abc import Iterable

BARS = " ▁▂▃▄▅▆▇█"
SIDES = 6
LISTED = 12
"""Labels that are listed, the largest first."""
UNBROKEN = "\N{NO-BREAK SPACE}"
INDENT, WIDTH = 10, 100
"""Columns of the headings and of a line; commands are never broken."""


def of_study(found: dict[str, Any]) -> list[str]:
    """Say what is in a study, what would be refused, and what to do with it.

    Parameters
    ----------
    found : dict
        As `inspected` returns it.
    """
    refused, last = found["refused"], found["next"]
    return [
        *_of_series(found),
        *(_told("segments", _segments(found["segments"])) if refused and found["segments"] else []),
        *(_of_voxels(found) if not refused else _told("refused", _in_words(refused))),
        *(of_way(found["way"]) if last and found.get("way") else []),
        *([f"{'next':<{INDENT}}{last}"] if last else []),
    ]


def _told(heading: str, text: str) -> list[str]:
    """Break a text into lines under a heading."""
    wrapper = TextWrapper(
        WIDTH,
        initial_indent=f"{heading:<{INDENT}}",
        subsequent_indent=" " * INDENT,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace(UNBROKEN, " ") for line in wrapper.wrap(text)]


def _listed(entries: Iterable[str], between: str) -> str:
    """Join entries that a line is not to break."""
    return between.join(entry.replace(" ", UNBROKEN) for entry in entries)


def _in_words(refusal: dict[str, Any]) -> str:
    return f"exit {refusal['exit_code']}: {refusal['error']}"


def _of_series(found: dict[str, Any]) -> list[str]:
    """Draw the table of the series, each with what is wrong with it alone."""
    if not found["series"]:
        return []
    first, *rows = table_of(found["series"])
    lines = [f"{'series':<{INDENT}}{first}", *(" " * INDENT + row for row in rows)]
    for series in found["series"]:
        if series["refused"] and series["refused"] != found["refused"]:
            lines += _told("", f"{series['number']}: {_in_words(series['refused'])}")
    left_out = _listed((f"{count} {reason}" for reason, count in found["left_out"].items()), ", ")
    return lines + (_told("left out", left_out) if left_out else [])


def _of_voxels(found: dict[str, Any]) -> list[str]:
    slices, rows, columns = found["slices_rows_columns"]
    x, y, z = found["spacing_mm"]
    tilt = f"; slices sheared by {found['tilt_deg']:.1f} deg" if found["tilt_deg"] >= TILTED else ""
    return [
        f"size      {slices} slices x {rows} rows x {columns} columns (S x P x L), "
        f"{found['layers']} layer(s) of {found['type']}",
        f"spacing   {x:g} x {y:g} x {z:g} mm (L, P, S){tilt}",
        f"extent    {' x '.join(f'{side:g}' for side in found['size_mm'])} mm, first voxel at "
        f"({', '.join(f'{round(c, 9) + 0.0:g}' for c in found['corner_mm'])}) mm LPS",
        f"slices    stored {found['stored_plane']}, columns-rows-slices run {found['stored_axes']}; "
        f"taken {found['default_plane']} by default",
        f"levels    {found['lowest']:g} to {found['highest']:g} ({found['gray_unit']}){_drawn(found)}",
        f"          {_histogram(found['histogram'])}",
        *_told("windows", _windows(found["windows"])),
        *(_told("labels", _labels(found["labels"])) if found["labels"] else []),
        *(line for note in [*found["notes"], *found["remarks"]] for line in _told("note", note)),
    ]


def _drawn(found: dict[str, Any]) -> str:
    """Say what the histogram is drawn of, where it is not all levels."""
    low, high = found["histogram_from"], found["histogram_to"]
    return "" if (low, high) == (found["lowest"], found["highest"]) else f", drawn from {low:.4g} to {high:.4g}"


def _histogram(counts: list[int]) -> str:
    tallest = max(max(counts), 1)
    return "".join(BARS[round((len(BARS) - 1) * (count / tallest) ** 0.5)] for count in counts)


def _windows(windows: dict[str, Any]) -> str:
    return _listed((f"{name}: {_window(window)}" for name, window in windows.items()), "; ")


def _window(window: dict[str, Any]) -> str:
    cut = window["cut_off_at"]
    where = "" if not cut else "; cut off on all sides" if len(cut) == SIDES else f"; cut off at {' '.join(cut)}"
    return f"{_bounds(window['lower'], window['upper'])} ({window['share']:.1%}{where})"


def _bounds(lower: Any, upper: float | None) -> str:
    """Put a window into words; one without a lower bound has an upper."""
    if upper is None:
        return f"k > {limit_in_words(lower)}"
    return f"k <= {upper:g}" if lower is None else f"{limit_in_words(lower)} < k <= {upper:g}"


def _segments(segments: dict[int, str]) -> str:
    return _listed((f"{number} {label}" for number, label in segments.items()), ", ")


def _labels(labels: dict[str, int]) -> str:
    largest = sorted(labels.items(), key=lambda entry: (-entry[1], int(entry[0])))
    told = _listed((f"{label} ({count})" for label, count in largest[:LISTED]), ", ")
    more = f" and {len(labels) - LISTED} more" if len(labels) > LISTED else ""
    return f"{len(labels)}, with their voxels: {told}{more}"
