"""The chain of pages in a TIFF file, looked at before tifffile follows it: it would go around a circle for ever."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

from ...errors import FormatError

if TYPE_CHECKING:
    from pathlib import Path


def check_chain(path: Path, *, file: str) -> None:
    """Refuse a file of which a page leads back to an earlier one; what else is wrong, tifffile tells.

    Raises
    ------
    FormatError
        For a circle of pages.
    """
    size, seen = path.stat().st_size, set[int]()
    with path.open("rb") as stream:
        head = stream.read(4)
        order = ">" if head[:2] == b"MM" else "<"
        big = head[2:] in (b"\0\x2b", b"\x2b\0")
        count, entry, place = ("Q", 20, "Q") if big else ("H", 12, "I")
        offset = _number(stream, 8 if big else 4, order + place, size)
        while offset:
            if offset in seen:
                found = f"pages = {len(seen)}, then the one at byte {offset} again"
                raise FormatError("the pages of the file go around in a circle", file=file, found=found)
            seen.add(offset)
            entries = _number(stream, offset, order + count, size)
            after = offset + struct.calcsize(order + count) + entries * entry
            offset = _number(stream, after, order + place, size)


def _number(stream: Any, start: int, layout: str, size: int) -> int:
    """Return a whole number of the file, 0 behind its end."""
    length = struct.calcsize(layout)
    if start + length > size:
        return 0
    stream.seek(start)
    return int(struct.unpack(layout, stream.read(length))[0])
