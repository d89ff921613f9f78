"""Leica's texts of terrestrial scans: PTS and PTX, scan after scan."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...errors import FormatError
from ...model.columns import carried
from ...model.points import COLORS
from ..files.limits import require_rows
from ..text import parse_rows, read_lines
from .delimited import without_counts

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..fields import Cloud, Fields

FIELDS = {3: (), 4: ("intensity",), 6: COLORS, 7: ("intensity", *COLORS)}
"""Columns of a row to what stands behind the position."""

HEAD = 10
"""Lines before the points of a scan in PTX: columns, rows, the scanner's place and axes (4), the scan's matrix (4)."""


def read_pts(path: Path) -> Cloud:
    """Read the points of all scans; each begins with their count."""
    rows = parse_rows(without_counts(read_lines(path), str(path)), required=(0, 1, 2), file=str(path))
    return rows[:, :3], _fields(rows)


def read_ptx(path: Path) -> Cloud:
    """Read the points of all scans, each placed by its matrix; (0, 0, 0) marks places where nothing was measured."""
    lines, file = read_lines(path), str(path)
    lines = lines[: next((n for n in range(len(lines), 0, -1) if lines[n - 1].strip()), 0)]
    found, at = [], 0
    while at < len(lines):
        count, matrix = _head(lines[at : at + HEAD], file)
        at += HEAD
        require_rows(count, len(lines) - at, "points", file=file)
        rows = parse_rows(lines[at : at + count], required=(0, 1, 2), file=file, before=at)
        measured = rows[rows[:, :3].any(axis=1)]
        measured[:, :3] = carried(measured[:, :3], matrix[:3, :3], matrix[3, :3])
        found.append(measured)
        at += count
    width = min((rows.shape[1] for rows in found), default=3)
    rows = np.concatenate([np.empty((0, width)), *(rows[:, :width] for rows in found)])
    return rows[:, :3], _fields(rows)


def _head(lines: list[str], file: str) -> tuple[int, NDArray[np.float64]]:
    """Return the number of points of a scan, and its matrix, which stands behind a row vector."""
    try:
        columns, rows = (int(line) for line in lines[:2])
        matrix = np.array([[float(word) for word in line.split()] for line in lines[6:HEAD]])
        if columns < 0 or rows < 0 or matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise ValueError(lines)
    except ValueError:
        raise FormatError(
            "the head of a scan cannot be understood", file=file, expected="the ten lines of PTX"
        ) from None
    return columns * rows, matrix


def _fields(rows: NDArray[np.float64]) -> Fields:
    names = FIELDS.get(rows.shape[1], ())
    return {name: rows[:, 3 + n].astype(np.uint8 if name in COLORS else np.float64) for n, name in enumerate(names)}
