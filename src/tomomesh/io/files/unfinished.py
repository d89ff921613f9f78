"""Files that are not whole yet: without a name where the system can, and swept away where one was left."""

from __future__ import annotations

import os
import secrets
import shutil
import sys
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

HIDDEN_NAMES = ".tomomesh-*.tmp"
"""What an unfinished file is called for as long as it needs a name of its own."""

OPEN_FILES = Path("/proc/self/fd")
"""Where Linux shows a process its open files, those without a name too."""


@contextmanager
def unfinished(target: Path) -> Iterator[IO[bytes]]:
    """Open a new file that takes the place of `target` when the block ends well, and is gone when it does not.

    Linux keeps it without a name until it is whole, so that even ``kill -9`` leaves nothing; only between the
    two steps that then put it in its place has it a hidden name. Elsewhere it has that name from the start.
    What a kill leaves under such a name the next `sweep` removes: the writer's lock tells the living from the
    dead, on network folders too.

    Raises
    ------
    OSError
        Where the file cannot be written.
    """
    hidden = target.with_name(HIDDEN_NAMES.replace("*", secrets.token_hex(8)))
    nameless = _nameless(target.parent)
    try:
        with nameless or _named(hidden) as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
            if nameless:
                _name(file, hidden)
            if sys.platform == "win32":
                file.close()  # no open file can be renamed there
            hidden.replace(target)
    finally:
        with suppress(OSError):
            hidden.unlink(missing_ok=True)


def _nameless(folder: Path) -> IO[bytes] | None:
    """Open a file without a name, which its system forgets with its last user; None where there is no such thing."""
    flag = getattr(os, "O_TMPFILE", 0)
    if not flag or not OPEN_FILES.is_dir():
        return None
    try:
        file = os.fdopen(os.open(folder, flag | os.O_RDWR, 0o666), "w+b")
    except OSError:
        return None  # network folders, and all that a named file will tell of too
    _lock(file)
    return file


def _named(hidden: Path) -> IO[bytes]:
    """Open a file under its hidden name, and again where a sweep took it before it was locked."""
    while True:
        file = hidden.open("x+b")
        _lock(file)
        if os.fstat(file.fileno()).st_nlink:
            return file
        file.close()


def _name(file: IO[bytes], hidden: Path) -> None:
    """Give a nameless file its hidden name, or its bytes to one that has it."""
    try:
        # a directory's handle is of no use to an absolute path, but makes Python follow the link
        os.link(OPEN_FILES / str(file.fileno()), hidden, src_dir_fd=file.fileno())
    except OSError:
        with _named(hidden) as copy:
            file.seek(0)
            shutil.copyfileobj(file, copy)
            copy.flush()
            os.fsync(copy.fileno())


def sweep(folder: Path) -> None:
    """Remove the unfinished files of dead writers from a folder."""
    if sys.platform == "win32":
        return
    with suppress(OSError):
        for path in folder.glob(HIDDEN_NAMES):
            _remove_if_dead(path)


def _remove_if_dead(path: Path) -> None:
    with suppress(OSError), os.fdopen(os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK), "r+b") as file:
        if _lock(file, wait=False):
            path.unlink()


def _lock(file: IO[bytes], *, wait: bool = True) -> bool:
    """Lock a file for as long as it is open; False where another has it, or there are no locks."""
    if sys.platform == "win32":
        return False
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
