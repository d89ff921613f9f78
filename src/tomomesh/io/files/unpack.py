"""Bytes of voxels, packed or not: never more than a header promised, and nothing for what a file cannot hold."""

from __future__ import annotations

import bz2
import io
import zlib
from contextlib import contextmanager
from importlib import import_module
from typing import TYPE_CHECKING, Any

from ...errors import FormatError, ResourceError, UnreadableError
from .limits import require_bytes
from .source import first_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

PLAIN, GZIP, ZLIB, BZIP2 = "raw", "gzip", "zlib", "bzip2"

GZIP_MARK = b"\x1f\x8b"
"""First bytes of a gzip stream (RFC 1952)."""

RATIOS = {PLAIN: 1, GZIP: 1032, ZLIB: 1032, BZIP2: 2**21}
"""No stream of a packing holds more than this many times its own bytes: zlib's own limit (its technical details), and
the power of two above what bzip2 makes of zeros, 1.3 million to one (measured)."""

SURPLUS_BYTES = 2**26
"""A packed stream that goes on for longer after its voxels is a bomb: these are a slice of 8,192 squared bytes."""

BYTES_AT_ONCE = 2**24
"""Bytes that are asked for together."""


CHUNK_BYTES = 2**17
"""Packed bytes taken, and bytes unpacked, at once: they stay in the processor's cache. Half or twice of it takes as
long."""

WINDOW_BITS = {GZIP: 31, ZLIB: 15}
"""How zlib is told what wraps a stream."""


class _Inflated(io.RawIOBase):
    """A zlib stream, or gzip streams one behind the other, as a file.

    The standard library has none for zlib, and one for gzip that takes 8 KiB at once.
    """

    def __init__(self, file: Any, packing: str) -> None:
        self._file, self._packing = file, packing
        self._begin(b"")

    def _begin(self, packed: bytes) -> None:
        self._unpacker, self._packed = inflater().decompressobj(WINDOW_BITS[self._packing]), packed

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer; return fewer bytes than it has at the end alone."""
        done = 0
        while done < len(buffer) and (data := self._some(min(len(buffer) - done, CHUNK_BYTES))):
            buffer[done : done + len(data)] = data
            done += len(data)
        return done

    def _some(self, most: int) -> bytes:
        while not self._unpacker.eof or self._goes_on():
            packed = self._packed or self._file.read(CHUNK_BYTES)
            data: bytes = self._unpacker.decompress(packed, most)
            self._packed = self._unpacker.unconsumed_tail
            if data:
                return data
            if not packed:
                raise EOFError
        return b""

    def _goes_on(self) -> bool:
        """Begin with the gzip stream that follows; zeros between streams are padding (as the standard library says)."""
        packed = self._unpacker.unused_data.lstrip(b"\0")
        while self._packing == GZIP and not packed and (more := self._file.read(CHUNK_BYTES)):
            packed = more.lstrip(b"\0")
        if self._packing == GZIP and packed:
            self._begin(packed)
            return True
        return False


def inflater() -> Any:
    """Return zlib-ng, which ITK unpacks with too, where it is installed, else zlib; their names are the same."""
    try:
        return import_module("zlib_ng.zlib_ng")
    except ImportError:
        return zlib


def packing_of(path: Path) -> str:
    """Return ``GZIP`` or ``PLAIN``, by a file's first bytes: browsers unpack, and leave the name as it was.

    Raises
    ------
    UnreadableError
        Where the file may not be read.
    """
    return GZIP if first_bytes(path, len(GZIP_MARK)) == GZIP_MARK else PLAIN


@contextmanager
def unpacked(path: Path, packing: str, *, file: str, start: int = 0) -> Iterator[Any]:
    """Open what stands in a file from byte `start` on, as a binary stream.

    Parameters
    ----------
    path : Path
        The file.
    packing : str
        ``PLAIN``, ``GZIP``, ``ZLIB`` or ``BZIP2``.
    file : str
        Its name for errors.
    start : int
        Bytes before.

    Raises
    ------
    FormatError
        For a damaged stream.
    UnreadableError
        Where the file cannot be read.
    """
    try:
        with path.open("rb") as plain:
            plain.seek(start)
            with _opened(plain, packing) as stream:
                yield stream
    except (EOFError, inflater().error, OSError) as fault:
        # what unpacks raises an OSError without a number for bad data
        if isinstance(fault, OSError) and fault.errno is not None:
            raise UnreadableError("the file cannot be read", file=file, found=fault.strerror or "") from None
        raise FormatError(
            "the compressed file is damaged",
            file=file,
            found=f"{packing} = {type(fault).__name__}",
            expected=f"a whole {packing} stream with the right check sum",
            hint="a fresh copy of the file",
        ) from None


def _opened(plain: Any, packing: str) -> Any:
    if packing == BZIP2:
        return bz2.BZ2File(plain)
    return _Inflated(plain, packing) if packing in WINDOW_BITS else plain


def check_promise(promised: int, packed: int, packing: str, *, file: str) -> None:
    """Compare the bytes that a header promises with what so many packed bytes can hold.

    Raises
    ------
    FormatError
        Where the file cannot hold them.
    """
    require_bytes(promised, max(packed, 0) * RATIOS[packing], file=file)


def pass_over(stream: Any, count: int) -> None:
    """Read bytes that are not wanted, or all that there are where they are fewer."""
    while count > 0 and (chunk := stream.read(min(count, 2**20))):
        count -= len(chunk)


def fill(data: NDArray[Any], stream: Any, *, file: str) -> None:
    """Read as many bytes as an array of bytes (n,) has, and the rest of a packed stream for its check sum.

    Raises
    ------
    FormatError
        Where the stream holds fewer.
    ResourceError
        Where a packed stream goes on far beyond them.
    """
    done = 0
    while done < len(data) and (count := stream.readinto(data.data[done : done + BYTES_AT_ONCE])):
        done += count
    _end(len(data), done, stream, file)


def copy(promised: int, stream: Any, write: Callable[[memoryview], object], *, file: str) -> None:
    """Hand so many bytes of a stream on, some at once, and read the rest of a packed stream for its check sum.

    Raises
    ------
    FormatError, ResourceError
        As `fill`.
    """
    buffer, done = memoryview(bytearray(min(promised, BYTES_AT_ONCE))), 0
    while done < promised and (count := stream.readinto(buffer[: promised - done])):
        write(buffer[:count])
        done += count
    _end(promised, done, stream, file)


def _end(promised: int, done: int, stream: Any, file: str) -> None:
    require_bytes(promised, done, file=file)
    if isinstance(stream, (bz2.BZ2File, _Inflated)):
        _drain(stream, file)


def _drain(stream: Any, file: str) -> None:
    surplus = 0
    while chunk := stream.read(2**20):
        surplus += len(chunk)
        if surplus > SURPLUS_BYTES:
            raise ResourceError(
                "the compressed file goes on far beyond its voxels",
                file=file,
                found=f"surplus = {surplus} bytes and more",
                expected=f"at most {SURPLUS_BYTES} bytes",
            )
