"""Compressed frames, cut out of their file whole."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, BinaryIO

from ....errors import FormatError, ResourceError
from ...files.limits import require_bytes
from .codestream import check_stream
from .rle import RLE

if TYPE_CHECKING:
    from ..headers.element import PixelElement
    from .layout import PixelLayout

ITEM, DELIMITER = 0xFFFEE000, 0xFFFEE0DD
"""Tags before each item and behind the last (PS3.5, A.4)."""

LARGEST_FRAME_BYTES = 2**30
"""No slice of a study is larger, 32,768 squared bytes; what promises more in few compressed bytes is a bomb."""

SYNTAXES = {
    RLE,
    *(f"1.2.840.10008.1.2.4.{last}" for last in (50, 51, 57, 70, 80, 81, 90, 91, 201, 202, 203)),
}
"""Compressions that are decoded: RLE, JPEG, JPEG-LS, JPEG-2000 and HTJ2K."""


def read_encapsulated(file: BinaryIO, element: PixelElement, layout: PixelLayout) -> list[bytes]:
    """Return the compressed frames of a file.

    Raises
    ------
    FormatError
        For another compression, and for frames that are cut off, missing or of another size than the header's.
    ResourceError
        For frames that promise more than any slice holds.
    """
    from pydicom.encaps import generate_frames

    _check_syntax(element, layout)
    if layout.frame_bytes > LARGEST_FRAME_BYTES:
        raise ResourceError(
            "the compressed pixels promise more than a slice holds",
            file=layout.name,
            found=f"Rows, Columns = {layout.rows}, {layout.columns}",
            expected=f"at most {LARGEST_FRAME_BYTES} bytes a frame",
        )
    _check_whole(file, element, layout.name)
    file.seek(element.start)
    frames = list(generate_frames(file, number_of_frames=layout.frames))
    if len(frames) != layout.frames:
        raise FormatError(
            "the file holds another number of frames than its header promises",
            file=layout.name,
            found=f"frames = {len(frames)}",
            expected=f"NumberOfFrames = {layout.frames}",
        )
    for code in frames if layout.syntax != RLE else ():  # RLE has no sizes of its own
        check_stream(code, layout)
    return frames


def _check_syntax(element: PixelElement, layout: PixelLayout) -> None:
    if layout.syntax not in SYNTAXES or not element.encapsulated or element.keyword != "PixelData":
        raise FormatError(
            "the compression of the pixels cannot be decoded",
            file=layout.name,
            found=f"TransferSyntaxUID = {layout.syntax.name}",
            expected="RLE, JPEG, JPEG-LS, JPEG-2000 or HTJ2K",
            hint="a copy without compression",
        )


def _check_whole(file: BinaryIO, element: PixelElement, name: str) -> None:
    """Walk over the fragments: pydicom takes those that are there, decoders fill in what is missing.

    Raises
    ------
    FormatError
        Where one is cut off, or the last is not followed by the end.
    """
    place, end = element.start, element.start + element.available
    while place + 8 <= end:
        file.seek(place)
        group, number, length = struct.unpack("<HHI", file.read(8))
        place += 8
        if group << 16 | number == DELIMITER:
            return
        if group << 16 | number != ITEM:
            raise FormatError("the compressed pixels are no sequence of fragments", file=name)
        place += length
    require_bytes(place + 8 - element.start, element.available, file=name)
