"""What a compressed frame says of itself, read before a decoder sees it."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from ....errors import FormatError

if TYPE_CHECKING:
    from .layout import PixelLayout

JPEG_START, JPEG2000_START = b"\xff\xd8", b"\xff\x4f\xff\x51"
END = b"\xff\xd9"
"""JPEG, JPEG-LS and JPEG-2000 all end with it."""

STREAM_PADDING = b"\0\xff"
"""What files put behind the end for an even number of bytes."""

FRAME_MARKERS = {*range(0xC0, 0xD0), 0xF7} - {0xC4, 0xC8, 0xCC}
"""The second byte of the markers before the size in JPEG (0xC0 to 0xCF) and JPEG-LS (0xF7)."""


def check_stream(code: bytes, layout: PixelLayout) -> None:
    """Compare a compressed frame's own size with that of the header, and look for its end.

    A decoder allocates what the stream promises, and leaves gray what a cut stream does not hold.

    Raises
    ------
    FormatError
        Where they differ, or there is no size or no end.
    """
    found = stream_size(code)
    if found != (layout.rows, layout.columns, layout.samples):
        raise FormatError(
            "the compressed pixels do not match the header",
            file=layout.name,
            found="size = none" if found is None else "rows x columns x samples = {} x {} x {}".format(*found),
            expected=f"{layout.rows} x {layout.columns} x {layout.samples}",
        )
    if not code.rstrip(STREAM_PADDING).endswith(END):
        raise FormatError(
            "the compressed pixels are cut off", file=layout.name, expected="a whole stream", hint="a fresh copy"
        )


def stream_size(code: bytes) -> tuple[int, int, int] | None:
    """Return the rows, columns and samples that a stream promises, None where it does not say.

    Source: ISO/IEC 10918-1 B.2.2 (JPEG), 14495-1 C.2.2 (JPEG-LS), 15444-1 A.5.1 (JPEG-2000).
    """
    try:
        if code.startswith(JPEG_START):
            return _jpeg_size(code)
        start = code.find(JPEG2000_START)  # some files have the boxes of JP2 before the stream
        return None if start < 0 else _jpeg2000_size(code[start + 4 :])
    except struct.error:
        return None


def _jpeg_size(code: bytes) -> tuple[int, int, int] | None:
    place = 2
    while place < len(code):
        fill, marker, length = struct.unpack_from(">BBH", code, place)
        if fill != 0xFF or length < 2:
            return None
        if marker == 0xFF:  # any number of these may stand before a marker
            place += 1
        elif marker in FRAME_MARKERS:
            rows, columns, samples = struct.unpack_from(">HHB", code, place + 5)
            return rows, columns, samples
        else:
            place += 2 + length
    return None


def _jpeg2000_size(segment: bytes) -> tuple[int, int, int]:
    right, bottom, left, top = struct.unpack_from(">4I", segment, 4)
    (samples,) = struct.unpack_from(">H", segment, 36)
    return bottom - top, right - left, samples
