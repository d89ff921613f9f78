"""What stands behind a path, before anything is opened."""

from __future__ import annotations

import logging
import os
import warnings
from collections import Counter
from contextlib import contextmanager
from pathlib import Path, PureWindowsPath
from typing import TYPE_CHECKING, TypeVar

from ...errors import FormatError, ResourceError, TomomeshError, UnreadableError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

Reader = TypeVar("Reader")
Read = TypeVar("Read")


def suffix_of(path: str | Path) -> str:
    """Return a path's suffix in lower case; ``.gz`` keeps the suffix before it."""
    suffixes = [suffix.lower() for suffix in Path(path).suffixes[-2:]]
    return "".join(suffixes) if suffixes[-1:] == [".gz"] else "".join(suffixes[-1:])


def existing(path: str | Path) -> Path:
    """Return the path of a regular file or of a folder.

    Raises
    ------
    UnreadableError
        Where nothing is there, or it may not be read.
    FormatError
        For a device, a pipe, a socket or a loop of links; none of them is opened.
    """
    path = Path(path)
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError, PermissionError) as fault:
        raise UnreadableError("the path cannot be read", file=str(path), found=_reason(fault)) from None
    except (OSError, ValueError) as fault:
        raise FormatError("the path leads nowhere", file=str(path), found=_reason(fault)) from None
    if not (path.is_file() or path.is_dir()):
        raise FormatError("the path is no regular file", file=str(path), expected="a file or a folder")
    if not os.access(path, os.R_OK):
        raise UnreadableError("the path cannot be read", file=str(path), found="no permission")
    return path


def existing_file(path: str | Path) -> Path:
    """Return the path of a regular file that is not empty.

    Raises
    ------
    UnreadableError, FormatError
        As `existing`; a folder and a file without bytes are refused too.
    """
    path = existing(path)
    if path.is_dir():
        raise FormatError("the path is a folder", file=str(path), expected="a file")
    if path.stat().st_size == 0:
        raise FormatError("the file is empty", file=str(path), found="size = 0 bytes")
    return path


def reader_of(path: Path, readers: Mapping[str, Reader]) -> Reader:
    """Return what reads a file, by its suffix.

    Raises
    ------
    FormatError
        Where nothing does; it lists the suffixes.
    """
    if (suffix := suffix_of(path)) not in readers:
        raise FormatError(
            "the file is of an unknown kind",
            file=str(path),
            found=f"suffix = {suffix or 'none'}",
            expected=" | ".join(readers),
        )
    return readers[suffix]


def whole(path: str | Path) -> bytes:
    """Return a regular file's bytes.

    Raises
    ------
    UnreadableError, FormatError
        As `existing_file`.
    """
    return _read(path, Path.read_bytes)


def stored(path: str | Path) -> memoryview:
    """Return a regular file's bytes as those of an array, which lie where the memory's limit lets them (`memory`).

    Raises
    ------
    UnreadableError, FormatError
        As `existing_file`.
    """
    import numpy as np

    return _read(path, lambda path: np.fromfile(path, np.uint8).data)


def _read(path: str | Path, read: Callable[[Path], Read]) -> Read:
    path = existing_file(path)
    try:
        return read(path)
    except OSError as fault:
        raise UnreadableError("the file cannot be read", file=str(path), found=_reason(fault)) from None


def first_bytes(path: Path, count: int) -> bytes:
    """Return a file's first bytes, fewer where it has fewer.

    Raises
    ------
    UnreadableError
        Where the file may not be read.
    """
    try:
        with path.open("rb") as file:
            return file.read(count)
    except OSError as fault:
        raise UnreadableError("the file cannot be read", file=path.name, found=_reason(fault)) from None


def regular_files(folder: Path, *, deep: bool = False, hidden: bool = False) -> tuple[list[Path], Counter[str]]:
    """List the regular files of a folder.

    Parameters
    ----------
    folder : Path
        The path as the user typed it.
    deep : bool
        Whether the files of all sub-folders are listed too; links to folders are never followed.
    hidden : bool
        Whether files whose names begin with a dot are listed too.

    Returns
    -------
    files : list of Path
        Sorted. Links are kept where they lead to a regular file inside the folder.
    others : Counter
        How many entries were passed over, by reason.

    Raises
    ------
    UnreadableError
        For a folder that may not be read.
    """
    files: list[Path] = []
    others: Counter[str] = Counter()
    for parent, folders, names in os.walk(folder, onerror=_refuse):
        folders[:] = sorted(folders) if deep else []
        for path in (Path(parent, name) for name in sorted(names)):
            reason = "hidden" if path.name.startswith(".") and not hidden else _passed_over(path, folder)
            others.update([reason] if reason else [])
            files += [] if reason else [path]
    return files, others


def leaves_folder(name: str) -> bool:
    """Tell whether a name that a file gives, of whatever system, could lead out of that file's folder."""
    path = PureWindowsPath(name)  # it knows both kinds of separators
    return bool(path.anchor) or ".." in path.parts


def _passed_over(path: Path, folder: Path) -> str:
    try:
        target = path.resolve(strict=True)
    except (OSError, RuntimeError):
        return "links that lead nowhere"
    if path.is_symlink() and not target.is_relative_to(folder.resolve()):
        return "links that leave the folder"
    return "" if target.is_file() else "no regular files"


def _refuse(fault: OSError) -> None:
    raise UnreadableError("the folder cannot be read", file=str(fault.filename), found=_reason(fault)) from None


def _reason(fault: Exception) -> str:
    return (getattr(fault, "strerror", None) or "not a path").lower()


def counted(reasons: Counter[str]) -> str:
    """Put counts by reason into words."""
    return ", ".join(f"{count} {reason}" for reason, count in sorted(reasons.items()))


@contextmanager
def third_party(reader: str, file: str) -> Iterator[None]:
    """Turn whatever a third-party reader raises into one line, and silence its warnings and its log.

    Its own words stay out: they may hold patient data or a full path.
    """
    try:
        with unheard(reader):
            yield
    except TomomeshError:
        raise
    except MemoryError:
        raise ResourceError("the file does not fit into the memory", file=file) from None
    except Exception as fault:
        raise FormatError(
            f"{reader} cannot read the file",
            file=file,
            found=type(fault).__name__,
            expected="a whole and valid file",
        ) from None


@contextmanager
def unheard(library: str) -> Iterator[None]:
    """Keep what a library warns of and logs, values of fields and paths among it, from others' handlers and stderr."""
    logger, nobody = logging.getLogger(library), logging.NullHandler()
    propagate, logger.propagate = logger.propagate, False
    logger.addHandler(nobody)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.removeHandler(nobody)
        logger.propagate = propagate
