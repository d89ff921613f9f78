"""Clouds as text: XYZ, TXT and CSV, and the vertices of OBJ."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from ...model.points import COLORS
from ..fields import AXES, IDS, flat_columns
from ..files.atomic import replacing
from ..text import delimiter_of, first_row, parse_rows, read_lines, typed

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...model.points import PointSet
    from ..fields import Cloud, Fields
    from ..meshes.attributes import MeshAttributes

AXIS = re.compile(r"([xyz])(\W.*|_(mm|cm|m|um|km|in|ft))?", re.IGNORECASE)
"""What the column of a coordinate is called: ``x``, ``X_mm``, ``x [m]``."""


def read_text(path: Path) -> Cloud:
    """Read rows of numbers; one line of names may come first, also behind ``#`` or ``//``.

    Columns named x, y and z are the positions, else the first three are. The other columns that have a name
    and hold numbers are fields.
    """
    lines = read_lines(path)
    names = _names(lines[0]) if lines else []
    before = 1 if names else 0
    axes = _axes(names)
    rows = parse_rows(lines[before:], required=axes, file=str(path), before=before)
    return rows[:, axes], _named_columns(rows, names, axes, first_row(lines[before:]))


def _names(line: str) -> list[str]:
    """Return the names of the columns, none where the line has none.

    A line of names has three words at least, and no number among the first three; a comment must name x, y, z.
    """
    comment = line.lstrip().startswith("#")
    plain = line.strip().lstrip("#/").strip()
    names = [word.strip().strip("\"'") for word in plain.split(delimiter_of([plain]))]
    named = len(names) >= 3 and not any(map(_is_number, names[:3]))
    return names if named and (not comment or len(_found_axes(names)) == 3) else []


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _found_axes(names: list[str]) -> dict[str, int]:
    matches = [AXIS.fullmatch(name) for name in names]
    return {match[1].lower(): column for column, match in reversed([*enumerate(matches)]) if match}


def _axes(names: list[str]) -> list[int]:
    found = _found_axes(names)
    return [found[axis] for axis in AXES] if len(found) == 3 else [0, 1, 2]


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
    lines = [line.lstrip()[2:] if line.lstrip()[:2] in ("v ", "v\t") else "" for line in read_lines(path)]
    rows = parse_rows(lines, required=(0, 1, 2), file=str(path))
    colors = rows[:, -3:].T if rows.shape[1] >= 6 else ()
    return rows[:, :3], dict(zip(COLORS, colors, strict=False))


def write_xyz(points: PointSet, path: str | Path, beside: MeshAttributes) -> None:
    """Write positions under a comment."""
    rows = (f"{x!r} {y!r} {z!r}" for x, y, z in points.positions.tolist())
    _write_lines(path, [f"# {beside.head}", *rows])


def write_csv(points: PointSet, path: str | Path, beside: MeshAttributes) -> None:
    """Write positions, ids and attributes under a line of names."""
    head = [axis if beside.unit == "unknown" else f"{axis}_{beside.unit}" for axis in AXES]
    others = flat_columns(points.attributes, len(points), [*AXES, *head, *IDS])
    ids = (points.slices, points.neurons, points.kinds)
    columns: list[NDArray[Any]] = [*points.positions.T, *ids, *others.values()]
    rows = zip(*(map(repr, column.tolist()) for column in columns), strict=True)
    _write_lines(path, [",".join([*head, *IDS, *others]), *map(",".join, rows)])


def _write_lines(path: str | Path, lines: list[str]) -> None:
    with replacing(path) as file:
        file.write(("\n".join(lines) + "\n").encode("ascii"))
