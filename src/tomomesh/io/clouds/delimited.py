"""Clouds as text: XYZ, TXT and CSV, and the vertices of OBJ."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ...model.points import COLORS
from ..fields import AXES, IDS, flat_columns
from ..files.atomic import replacing
from ..files.limits import require_rows
from ..files.source import first_bytes, whole
from ..meshes.obj import VERTEX, unfolded
from ..text import content, decoded, delimiter_of, first_row, parse_rows, read_lines, typed, written
from .columns import PositionColumns, named_positions, positions_among

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...model.points import PointSet
    from ..fields import Cloud, Fields
    from ..meshes.attributes import MeshAttributes

LONGEST_HEAD = 1 << 16
"""Bytes at the beginning of a text in which its names are looked for."""

COUNTING = (
    "the first of the columns without names counts, as that of contours does, and was taken for x: a line of names, "
    "as contour,x,y,z, says which are the positions",
)
"""What is said of it."""


@dataclass(frozen=True)
class Table:
    """The lines of a text, those of counts and names made empty, and the names of its columns."""

    lines: list[str]
    names: list[str]
    columns: PositionColumns


def read_text(path: Path) -> Cloud:
    """Read rows of numbers; one line of names may come first, also as a comment, and a count before it.

    Columns that are named as positions are (`named_positions`), else the first three. The other columns
    that have a name and hold numbers are fields.
    """
    file = str(path)
    found = _table(without_counts(read_lines(path), file), file)
    axes = list(found.columns.axes)
    rows = parse_rows(found.lines, required=axes, file=file)
    return rows[:, axes], _named_columns(rows, found.names, axes, first_row(found.lines))


def columns_frame(path: Path) -> dict[str, Any]:
    """Return the unit and the frame that the names of the columns state, and what is to be told of them."""
    head = decoded(first_bytes(path, LONGEST_HEAD), "replace")
    table = _table(head.splitlines() if len(head) < LONGEST_HEAD else head.splitlines()[:-1], str(path))
    columns = table.columns
    stated = {"frame": columns.frame} if columns.frame else {}
    counting = COUNTING if not table.names and _counts(table.lines) else ()
    return {"unit": columns.unit, "notes": columns.notes + counting} | stated


def _counts(lines: list[str]) -> bool:
    """Tell whether the first of more than three columns without names counts something, as contours: 0, 0, 1, 1, 1."""
    delimiter = delimiter_of(lines)
    rows = [line.split(delimiter) for line in lines if line.partition("#")[0].strip()]
    firsts = [row[0].strip() for row in rows]
    if len(rows) < 3 or min(map(len, rows)) < 4 or not all(map(str.isdecimal, firsts)):
        return False
    steps = np.diff([int(first) for first in firsts])
    return bool(((steps == 0) | (steps == 1)).all())


def _table(lines: list[str], file: str) -> Table:
    """Find the line of names: the first that is no comment, or a comment before it that names the positions."""
    first = next((n for n, line in enumerate(lines) if content(line)), len(lines))
    for n in (*range(first), *((first,) if first < len(lines) else ())):
        names = _names(lines[n])
        if named_positions(names) or (names and n == first):
            kept = [*lines[:n], "", *lines[n + 1 :]] if n == first else lines
            return Table(kept, names, positions_among(names, file=file))
    return Table(lines, [], PositionColumns())


def without_counts(lines: list[str], file: str) -> list[str]:
    """Make lines empty that say how many rows follow, and a comment behind the first, where the text begins so.

    Raises
    ------
    FormatError
        Where the rows are not as many.
    """
    at = _next_row(lines, 0)
    if at == len(lines) or not lines[at].strip().isdigit():
        return lines
    kept = list(lines)
    while at < len(kept):
        word = kept[at].strip()
        if not word.isdigit():
            raise FormatError(
                "the count of the rows is wrong", file=file, found=f"row {at + 1} = another one",
                expected="as many as it says",
            )  # fmt: skip
        kept[at], at = "", _next_row(kept, at + 1)
        behind = kept[at] if at < len(kept) else ""
        if behind and _is_comment(behind):
            kept[at], at = "", _next_row(kept, at + 1)
        end = at + int(word) + bool(named_positions(_names(behind)))
        require_rows(int(word), sum(map(bool, map(str.strip, kept[at:end]))), "rows", file=file)
        at = _next_row(kept, end)
    return kept


def _next_row(lines: list[str], start: int) -> int:
    """Return the number of the next line that holds anything."""
    return next((n for n in range(start, len(lines)) if content(lines[n])), len(lines))


def _is_comment(line: str) -> bool:
    """Tell whether a line behind a count is words that name no positions."""
    names = _names(line)
    return not named_positions(names) and not _is_number(line.replace(",", " ").replace(";", " ").split()[0])


def _names(line: str) -> list[str]:
    """Return the names of the columns, none where the line has none.

    A line of names has three words at least, and no number among the first three.
    """
    plain = line.strip().lstrip("#/%").strip()
    words = re.split(r"\t+", plain) if "\t" in plain else plain.split(delimiter_of([plain]))
    names = [word.strip().strip("\"'") for word in words]
    return names if len(names) >= 3 and not any(map(_is_number, names[:3])) else []


def _is_number(word: str) -> bool:
    try:
        float(word.replace(",", "."))
    except ValueError:
        return False
    return True


def _named_columns(rows: NDArray[np.float64], names: list[str], axes: list[int], first: list[str]) -> Fields:
    """Return the other columns that hold a number; whole ones, if they are written so, as integers."""
    fields: Fields = {}
    for column, name in enumerate(names[: rows.shape[1]]):
        values = rows[:, column]
        if name and column not in axes and not np.isnan(values).all():
            whole = first[column].strip().lstrip("+-").isdigit()
            fields[name] = typed(values, np.dtype(np.int64)) if whole else values
    return fields


def read_obj(path: Path) -> Cloud:
    """Read the vertices of an OBJ file, with their colors where they have any."""
    vertices = [line.split()[1:] if VERTEX.match(line) else [] for line in unfolded(whole(path), str(path))]
    width = max(min((len(words) for words in vertices if words), default=3), 3)
    lines = [" ".join(words[:width]) for words in vertices]
    rows = parse_rows(lines, required=(0, 1, 2), file=str(path))
    colors = rows[:, 3:6].T if rows.shape[1] == 6 else rows[:, 4:7].T if rows.shape[1] > 6 else ()
    return rows[:, :3], dict(zip(COLORS, colors, strict=False))


def write_xyz(points: PointSet, path: str | Path, beside: MeshAttributes) -> None:
    """Write positions under a comment."""
    _write(path, f"# {beside.head}", written("%r %r %r\n", *points.positions.T.tolist()))


def write_csv(points: PointSet, path: str | Path, beside: MeshAttributes) -> None:
    """Write positions, ids and attributes under a line of names."""
    head = [axis if beside.unit == "unknown" else f"{axis}_{beside.unit}" for axis in AXES]
    others = flat_columns(points.attributes, len(points), [*AXES, *head, *IDS])
    ids = (points.slices, points.neurons, points.kinds)
    columns: list[NDArray[Any]] = [*points.positions.T, *ids, *others.values()]
    rows = written(",".join(["%r"] * len(columns)) + "\n", *(column.tolist() for column in columns))
    _write(path, ",".join([*head, *IDS, *others]), rows)


def _write(path: str | Path, head: str, rows: str) -> None:
    with replacing(path) as file:
        file.write(f"{head}\n{rows}".encode("ascii"))
