"""How much a file may promise."""

from __future__ import annotations

import os
from contextvars import ContextVar
from typing import TYPE_CHECKING

from ...errors import FormatError, ResourceError, TomomeshError
from ...memory.limit import free_disk

if TYPE_CHECKING:
    from collections.abc import Callable

FALLBACK_BYTES = 16 * 2**30
"""The limit where the machine does not say how much memory it has, as Windows does not: that of a usual workstation."""

_asked = ContextVar("_asked", default=False)


class _Promise(BaseException):
    """Ends the reading of what was only to tell its size; no reader takes it for a fault of the file."""

    def __init__(self, size: int) -> None:
        self.size = size


def promised_by(read: Callable[[], object]) -> int:
    """Return how many bytes the data take that are read, as their header promises: none of them is read.

    0 where nothing is promised, or the header is at fault, which is told when they are read.
    """
    asked = _asked.set(True)
    try:
        read()
    except _Promise as promise:
        return promise.size
    except TomomeshError:
        return 0
    finally:
        _asked.reset(asked)
    return 0


def require_memory(promised: int, *, file: str) -> None:
    """Refuse data that cannot fit into the machine's memory, before any of them is allocated.

    Raises
    ------
    ResourceError
        Where `promised` bytes are more than the physical memory; where memory is limited, than the disk has room for.
    """
    if _asked.get():
        raise _Promise(promised)
    disk = free_disk()
    room = physical_memory() if disk is None else int(disk)
    if promised > room:
        raise ResourceError(
            "the data do not fit into the memory" if disk is None else "the data do not fit onto the disk",
            file=file,
            found=f"size = {promised} bytes",
            expected=f"at most {room} bytes",
            hint="a part of it, or a machine with more memory",
        )


def require_bytes(promised: int, found: int, *, file: str) -> None:
    """Refuse a file that holds fewer bytes than its header promises.

    Raises
    ------
    FormatError
        Where `found` is below `promised`.
    """
    if found < promised:
        raise _cut_off(f"data = {found} bytes", f"{promised} bytes", file)


def _cut_off(found: str, promised: str, file: str) -> FormatError:
    hint = "a fresh copy of the file"
    return FormatError(
        "the file is cut off", file=file, found=found, expected=f"{promised}, as its header promises", hint=hint
    )


def require_rows(promised: int, found: int, what: str, *, file: str) -> None:
    """Refuse a file that holds fewer points, or whatever `what` names, than its header promises.

    Raises
    ------
    FormatError
        Where `found` is below `promised`.
    """
    if found < promised:
        raise _cut_off(f"{what} = {found}", f"{promised}", file)


def physical_memory() -> int:
    """Return the machine's memory in bytes."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return FALLBACK_BYTES
