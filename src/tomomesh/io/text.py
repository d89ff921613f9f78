"""Rows of numbers in text."""

from __future__ import annotations

import codecs
import re
import warnings
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import FormatError
from .files.source import whole

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

COMMENT = re.compile(r"#|//|%")
"""What begins a comment."""

DECIMAL_COMMA = re.compile(r"[+-]?\d+(,\d+)?(e[+-]?\d+)?", re.IGNORECASE)
"""A number as much of Europe writes it."""


def read_lines(path: Path) -> list[str]:
    """Return the lines of a text in UTF-8, or in the UTF-16 of spreadsheets where its mark says so.

    Raises
    ------
    UnreadableError, FormatError
        Where the file may not be read, or is no text.
    """
    try:
        return decoded(whole(path)).splitlines()
    except UnicodeDecodeError:
        raise FormatError("the file is no text", file=str(path), expected="rows of numbers") from None


def decoded(data: bytes, errors: str = "strict") -> str:
    """Return a text in UTF-8, or in UTF-16 where its first bytes say so."""
    return data.decode("utf-16" if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig", errors)


def parse_rows(
    lines: Sequence[str], *, required: Sequence[int], file: str, before: int = 0, width: int = 0
) -> NDArray[np.float64]:
    """Return rows of equal length.

    Parameters
    ----------
    lines : sequence of str
        Text; comments, quotes and empty lines are passed over. Columns are parted by semicolons, else by
        commas, else by white space.
    required : sequence of int
        The columns, from 0, that must hold finite numbers; what is no number elsewhere becomes NaN.
    file : str
        Named in errors.
    before : int
        Lines of the file before the first of these.
    width : int
        How many columns there must be; as many as in the first row where 0.

    Returns
    -------
    (n, c) float array
        All columns; at least as many as the required ones need, also where there are no rows.

    Raises
    ------
    FormatError
        For ragged rows, and for text, NaN and infinite numbers in the required columns; it names the row.
    """
    lines = [line.replace('"', "") for line in lines] if '"' in "".join(first_row(lines)) else lines
    delimiter = delimiter_of(lines)
    least = max(width, *(column + 1 for column in required), 1)
    if not any(map(content, lines)):
        return np.empty((0, least))
    if (rows := _loaded(lines, delimiter)) is None:  # NumPy's reader knows comments by `#` alone, and no decimal commas
        lines = [content(line) for line in lines]
        lines = lines if delimiter == "," else [line.replace(",", ".") for line in lines]
        rows = _loaded(lines, delimiter)
    whole = rows is not None and width in (0, rows.shape[1]) and rows.shape[1] >= least
    if rows is not None and whole and np.isfinite(rows[:, required]).all():
        return rows
    return _parse_slowly(lines, delimiter, required, file, before, width)  # it finds the row, or passes over text


def _loaded(lines: Sequence[str], delimiter: str | None) -> NDArray[np.float64] | None:
    """Return rows of numbers; None where something is none, or rows differ in length."""
    try:
        return np.loadtxt(lines, delimiter=delimiter, ndmin=2)
    except ValueError:
        return None


def delimiter_of(lines: Sequence[str]) -> str | None:
    """Return what parts the columns, None for white space; commas within all of its words are decimal ones."""
    first = next(filter(None, map(content, lines)), "")
    words = first.split()
    if ";" in first or (len(words) > 2 and all(map(DECIMAL_COMMA.fullmatch, words))):
        return ";" if ";" in first else None
    return "," if "," in first else None


def first_row(lines: Sequence[str]) -> list[str]:
    """Return the cells of the first row."""
    return next(filter(None, map(content, lines)), "").split(delimiter_of(lines))


def content(line: str) -> str:
    """Return a line without its comment, behind ``#``, ``//`` or ``%``, and without the white space around it."""
    return COMMENT.split(line, maxsplit=1)[0].strip()


def _parse_slowly(
    lines: Sequence[str], delimiter: str | None, required: Sequence[int], file: str, before: int, width: int
) -> NDArray[np.float64]:
    rows: list[list[float]] = []
    least = max(required, default=0) + 1
    for number, line in enumerate(lines, before + 1):
        if not (plain := content(line)):
            continue
        cells = plain.split(delimiter)
        width = width or len(cells)
        if len(cells) != width or width < least:
            expected = f"{width} columns" if width >= least else f"at least {least} columns"
            raise _fault("the rows are ragged", number, f"{len(cells)} columns", expected, file)
        values = [_number(cell) for cell in cells]
        for column in required:
            _check(values[column], cells[column], number, file)
        rows.append(values)
    return np.array(rows)


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return np.nan


def _check(value: float, cell: str, number: int, file: str) -> None:
    if np.isfinite(value):
        return
    if np.isnan(value) and cell.strip().lstrip("+-").lower() != "nan":
        raise _fault("a coordinate is no number", number, "text", "a finite number", file)
    raise _fault("a coordinate is not finite", number, f"{value}", "a finite number", file)


def _fault(what: str, number: int, found: str, expected: str, file: str) -> FormatError:
    return FormatError(what, file=file, found=f"row {number} = {found}", expected=expected)


def numbers_of(lines: Sequence[str], columns: Sequence[int], kind: type) -> NDArray[Any]:
    """Return some columns (c,) of rows (n,) that white space parts, none of them empty, as (n, c) numbers of a type.

    Raises
    ------
    ValueError
        For rows that have fewer columns, or no such numbers there.
    """
    if not lines:
        return np.empty((0, len(columns)), kind)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # NumPy before 2.4 takes 1.9 for the whole number 1
        return np.loadtxt(lines, kind, comments=None, usecols=columns, ndmin=2)


def lists_of(lines: Sequence[str], sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the whole numbers behind the first word of rows (n,), `sizes` (n,) of each, row after row.

    Raises
    ------
    ValueError
        As `numbers_of`.
    """
    starts, found = np.cumsum(sizes) - sizes, np.empty(sizes.sum(), np.int64)
    for size in np.unique(sizes[sizes > 0]):
        rows = np.flatnonzero(sizes == size)
        places = starts[rows, None] + np.arange(size)
        found[places] = numbers_of([lines[row] for row in rows.tolist()], range(1, size + 1), np.int64)
    return found


def written(row: str, *columns: Sequence[Any]) -> str:
    """Return rows in words, each as a template of ``%`` says, in one pass: up to 3.6 times as fast as one by one."""
    return (row * len(columns[0])) % tuple(chain.from_iterable(zip(*columns, strict=True)))


def typed(column: NDArray[np.float64], kind: np.dtype[Any]) -> NDArray[Any]:
    """Return numbers in the type that a header declares, or as they are where it cannot hold them."""
    with np.errstate(over="ignore", invalid="ignore"):
        cast = column.astype(kind)
    return cast if kind.kind == "f" or np.array_equal(cast, column) else column
