"""Work within a limit of memory."""

from __future__ import annotations

import os
import re
import shutil
import sys
import tempfile
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import NO_ROOM, OutputError, ResourceError, UsageError
from ..kernels.compile import COMPILED
from .arrays import Arrays, swapped

if TYPE_CHECKING:
    from collections.abc import Iterator

KEPT = 0.25
"""Share of the limit, over what is taken at first, for large arrays that stay in the memory. Chosen: at a million
points within 600 MiB half of it takes 5 % more time and 4 % less memory, twice 4 % less time and 20 % more memory."""
FULL = 0.8
"""Share of the limit from which pages are let go of. The rest is for what comes before that is seen, which is late
where all cores are busy: at ten million points within 1 GiB 260 MiB came once, and the peak was 1,102 MiB with .95,
beside eight other processes; with .75 it was 945 MiB beside fourteen, but a million within 500 MiB took a tenth more
time than with .8, which peaked at 1,442 MiB beside twenty to twenty-seven: there no share would do."""
LEAST = 400 << 20
"""Smallest limit: Python, NumPy, SciPy and Numba take half of it."""
UNITS = {"": 1, **{f"{k}{b}": (1024 if b else 1000) ** n for n, k in enumerate("KMGT", 1) for b in ("", "I")}}
"""Bytes by unit, in capitals."""
IN_MEMORY = ("tmpfs", "ramfs")
"""File systems that are no disks."""
_folder: ContextVar[Path | None] = ContextVar("_folder", default=None)


def bytes_of(size: str | float) -> int:
    """Return bytes, of a number or in words.

    Raises
    ------
    UsageError
        For what is no size, or too little for any run.

    Examples
    --------
    >>> bytes_of("4GB"), bytes_of("1.5 GiB"), bytes_of(2**30)
    (4000000000, 1610612736, 1073741824)
    """
    found = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*([KMGT]?I?)B?\s*", str(size).upper())
    number = float(found[1]) * UNITS.get(found[2], 0) if found else 0.0
    if not LEAST <= number < 1 << 62:
        raise UsageError("that is no limit of the memory", found=f"memory = {size}", expected="400MiB or more, as 4GB")
    return int(number)


@contextmanager
def memory_limit(limit: str | float | None) -> Iterator[None]:
    """Keep what is done in a block within a limit of memory, by leaving the data of large arrays on the disk.

    The disk, of `TMPDIR` or ``/var/tmp``, must have room for what the work would take of memory. What is made is the
    same as without a limit, and may be used after the block. Libraries that take memory by themselves are not held to
    it.

    Parameters
    ----------
    limit : str or number, optional
        Bytes, as ``"4GB"``; without one nothing changes.

    Raises
    ------
    UsageError
        For what is no limit, and on systems other than Linux.
    ResourceError
        Where there is no disk.
    OutputError
        Where the disk is full.

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh import memory_limit
    >>> with memory_limit("1GB"):
    ...     squares = np.arange(10_000_000) ** 2
    >>> int(squares[-1])
    99999980000001
    """
    if limit is None:
        yield
        return
    most = bytes_of(limit)
    if not sys.platform.startswith("linux"):
        raise UsageError("the memory can be limited on Linux only", found=sys.platform)
    if not COMPILED:
        raise UsageError("the memory can be limited with compiled kernels only", found="NUMBA_DISABLE_JIT")
    folder = disk_folder()
    made = Arrays(folder, int(KEPT * max(most - _resident(), 0)))
    try:
        with _lying_in(made, most, folder):
            yield
    except MemoryError:
        if made.fault == 0:
            raise
        raise _full(folder, made.fault) from None


def free_disk() -> float | None:
    """Return how many bytes more may lie on the disk, where the memory is limited here; else None."""
    folder = _folder.get()
    return None if folder is None else float(shutil.disk_usage(folder).free)


@contextmanager
def _lying_in(made: Arrays, most: int, folder: Path) -> Iterator[None]:
    with ExitStack() as stack:
        stack.enter_context(made.watched(int(FULL * most)))
        stack.callback(_folder.reset, _folder.set(folder))
        stack.callback(swapped, swapped(made.capsule))
        yield


def disk_folder() -> Path:
    """Return the first of the folders for temporary files that is on a disk."""
    folders = [Path(tempfile.gettempdir()), Path("/var/tmp")]
    if not sys.platform.startswith("linux"):
        return folders[0]
    for folder in folders:
        if folder.is_dir() and os.access(folder, os.W_OK) and _kind(folder) not in IN_MEMORY:
            return folder
    raise ResourceError(
        "there is no disk for what is beyond the limit of the memory", found=str(folders[0]),
        hint="TMPDIR=FOLDER, one on a disk with room",
    )  # fmt: skip


def _kind(folder: Path) -> str:
    """Return the kind of file system that a folder is on, as Linux calls it."""
    device = folder.stat().st_dev
    number = f"{os.major(device)}:{os.minor(device)}"
    for line in Path("/proc/self/mountinfo").read_text(encoding="utf-8", errors="replace").splitlines():
        of_mount, _, of_system = line.partition(" - ")
        if of_mount.split()[2] == number:
            return of_system.split()[0]
    return ""


def _resident() -> int:
    """Return the bytes of this process that are in the memory."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")


def _full(folder: Path, fault: int) -> OutputError:
    told = "no file can be made" if fault < 0 else os.strerror(fault).lower()
    return OutputError(
        "what is beyond the limit of the memory cannot be kept", file=str(folder),
        found="the disk is full" if fault in NO_ROOM else told,
        hint="TMPDIR=FOLDER, one on a disk with more room, or a larger limit",
    )  # fmt: skip
