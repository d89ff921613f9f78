"""Files that are packed as a whole (Deflated Explicit VR): pydicom unpacks them at once, whatever they hold."""

from __future__ import annotations

import io
import struct
import zlib
from typing import BinaryIO

from ....errors import ResourceError
from .element import WIDE

DEFLATED = "1.2.840.10008.1.2.1.99"

LARGEST_UNPACKED = 2**30
"""A packed file that holds more is taken for a bomb: it is a stack of 2,000 slices of 512 squared voxels of 16 bits."""

BYTES_AT_ONCE = 2**20
"""Bytes that are unpacked together."""


def check_deflated(file: BinaryIO, *, name: str) -> None:
    """Refuse a packed file that holds too much; leave any file at its start.

    Raises
    ------
    ResourceError
        Where it holds more than `LARGEST_UNPACKED`.
    """
    if _is_deflated(file):
        unpacker, total = zlib.decompressobj(-zlib.MAX_WBITS), 0
        while packed := unpacker.unconsumed_tail or file.read(BYTES_AT_ONCE):
            total += len(unpacker.decompress(packed, BYTES_AT_ONCE))
            if total > LARGEST_UNPACKED:
                raise ResourceError(
                    "the packed file holds too much", file=name, expected=f"at most {LARGEST_UNPACKED} bytes"
                )
    file.seek(0)


def _is_deflated(file: BinaryIO) -> bool:
    """Look for the transfer syntax among the elements of group 2, as pydicom does, and stop behind them.

    Whether kinds are written down is told by the first element, for all.
    """
    found, explicit = False, None
    file.seek(132 if file.read(132)[128:] == b"DICM" else 0)
    while len(head := file.read(8)) == 8:
        group, number, kind, length = struct.unpack("<HH2sH", head)
        if group != 2:
            file.seek(-8, io.SEEK_CUR)
            break
        explicit = kind.isupper() if explicit is None else explicit
        if not explicit:
            (length,) = struct.unpack("<I", head[4:])
        elif kind in WIDE:
            (length,) = struct.unpack("<I", file.read(4).ljust(4, b"\0"))
        end = file.tell() + length
        found |= number == 0x10 and file.read(min(length, 64)).rstrip(b"\0 ") == DEFLATED.encode()
        file.seek(end)
    return found
