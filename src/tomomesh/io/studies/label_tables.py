"""Tables of label names beside a label map: what each program that draws labels writes."""

from __future__ import annotations

import csv
import json
import re
import shlex
from typing import TYPE_CHECKING

from ...errors import FormatError
from ..files.source import suffix_of, whole
from ..text import decoded

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

NUMBERS = ("label", "labelvalue", "index", "value", "id", "labelid", "number", "no", "key", "intensity")
NAMES = ("name", "labelname", "structure", "structurename", "region", "segment", "text", "description")
"""Heads of the columns of numbers and of names, in small letters without spaces and signs, the likeliest first."""
EXPECTED = "a number and a name a row: .csv, .tsv, .json, FreeSurfer's, ITK-SNAP's or 3D Slicer's text"
FIELDS_OF_SNAP = 8
"""Number, red, green, blue, opacity, visibility, mesh visibility, and the name in quotes."""


def read_label_names(path: str | Path) -> dict[int, str]:
    """Return the names of labels by their numbers, as a table has them.

    Tables are CSV or TSV with a head (BIDS: ``index``, ``name``) or two columns; JSON of numbers to names or of names
    to numbers, also under ``labels`` (nnU-Net); and text in columns: FreeSurfer's and 3D Slicer's ``No. Name R G B A``,
    ITK-SNAP's label descriptions.

    Raises
    ------
    UnreadableError, FormatError
        Where there is no such file, it is no such table, or names one number twice.
    """
    try:
        text = decoded(whole(path))
        read = {".json": _of_json, ".csv": _of_table, ".tsv": _of_table}.get(suffix_of(path), _of_text)
        rows = [(_number(number), name.strip()) for number, name in read(text)]
    except (ValueError, RecursionError, csv.Error) as fault:
        told = str(fault) if type(fault) is ValueError else "no text, or no JSON"
        raise FormatError("the names of labels cannot be read", file=str(path), found=told, expected=EXPECTED) from None
    names = dict(rows)
    if len(names) < len(rows):
        numbers = [number for number, _ in rows]
        twice = next(number for number in numbers if numbers.count(number) > 1)
        raise FormatError("a label has two names", file=str(path), found=f"label = {twice}", expected="one a label")
    if not names:
        raise FormatError("the table names no label", file=str(path), expected=EXPECTED)
    return names


def _number(text: str) -> int:
    """Return a whole number, which a spreadsheet may have given a point."""
    if not re.fullmatch(r"\s*[+-]?[0-9]{1,18}(\.0*)?\s*", text):
        raise ValueError(f"{text[:40]} in place of a number")
    return int(text.partition(".")[0])


def _of_json(text: str) -> list[tuple[str, str]]:
    found = json.loads(text)
    found = found.get("labels", found) if isinstance(found, dict) else found
    if not isinstance(found, dict):
        raise ValueError(f"{type(found).__name__} in place of an object")
    by_name = all(isinstance(value, int) for value in found.values())
    pairs = [(str(value), key) if by_name else (key, value) for key, value in found.items()]
    other = [value for _, value in pairs if not isinstance(value, str)]
    if other:
        raise ValueError(f"{type(other[0]).__name__} in place of a name")
    return pairs


def _of_table(text: str) -> list[tuple[str, str]]:
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    parts = max("\t;,", key=(lines or [""])[0].count)
    rows = [row for row in csv.reader(lines, delimiter=parts) if any(cell.strip() for cell in row)]
    if not rows:
        return []
    number, name, head = _columns(rows[0])
    if any(len(row) <= max(number, name) for row in rows):
        raise ValueError("a row without a name")
    return [(row[number], row[name]) for row in rows[head:]]


def _columns(first: Sequence[str]) -> tuple[int, int, int]:
    """Return the columns of numbers and of names, and how many rows are a head."""
    if re.fullmatch(r"\s*[+-]?[0-9.]+\s*", first[0]):
        return 0, 1, 0
    heads = [re.sub(r"[^a-z]", "", cell.lower()) for cell in first]
    found = [next((heads.index(head) for head in known if head in heads), None) for known in (NUMBERS, NAMES)]
    number, name = found
    if name is None and "label" in heads and number != heads.index("label"):
        name = heads.index("label")
    if number is None or name is None:
        raise ValueError(f"columns {', '.join(first)[:80]}")
    return number, name, 1


def _of_text(text: str) -> list[tuple[str, str]]:
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith(("#", "//"))]
    return [_of_line(line) for line in lines]


def _of_line(line: str) -> tuple[str, str]:
    """Take a row of ITK-SNAP, whose name is the last, or of the others, whose name is the second."""
    words = shlex.split(line, posix=True) if '"' in line else line.split()
    if len(words) == FIELDS_OF_SNAP and line.rstrip().endswith('"'):
        return words[0], words[-1]
    if len(words) not in (2, 6) or not all(re.fullmatch("[0-9.]+", word) for word in words[2:]):
        raise ValueError(f"the row {' '.join(words)[:80]}")
    return words[0], words[1]
