"""Broken files of a series: refused, or left out where the user says so."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...errors import FormatError, printable

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping
    from pathlib import Path, PurePath

    from ...errors import TomomeshError

SHOWN = 8
"""Names in one line of an error, so that it stays one that is read."""


def leave_out(bad: Mapping[Path, TomomeshError], good: int, *, skip: bool, study: str) -> tuple[str, ...]:
    """Return the note on the broken files that are left out.

    Parameters
    ----------
    bad : dict
        Broken files, with the error of each.
    good : int
        How many files are left without them.
    skip : bool
        Whether the user wants to go on without them.
    study : str
        The path as the user typed it.

    Raises
    ------
    TomomeshError
        The file's own error where it is the only one, or where no file is left; else a `FormatError` that lists them.
    """
    if not bad:
        return ()
    if skip and good:
        return (f"unreadable files left out: {len(bad)} ({listed(bad)})",)
    first = next(iter(bad.values()))
    if not good:
        raise first
    if len(bad) == 1:  # its own error says more than a list
        first.args = (f"{first} {'Or' if 'Try: ' in str(first) else 'Try'}: --skip-bad to go on without it.",)
        first.flags += ("--skip-bad",)
        raise first
    raise FormatError(
        f"{len(bad)} of {len(bad) + good} files cannot be read",
        file=study,
        found=listed(bad),
        expected="whole and valid files",
        hint="fresh copies of them, or --skip-bad to go on without them",
        flags=["--skip-bad"],
    )


def listed(paths: Collection[PurePath]) -> str:
    """Put the bare names of files into words, without characters that could write to a terminal."""
    names = [printable(path.name) for path in list(paths)[:SHOWN]]
    return ", ".join(names) + (", ..." if len(paths) > SHOWN else "")
