"""Rows of numbers in text."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


def parse_rows(lines: Sequence[str], *, columns: Sequence[int], file: str, before: int = 0) -> NDArray[np.float64]:
    """Return some columns of rows of equal length.

    Parameters
    ----------
    lines : sequence of str
        Text; what follows ``#`` and empty lines are passed over. Columns are parted by semicolons, else by
        commas, else by white space.
    columns : sequence of int
        The columns to take, from 0; only they must hold numbers.
    file : str
        Named in errors.
    before : int
        Lines of the file before the first of these.

    Returns
    -------
    (n, c) float array
        Finite numbers.

    Raises
    ------
    FormatError
        For text, NaN, infinite numbers and ragged rows; it names the row.
    """
    delimiter = delimiter_of(lines)
    try:
        rows = np.loadtxt(lines, delimiter=delimiter, ndmin=2) if any(map(_content, lines)) else np.empty((0, 0))
        if not rows.size or (rows.shape[1] > max(columns) and np.isfinite(rows[:, columns]).all()):
            return rows[:, columns] if rows.size else np.empty((0, len(columns)))
    except ValueError:
        pass  # the slow way finds the row, or passes over columns of text
    return _parse_slowly(lines, delimiter, columns, file, before)


def delimiter_of(lines: Sequence[str]) -> str | None:
    """Return what parts the columns, None for white space."""
    content = next(filter(None, map(_content, lines)), "")
    return next((mark for mark in ";," if mark in content), None)


def _content(line: str) -> str:
    return line.partition("#")[0].strip()


def _parse_slowly(
    lines: Sequence[str], delimiter: str | None, columns: Sequence[int], file: str, before: int
) -> NDArray[np.float64]:
    rows: list[list[float]] = []
    width = 0
    for number, line in enumerate(lines, before + 1):
        if not (content := _content(line)):
            continue
        fields = content.split(delimiter)
        width = width or len(fields)
        if len(fields) != width or width <= max(columns):
            expected = f"{width} columns" if width > max(columns) else f"at least {max(columns) + 1} columns"
            raise _fault("the rows are ragged", number, f"{len(fields)} columns", expected, file)
        rows.append([_number(fields[column], number, file) for column in columns])
    return np.array(rows).reshape(-1, len(columns))


def _number(field: str, number: int, file: str) -> float:
    try:
        value = float(field)
    except ValueError:
        raise _fault("a coordinate is no number", number, "text", "a finite number", file) from None
    if not np.isfinite(value):
        raise _fault("a coordinate is not finite", number, f"{value}", "a finite number", file)
    return value


def _fault(what: str, number: int, found: str, expected: str, file: str) -> FormatError:
    return FormatError(what, file=file, found=f"row {number} = {found}", expected=expected)
