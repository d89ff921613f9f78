"""Outputs that are whole or not there."""

from __future__ import annotations

import os
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING

from ...errors import OutputError, UsageError
from .source import suffix_of
from .unfinished import sweep, unfinished

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator


@contextmanager
def replacing(path: str | Path) -> Iterator[IO[bytes]]:
    """Open a temporary file beside `path`, which takes its place once the block ends well.

    The file is on the disk before it gets its name, so that at any moment the old output is intact
    or the new one is whole. Whatever is raised inside removes the temporary file, and the next output in the
    same folder what a kill may have left (see `unfinished`).

    Raises
    ------
    OutputError
        Where the file cannot be written.
    """
    target = Path(os.path.realpath(path))
    sweep(target.parent)
    try:
        with unfinished(target) as file:
            yield file
    except OSError as fault:
        raise OutputError("the file cannot be written", file=str(path), found=_reason(fault)) from None
    _sync_folder(target.parent)


def _sync_folder(folder: Path) -> None:
    """Put the new name on the disk too, where the system can."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _reason(fault: OSError) -> str:
    return (fault.strerror or type(fault).__name__).lower()


def check_output(path: str | Path, suffixes: Collection[str], *, inputs: Iterable[str | Path] = ()) -> None:
    """Refuse an output that could not be written, before any work is done.

    Parameters
    ----------
    path : path
        The output.
    suffixes : collection of str
        Those that have a writer, as ``".stl"``.
    inputs : iterable of path
        Files that must not be overwritten.

    Raises
    ------
    UsageError
        For an unknown suffix, and where the output is one of the inputs.
    OutputError
        Where the folder is missing or may not be written to, or a folder has the output's name.
    """
    path = Path(path)
    if suffix_of(path) not in suffixes:
        raise UsageError(
            "the output's suffix has no writer",
            file=str(path),
            found=f"suffix = {suffix_of(path) or 'none'}",
            expected=" | ".join(sorted(suffixes)),
        )
    if any(os.path.realpath(path) == os.path.realpath(one) for one in inputs):
        raise UsageError("the output is the input", file=str(path), hint="another name")
    parent = Path(os.path.realpath(path)).parent
    if not parent.is_dir():
        raise OutputError("the output's folder is missing", file=str(path), hint="a folder that is there")
    if path.is_dir():
        raise OutputError("the output is a folder", file=str(path), expected="the name of a file")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise OutputError("the output's folder may not be written to", file=str(path))
