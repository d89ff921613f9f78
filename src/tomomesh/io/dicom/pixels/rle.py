"""Frames of gray levels that are packed by RLE (PS3.5, annex G).

They are unpacked here and not in the child process, whose start takes longer than a series of them: a kernel that looks
before each byte whether there is room for it needs no guard.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .layout import PixelLayout

RLE = "1.2.840.10008.1.2.5"

HEADER_BYTES = 64
"""A count, and where each segment begins."""

MOST_OF_ONE = 64
"""Bytes that one packed byte holds at most: two of them are 128."""


def is_gray_rle(layout: PixelLayout) -> bool:
    """Tell whether frames are read by `read_rle`; what colors are converted from, the child's library knows."""
    return bool(layout.syntax == RLE and layout.samples == 1 and layout.allocated >= 8)


def read_rle(code: bytes, layout: PixelLayout) -> NDArray[Any]:
    """Return the stored numbers (J, I) of a frame: a segment for each of their bytes, the highest first.

    Raises
    ------
    FormatError
        For another count of segments, and for one that is too short.
    """
    from ....kernels.files.packbits import unpack_bits

    size, packed = layout.allocated // 8, np.frombuffer(bytearray(code), np.uint8)
    starts = np.frombuffer(code, "<u4", len(code[:HEADER_BYTES]) // 4).astype(np.int64)
    count = int(starts[0]) if len(starts) == HEADER_BYTES // 4 else 0
    if count != size:
        raise _refused(layout, f"segments = {count}", f"{size} segments")
    if layout.frame_bytes > MOST_OF_ONE * len(code):
        raise _refused(layout, f"data = {len(code)} bytes", f"{layout.frame_bytes} bytes")
    pixels = np.empty(layout.shape, f"<{'i' if layout.signed else 'u'}{size}")
    stops = [*starts[2 : size + 1], len(code)]
    for n, (start, stop) in enumerate(zip(starts[1 : size + 1], stops, strict=True)):
        filled = unpack_bits(packed, start, stop, pixels.reshape(-1).view(np.uint8), size - 1 - n, size)
        if filled < pixels.size:
            raise _refused(layout, f"segment {n + 1} = {filled} bytes", f"{pixels.size} bytes")
    return pixels


def _refused(layout: PixelLayout, found: str, expected: str) -> FormatError:
    return FormatError(
        "the compressed pixels cannot be decoded",
        file=layout.name,
        found=f"TransferSyntaxUID = {layout.syntax.name}, {found}",
        expected=expected,
    )
