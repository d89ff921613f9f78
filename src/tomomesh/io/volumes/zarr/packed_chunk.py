"""How many bytes a packed chunk unpacks to, as far as that can be told at little cost."""

from __future__ import annotations

import bz2
import lzma
import struct
import zlib
from typing import TYPE_CHECKING, Any

from ...files.limits import require_bytes
from ...files.source import first_bytes

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

UNPACKERS: dict[str, Callable[[], Any]] = {
    "gzip": lambda: zlib.decompressobj(zlib.MAX_WBITS | 16),
    "zlib": zlib.decompressobj,
    "bz2": bz2.BZ2Decompressor,
    "lzma": lzma.LZMADecompressor,
}
"""Packings that do not say what they hold: that is counted."""

UNCOUNTED_BYTES = {"gzip": 2**18, "zlib": 2**18}
"""Packed bytes that are not counted: deflate makes 270 MB of them at most (1,032 to one). bz2, which would make 340 GB
(1.3 million to one), and lzma are always counted."""

BYTES_AT_ONCE = 2**20
"""Packed bytes that are looked at together."""


def promised_bytes(chunk: Path, packing: str, enough: int, *, file: str) -> int:
    """Return how many bytes a chunk holds; 0 where that is not known, and no more than it takes to pass `enough`.

    Raises
    ------
    FormatError
        Where a blosc chunk is cut off.
    """
    start, size = first_bytes(chunk, 18), chunk.stat().st_size
    if packing == "blosc" and len(start) >= 16:
        promised, packed = struct.unpack("<4xI4xI", start[:16])
        require_bytes(packed, size, file=file)
        return int(promised)
    if packing == "zstd":
        return _zstd_bytes(start)
    if packing == "lz4" and len(start) >= 4:
        return int.from_bytes(start[:4], "little")
    counted = packing in UNPACKERS and size > UNCOUNTED_BYTES.get(packing, 0)
    return _counted(chunk, UNPACKERS[packing](), enough) if counted else 0


def _zstd_bytes(start: bytes) -> int:
    """Return the length of what a zstd frame holds, 0 where it does not say (RFC 8878, 3.1.1.1)."""
    if len(start) < 18:
        return 0
    flag, single = start[4] >> 6, start[4] >> 5 & 1
    size = (single, 2, 4, 8)[flag]
    begin = 5 + (1 - single) + (0, 1, 2, 4)[start[4] & 3]
    return int.from_bytes(start[begin : begin + size], "little") + (256 if flag == 1 else 0)


def _counted(chunk: Path, unpacker: Any, enough: int) -> int:
    """Unpack step by step, and stop when it is enough or broken: what is broken, zarr tells."""
    total = 0
    with chunk.open("rb") as packed:
        while total <= enough and not unpacker.eof:
            rest = getattr(unpacker, "unconsumed_tail", b"")
            hungry = getattr(unpacker, "needs_input", not rest)
            given = packed.read(BYTES_AT_ONCE) if hungry else rest
            if hungry and not given:
                break
            try:
                total += len(unpacker.decompress(given, BYTES_AT_ONCE))
            except (OSError, EOFError, zlib.error, lzma.LZMAError):
                break
        goes_on = unpacker.eof and (unpacker.unused_data or packed.read(1))
    return enough + 1 if goes_on else total  # another stream behind the first may hold anything
