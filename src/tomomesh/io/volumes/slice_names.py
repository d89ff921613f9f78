"""The order of slices by the numbers in their names, and what of it is to be told."""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

VALUE = re.compile(r"(?:(?<![0-9])([+\-\u2212]))?([0-9]+)(?:([.,p])([0-9]+))?([eE][+-][0-9]+)?")
"""A number with its sign, fraction and exponent, which programs write with its sign. A dash behind a digit is none."""

WHOLE = re.compile(r"()([0-9]+)()()()")
"""The groups of `VALUE` where dots and dashes mean nothing."""

CHAIN = re.compile(r"[0-9][.,p][0-9]+[.,p][0-9]")
"""Numbers with dots between, as in versions and identifiers: no fractions."""

WORDS = "the names differ in more than their numbers: they are in the order of their words and numbers"
"""What is said where numbers alone do not tell the order."""

EVENLY = Decimal("0.05")
"""Part of a step by which numbers may be off a whole number of steps: the rounding of a name, as 0.33 for a third."""

NAMED = 6
"""Missing numbers that are named, at most, so that a note stays a line."""


@dataclass(frozen=True)
class Numbers:
    """The numbers in some names that have the same words between them.

    Attributes
    ----------
    rows : list of tuple of Decimal
        Those of each name, exact: a time of the clock has more digits than a float.
    note : str
        How they were read, where it could have been otherwise.
    """

    rows: list[tuple[Decimal, ...]]
    note: str = ""


def in_order(files: Sequence[Path]) -> tuple[list[Path], tuple[str, ...]]:
    """Order slices by their names: by the value of their numbers, else as people do, slice 2 before slice 10.

    Returns
    -------
    files : list of Path
    notes : tuple of str
        Where numbers are missing, uneven or the same, or where a dash or a dot could mean something else.
    """
    stems = [path.stem for path in files]
    numbers = _by_value(stems) or _by_parts(stems) or _hexadecimal(stems)
    if numbers is None:
        return sorted(files, key=natural), (WORDS,) * any(map(WHOLE.search, stems))
    rows = numbers.rows
    order = sorted(range(len(files)), key=lambda n: (rows[n], str(files[n])))
    notes = (numbers.note, *_gaps([rows[n] for n in order]))
    return [files[n] for n in order], tuple(note for note in notes if note)


def natural(path: Path) -> tuple[list[tuple[int, int, str]], str]:
    """Order names as people do: slice 2 before slice 10."""
    parts = re.split(r"([0-9]+)", path.name)
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in parts if part], str(path)


def _by_value(stems: Sequence[str]) -> Numbers | None:
    """Read numbers with their signs, fractions and exponents; None where these can be none."""
    found = _between_words(stems, VALUE)
    if found is None or any(map(CHAIN.search, stems)) or not all(map(_are_fractions, zip(*found, strict=True))):
        return None
    fields = list(zip(*found, strict=True))
    signs = [_have_signs(field) for field in fields]
    rows = [tuple(_value(one, signed) for one, signed in zip(row, signs, strict=True)) for row in found]
    return Numbers(rows, _told(fields, signs))


def _by_parts(stems: Sequence[str]) -> Numbers | None:
    """Read whole numbers, whatever stands between them."""
    found = _between_words(stems, WHOLE)
    return None if found is None else Numbers([tuple(Decimal(one[2]) for one in row) for row in found])


def _hexadecimal(stems: Sequence[str]) -> Numbers | None:
    """Read the part that differs as base 16, where that gives even steps."""
    low, high = min(stems), max(stems)
    same = next((n for n, (a, b) in enumerate(zip(low, high, strict=False)) if a != b), 0)
    rest = [stem[same:] for stem in stems]
    if len(stems) < 3 or not all(re.fullmatch(r"[0-9a-f]{1,13}|[0-9A-F]{1,13}", one) for one in rest):
        return None
    values = [int(one, 16) for one in rest]
    steps = np.diff(np.sort(np.array(values, float)))
    note = "the numbers in the names are taken for hexadecimal"
    return Numbers([(Decimal(value),) for value in values], note) if steps.min() == steps.max() > 0 else None


def _between_words(stems: Sequence[str], number: re.Pattern[str]) -> list[list[re.Match[str]]] | None:
    """Return the numbers of each name, None where the words between them differ."""
    words = {number.sub("\0", stem).casefold() for stem in stems}
    found = [list(number.finditer(stem)) for stem in stems]
    return found if len(words) == 1 and found[0] else None


def _are_fractions(field: Sequence[re.Match[str]]) -> bool:
    """Tell whether what follows the dots is a fraction: as many digits wherever there is one, or none that end in 0.

    1.9 and 1.10 are parts 9 and 10 of something; 1, 1.50 and 2 are none.
    """
    ends = [one[4] for one in field if one[4]]
    return len(set(map(len, ends))) < 2 or not any(end.endswith("0") for end in ends)


def _have_signs(field: Sequence[re.Match[str]]) -> bool:
    """Tell a sign from a dash between words: it stands in some names only, or behind no letter."""
    dashed = [bool(one[1]) and one[1] != "+" for one in field]
    return any(dashed) and (not all(dashed) or not all(one.string[: one.start()][-1:].isalnum() for one in field))


def _value(found: re.Match[str], signed: bool) -> Decimal:
    size = Decimal(f"{found[2]}.{found[4] or 0}{found[5] or ''}")
    return -size if signed and found[1] != "+" and found[1] else size


def _told(fields: Sequence[Sequence[re.Match[str]]], signs: Sequence[bool]) -> str:
    """Say how the numbers that differ were read, where dashes or dots could mean something else."""
    differ = [
        (field, signed) for field, signed in zip(fields, signs, strict=True) if len({one[0] for one in field}) > 1
    ]
    read = [
        *(["with minus signs"] if any(signed for _, signed in differ) else []),
        *(["with fractions"] if any(one[4] for field, _ in differ for one in field) else []),
        *(["with exponents"] if any(one[5] for field, _ in differ for one in field) else []),
    ]
    dashes = any(not signed and any(one[1] == "-" for one in field) for field, signed in differ)
    read += ["without signs, for the dash is in all of them"] if dashes else []
    return f"the numbers in the names are taken {' and '.join(read)}" if read else ""


def _gaps(rows: Sequence[tuple[Decimal, ...]]) -> tuple[str, ...]:
    """Say which numbers are missing, given those of the slices in their order."""
    differ = [field for field in zip(*rows, strict=True) if len(set(field)) > 1]
    if len(differ) != 1:
        return ("the names differ in several numbers, of which the first leads",) if differ else ()
    own = differ[0]
    steps = [after - before for before, after in pairwise(own)]
    least = min(steps)
    if not least:
        return ("several slices have the same number in their names",)
    counts = [round(step / least) for step in steps]
    wide = sum(count > 1 for count in counts)
    if 2 * wide > len(counts) or any(abs(a / least - b) > EVENLY for a, b in zip(steps, counts, strict=True)):
        told = f"{float(least):g} to {float(max(steps)):g} apart"
        return (f"the numbers in the names are {told}: the slices are taken as even",)
    gone = [
        (start + least * n) for start, count in zip(own, counts, strict=False) for n in range(1, min(count, NAMED + 2))
    ]
    if not gone:
        return ()
    named = ", ".join(f"{float(value):.10g}" for value in gone[:NAMED]) + (", ..." if len(gone) > NAMED else "")
    return (f"numbers missing among the names: {named}: the slices beside them are taken for neighbors",)
