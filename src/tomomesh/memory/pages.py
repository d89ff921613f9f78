"""Memory in files without a name: what is looked at is in the memory, until it is let go."""

from __future__ import annotations

import ctypes
import os
import tempfile
import threading
from collections import deque
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

PROTECTION, SHARED, FAILED = 3, 1, ctypes.c_void_p(-1).value
"""Of mmap: to read and to write; what is written goes to the file; what it returns where there is none."""
DONTNEED = 4
"""Of madvise: the pages of a shared map are let go of, and read again from the file, or the cache of its pages."""


class Pages:
    """Ranges of memory, each a file's.

    No file has a name, and none is open: it is gone with its range, however the process ends. Its room on the disk is
    taken at once, so that nothing written later finds the disk full, which would end the process.

    Parameters
    ----------
    folder : path
        Where the files are, on a disk; nobody else may read them.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.fault: OSError | None = None
        """Why there was no room."""
        self._sizes: dict[int, int] = {}
        self._gone = deque[tuple[int, int]]()
        self._busy = threading.Lock()

    def take(self, size: int) -> int | None:
        """Return the address of so many bytes, all 0; None where there is no room."""
        try:
            with tempfile.TemporaryFile(dir=self.folder, buffering=0) as file:
                os.posix_fallocate(file.fileno(), 0, size)
                place = system().mmap(None, size, PROTECTION, SHARED, file.fileno(), 0)
        except OSError as fault:
            self.fault = fault
            return None
        if place == FAILED:
            return None
        self._sizes[place] = size
        return int(place)

    def size(self, place: int) -> int | None:
        """Return how many bytes begin at an address; None where no range does."""
        return self._sizes.get(place)

    def give_back(self, place: int) -> None:
        """Let go of a range and of its file."""
        self._gone.append((place, self._sizes.pop(place)))
        self._unmap()

    def leave(self) -> None:
        """Let the pages of all ranges go, which others may be at work on: they are read again where they are needed."""
        with self._busy:  # nothing is unmapped meanwhile: its addresses may be another's then
            for place, size in [*self._sizes.items()]:
                system().madvise(place, size, DONTNEED)
        self._unmap()

    def _unmap(self) -> None:
        """Unmap what was given back, unless that is being done, or may not be now: then it is done later."""
        while self._gone and self._busy.acquire(blocking=False):
            try:
                system().munmap(*self._gone.popleft())
            except IndexError:  # another thread has
                pass
            finally:
                self._busy.release()


@cache
def system() -> Any:
    """Return the C library of a system that has one such for all of a process, its functions typed."""
    library = ctypes.CDLL(None, use_errno=True)
    address, size, number = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
    for name, result, *arguments in (
        ("malloc", address, size),
        ("calloc", address, size, size),
        ("realloc", address, address, size),
        ("free", None, address),
        ("mmap", address, address, size, number, number, number, ctypes.c_long),
        ("munmap", number, address, size),
        ("madvise", number, address, size, number),
    ):
        function = getattr(library, str(name))
        function.restype, function.argtypes = result, arguments
    return library
