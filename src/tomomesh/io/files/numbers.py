"""FileNumbers that stand one behind the other in files, packed or not, read part by part."""

from __future__ import annotations

import io
import math
import os
import shutil
import tempfile
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ...errors import NO_ROOM, ResourceError
from .unpack import copy, pass_over, unpacked

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from .parts import Seen

MAPPED_BYTES = 2**26
"""Bytes of a file that are mapped together: all of them that are touched count as memory. Half or twice of it takes as
long."""

COPIES = 2
"""Unpacked copies that a process keeps of files that another one opened: a study, and the labels beside it."""


class Copy(io.FileIO):
    """A file without a name, gone as soon as nobody has it."""

    def __del__(self) -> None:
        self.close()


class Part(Protocol):
    """Where numbers stand."""

    def opened(self) -> tuple[Path | Copy, int]:
        """Return the file that holds them, and the bytes before them."""


@dataclass(frozen=True)
class Plain:
    """A file that holds numbers as they are, behind byte `start`."""

    file: Seen
    start: int

    def opened(self) -> tuple[Path, int]:
        """Return the path; the file must be the same as before."""
        return self.file.unchanged(), self.start


@dataclass(frozen=True)
class Unpacked:
    """Packed files, unpacked one behind the other into a file without a name that goes with this object.

    Another process that gets it unpacks them again, once.

    Attributes
    ----------
    files : tuple of Seen
    starts : tuple of int
        Bytes before the packed stream of each.
    packing : str
        As `unpacked` takes it.
    skip, length : int
        Of what a stream holds, the bytes before those that are wanted, and their number.
    name : str
        The path as the user typed it.
    """

    files: tuple[Seen, ...]
    starts: tuple[int, ...]
    packing: str
    skip: int
    length: int
    name: str
    _copies: list[Copy] = field(default_factory=list, compare=False, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_copies": []}

    def now(self) -> Unpacked:
        """Unpack now, so that what is damaged is told now.

        Raises
        ------
        FormatError, UnreadableError, ResourceError
            As `unpacked` and `copy`, and where the disk has no room.
        """
        self._copies[:] = [_unpacked(self)]
        return self

    def opened(self) -> tuple[Copy, int]:
        """Return what is unpacked."""
        return (self._copies[0] if self._copies else _unpacked_again(self)), 0


def _unpacked(packed: Unpacked) -> Copy:
    """Unpack files one behind the other into one that has no name, and is gone with its handle, however that ends."""
    promised = len(packed.files) * packed.length
    if promised > (free := shutil.disk_usage(tempfile.gettempdir()).free):
        raise _no_room(packed, f"at most {free} bytes")
    with tempfile.TemporaryFile(prefix="tomomesh-", buffering=0) as copied:

        def write(data: memoryview) -> None:
            try:
                while data:
                    data = data[copied.write(data) :]
            except OSError as fault:
                raise _no_room(packed) if fault.errno in NO_ROOM else fault from None

        for seen, start in zip(packed.files, packed.starts, strict=True):
            with unpacked(seen.unchanged(), packed.packing, file=packed.name, start=start) as stream:
                pass_over(stream, packed.skip)
                copy(packed.length, stream, write, file=packed.name)
        return Copy(os.dup(copied.fileno()), "rb")


def _no_room(packed: Unpacked, expected: str = "") -> ResourceError:
    return ResourceError(
        "the disk has no room for the unpacked voxels",
        file=packed.name,
        found=f"size = {len(packed.files) * packed.length} bytes",
        expected=expected,
        hint="TMPDIR=FOLDER, one with room, or the file unpacked beforehand",
    )


_unpacked_again = lru_cache(COPIES)(_unpacked)


@dataclass(frozen=True)
class FileNumbers:
    """An array of numbers in files.

    Attributes
    ----------
    shape : tuple of int
        Sizes of all axes, slowest first.
    kind : data type
        In the byte order of the files.
    parts : tuple of Part
        Those that hold it, as many along the first axis each.
    """

    shape: tuple[int, ...]
    kind: np.dtype[Any]
    parts: tuple[Part, ...]

    @property
    def dtype(self) -> np.dtype[Any]:
        """In the machine's byte order."""
        return self.kind.newbyteorder("=")

    @property
    def chunks(self) -> tuple[int, ...]:
        """Sizes of what is read together: each number may be read alone."""
        return (1,) * len(self.shape)

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Return a part.

        Raises
        ------
        UnreadableError, FormatError
            Where a file is gone, or was written since it was opened.
        """
        found = np.empty([len(range(side.start, side.stop, side.step)) for side in box], self.dtype)
        rows, each = np.arange(self.shape[0])[box[0]], self.shape[0] // len(self.parts)
        for number in np.unique(rows // each):
            file, start = self.parts[number].opened()
            own = np.flatnonzero(rows // each == number)
            side = slice(rows[own[0]] - number * each, rows[own[-1]] - number * each + 1, box[0].step)
            target = found[own[0] : own[-1] + 1]
            _copy(target, file, self.kind, start, (each, *self.shape[1:]), (side, *box[1:]))
        return found


def _copy(
    target: NDArray[Any], file: Path | Copy, kind: np.dtype[Any], start: int, shape: tuple[int, ...],
    box: tuple[slice, ...],
) -> None:  # fmt: skip
    """Copy a part of the array that begins at byte `start` of a file; never much of the file is mapped at once."""
    rows, row_bytes = range(shape[0])[box[0]], math.prod(shape[1:]) * kind.itemsize
    if row_bytes > MAPPED_BYTES and len(shape) > 1:
        for part, row in zip(target, rows, strict=True):
            _copy(part, file, kind, start + row * row_bytes, shape[1:], box[1:])
        return
    together = max(MAPPED_BYTES // (row_bytes * rows.step), 1)
    for n in range(0, len(rows), together):
        some = rows[n : n + together]
        mapped = np.memmap(file, kind, "r", start + some[0] * row_bytes, (some[-1] - some[0] + 1, *shape[1:]))
        target[n : n + together] = mapped[(slice(None, None, rows.step), *box[1:])]
