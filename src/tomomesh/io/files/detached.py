"""Data files that a header names: never one outside of the header's own folder."""

from __future__ import annotations

import re
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from ...errors import FormatError, UnreadableError
from .source import existing_file

if TYPE_CHECKING:
    from collections.abc import Sequence

PLACE = re.compile(r"%0?[0-9]{0,2}d")
"""The place of a number in a pattern of names."""

MOST_FILES = 2**16
"""Most files that one header may name: one a slice, and no stack has so many slices."""


def beside(header: Path, name: str) -> Path:
    """Return the path of a data file that a header names.

    Raises
    ------
    FormatError
        Where it is missing, empty or no regular file, or outside of the header's folder, links followed; a file
        outside is not touched.
    """
    bare = PurePath(name).name
    try:
        folder = header.parent.resolve()
        target = (folder / name).resolve()
    except (OSError, RuntimeError, ValueError):
        raise FormatError("the data file's name leads nowhere", file=str(header), found=bare) from None
    if not target.is_relative_to(folder):
        raise FormatError(
            "the data file is outside of its header's folder",
            file=str(header),
            found=f"data file = {bare}",
            expected="a file beside the header",
            hint="both in one folder, and the bare name in the header",
        )
    try:
        existing_file(target)
    except (UnreadableError, FormatError):
        raise FormatError(
            "the data file that the header names cannot be read",
            file=str(header),
            found=f"data file = {bare}",
            expected="a file with bytes, beside the header",
            hint="the header together with its data file",
        ) from None
    return target


def numbered(header: Path, words: Sequence[str]) -> list[Path]:
    """Return the data files of a pattern, ``slice%03d.raw 1 50 1``: pattern, first, last and step.

    Raises
    ------
    FormatError
        For another spelling, more than `MOST_FILES`, and as `beside`.
    """
    pattern = words[0] if words else ""
    numbers = [int(word) if re.fullmatch(r"-?[0-9]{1,9}", word) else None for word in words[1:4]]
    first, last, step = (*numbers, 1)[:3] if len(numbers) >= 2 else (None, None, None)
    if first is None or last is None or not step or len(PLACE.findall(pattern)) != 1 or pattern.count("%") != 1:
        raise FormatError(
            "the pattern of the data files cannot be understood",
            file=str(header),
            expected="name%03d.raw FIRST LAST STEP",
        )
    count = (last - first) // step + 1
    check_count(count, header)
    one = PLACE.findall(pattern)[0]
    return [beside(header, pattern.replace(one, one % number)) for number in range(first, first + count * step, step)]


def check_count(count: int, header: Path) -> None:
    """Refuse a header that names no data file, or too many."""
    if not 0 < count <= MOST_FILES:
        raise FormatError(
            "the header names a count of data files that cannot be",
            file=str(header),
            found=f"count = {count}",
            expected=f"1 to {MOST_FILES}",
        )
