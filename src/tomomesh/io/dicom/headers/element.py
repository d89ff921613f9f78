"""Where in its file the pixels of a DICOM image stand."""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ....errors import FormatError

if TYPE_CHECKING:
    from typing import BinaryIO

ELEMENTS = {0x7FE00010: "PixelData", 0x7FE00008: "FloatPixelData", 0x7FE00009: "DoubleFloatPixelData"}
"""Tags of the elements that hold pixels."""

UNDEFINED = 0xFFFFFFFF
"""The length of an element that goes on until its delimiter: that of compressed pixels."""

WIDE = (b"OB", b"OD", b"OF", b"OL", b"OV", b"OW", b"SQ", b"SV", b"UC", b"UN", b"UR", b"UT", b"UV")
"""Kinds of values whose length has four bytes (PS3.5, 7.1.2)."""


@dataclass(frozen=True)
class PixelElement:
    """The element that holds the pixels: its keyword, kind, first byte in the file, and the bytes that are there."""

    keyword: str
    kind: str
    start: int
    available: int
    encapsulated: bool


def pixel_element(file: BinaryIO, header: Any, *, name: str) -> PixelElement:
    """Return the element that begins where a file is positioned.

    Parameters
    ----------
    file : binary file
        At the tag of the pixels.
    header : pydicom Dataset
        What stands before.
    name : str
        The bare name of the file.

    Raises
    ------
    FormatError
        Where no pixels begin there.
    """
    implicit, little = header.original_encoding
    order, start = "<" if little else ">", file.tell()
    head = file.read(12).ljust(12, b"\0")
    group, number = struct.unpack(f"{order}HH", head[:4])
    keyword = ELEMENTS.get(group << 16 | number)
    if keyword is None:
        raise FormatError("the file holds no pixels", file=name, found="PixelData = missing", hint="a fresh copy")
    wide = not implicit and head[4:6] in WIDE
    (length,) = struct.unpack(f"{order}I", head[8:] if wide else head[4:8])
    start += 12 if wide else 8
    remaining = max(file.seek(0, os.SEEK_END) - start, 0)
    kind = "OW" if implicit or head[4:6] == b"OW" else "OB"
    available = remaining if length == UNDEFINED else min(length, remaining)
    return PixelElement(keyword, kind, start, available, length == UNDEFINED)
