"""Who works on slabs, and where what they make stays until it is asked for again."""

from __future__ import annotations

import errno
import mmap
import os
import tempfile
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..errors import NO_ROOM, OutputError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

Kept = Any
"""What stands for a value that was made of a slab: handed in again, or fetched; nothing else is done with it."""
LARGE = 1 << 16
"""Bytes from which an array is kept in a file. Chosen: smaller ones are less than the pages that map them."""


class Slabs(Protocol):
    """Works on slabs, and keeps what it makes of them.

    Work is a function of a module, or a `functools.partial` of one, without effects: it changes none of its arguments.
    Values are frozen dataclasses, tuples and lists of arrays and of what else can be pickled.
    """

    def each(self, work: Callable[..., Any], *columns: Sequence[Any]) -> list[Kept]:
        """Call some work once a slab, with one entry of each column; what is kept is handed in as its value.

        Parameters
        ----------
        work : callable
        columns : sequences of one length
            Of values, of what `each` returned, and of tuples and lists of the latter.
        """

    def fetch(self, kept: Sequence[Kept]) -> list[Any]:
        """Bring values here: small ones, or one after another."""


class InMemory:
    """Works at once, and keeps values as they are."""

    def each(self, work: Callable[..., Any], *columns: Sequence[Any]) -> list[Kept]:
        """Call some work once a slab, see `Slabs`."""
        return [work(*entries) for entries in zip(*columns, strict=True)]

    def fetch(self, kept: Sequence[Kept]) -> list[Any]:
        """Return the values."""
        return list(kept)


@dataclass(frozen=True)
class OnDisk:
    """Works on one slab after another, and keeps large arrays in files without a name: no crash leaves any behind.

    A file holds what one call of `each` made, and is gone with the last value that is kept of it.

    Attributes
    ----------
    folder : path
        Where the files are; nobody else may read them.
    """

    folder: Path

    def each(self, work: Callable[..., Any], *columns: Sequence[Any]) -> list[Kept]:
        """Call some work once a slab, see `Slabs`.

        Raises
        ------
        OutputError
            Where the disk is full.
        """
        file = File(self.folder)
        return [put_away(work(*map(mapped, entries)), file) for entries in zip(*columns, strict=True)]

    def fetch(self, kept: Sequence[Kept]) -> list[Any]:
        """Return the values; what is large is read from its file where it is looked at."""
        return [mapped(value) for value in kept]


@dataclass(frozen=True)
class _Far:
    """An array in a file, from a byte on that a page begins with."""

    file: File
    offset: int
    dtype: np.dtype[Any]
    shape: tuple[int, ...]

    @property
    def nbytes(self) -> int:
        """Its size."""
        return self.dtype.itemsize * int(np.prod(self.shape))

    def __reduce__(self) -> tuple[Any, ...]:
        """Let other processes have the array itself, or its place in a file that is lent to them."""
        if self.file.lent:
            return _Far, (self.file, self.offset, self.dtype, self.shape)
        return _received, (self.mapped(),)

    def mapped(self) -> np.ndarray[Any, Any]:
        """Return it as memory that is its own: what is written there is never in the file."""
        pages = mmap.mmap(self.file.handle.fileno(), self.nbytes, access=mmap.ACCESS_COPY, offset=self.offset)
        return np.frombuffer(pages, self.dtype).reshape(self.shape)


class File:
    """A file without a name that arrays are put into one behind the other.

    Attributes
    ----------
    folder : path
        Where it is.
    lent : bool
        Whether it is pickled as what other processes of this user on this machine may open, while it is open here.
    """

    def __init__(self, folder: Path, *, lent: bool = False) -> None:
        self.folder = folder
        self.lent = lent
        self.end = 0
        self.handle: Any = None

    def __del__(self) -> None:
        """Close the file with the last value that is kept in it; maps of it stay."""
        if self.handle is not None:
            self.handle.close()

    def __reduce__(self) -> tuple[Any, ...]:
        """Let other processes open it: where its name would be there is nothing, so by the process that has it open."""
        handle = self.handle.fileno()
        return _borrowed, (self.folder, f"/proc/{os.getpid()}/fd/{handle}", os.fstat(handle)[1:3])

    def put(self, array: Any) -> Any:
        """Write an array; one that is small, and what is no array, stays as it is."""
        if not isinstance(array, np.ndarray) or array.nbytes < LARGE:
            return array.copy() if isinstance(array, np.ndarray) and array.base is not None else array
        try:
            return self._written(np.ascontiguousarray(array))
        except OSError as fault:
            told = "the disk is full" if fault.errno in NO_ROOM else str(fault.strerror).lower()
            raise OutputError(
                "what was made of a slab cannot be kept", file=str(self.folder), found=told,
                hint="TMPDIR on a disk with more room, or more memory and thicker slabs",
            ) from None  # fmt: skip

    def _written(self, array: np.ndarray[Any, Any]) -> _Far:
        if self.handle is None:
            self.handle = tempfile.TemporaryFile(dir=self.folder, buffering=0)  # noqa: SIM115 - closed with its last user
        self.handle.seek(self.end)
        left = array.reshape(-1).view(np.uint8)
        while len(left):
            left = left[self.handle.write(left) :]
        found = _Far(self, self.end, array.dtype, array.shape)
        self.end += -(-array.nbytes // mmap.ALLOCATIONGRANULARITY) * mmap.ALLOCATIONGRANULARITY
        return found


class _Unkept:
    """An array that another process has sent, and that could not be kept here: who looks at it is told.

    What is raised where it is received is seen by nobody: Dask would fetch it again and again.
    """

    def __init__(self, fault: OutputError) -> None:
        self.fault = fault


def _received(array: np.ndarray[Any, Any]) -> Any:
    """Keep an array that another process sends on the disk here too."""
    try:
        return File(Path(tempfile.gettempdir())).put(array)
    except OutputError as fault:
        return _Unkept(fault)


def _borrowed(folder: Path, place: str, identity: tuple[int, int]) -> File:
    """Open a file that another process has lent.

    Raises
    ------
    FileNotFoundError
        Where that has ended.
    """
    found = File(folder, lent=True)
    found.handle = Path(place).open("rb", buffering=0)  # noqa: SIM115 - closed with its last user
    if os.fstat(found.handle.fileno())[1:3] != identity:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), place)
    return found


def put_away(value: Any, file: File) -> Any:
    """Return a value whose large arrays are in a file."""
    return _changed(value, file.put)


def mapped(value: Any, *, own: bool = False) -> Any:
    """Return a value whose arrays can all be worked on, if asked for those too that another process has sent.

    Raises
    ------
    OutputError
        For one that it has sent and that could not be kept.
    """

    def looked_at(part: Any) -> Any:
        if isinstance(part, _Far):
            return part.mapped()
        if isinstance(part, _Unkept):
            raise part.fault
        return part.copy() if own and isinstance(part, np.ndarray) and not part.flags.behaved else part

    return _changed(value, looked_at)


def bytes_of(value: Any) -> int:
    """Return how many bytes the arrays of a value hold, wherever they are."""
    sizes = [0]
    _changed(value, lambda part: sizes.append(getattr(part, "nbytes", 0)))
    return sum(sizes)


def _changed(value: Any, change: Callable[[Any], Any]) -> Any:
    """Return a value with other parts: those of tuples, lists and dataclasses, however deep."""
    if isinstance(value, _Far) or (not isinstance(value, tuple | list) and not is_dataclass(value)):
        return change(value)
    if isinstance(value, tuple | list):
        parts = [_changed(part, change) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else type(value)(parts)
    made = object.__new__(type(value))  # as unpickling does: what is checked at the beginning was
    for field in fields(value):
        object.__setattr__(made, field.name, _changed(getattr(value, field.name), change))
    return made
