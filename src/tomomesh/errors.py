"""The errors that tomomesh raises: one family, one line each, one exit code a kind."""

from __future__ import annotations

import errno
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Numbers of the system's errors where a disk, a quota or a limit of a file's size is full."""


class TomomeshError(Exception):
    """Say in one line what is wrong, where, what was expected and what to try.

    Parameters
    ----------
    what : str
        The fault, without a full stop.
    file : str, optional
        The path as the user typed it, or the bare name of a file inside it.
    found : str, optional
        The field and its value, as ``"spacing = 0"``.
    expected : str, optional
        The rule that was broken.
    hint : str, optional
        The flag or action that may help.
    flags : sequence of str
        The options among these that make the same command go on, as ``"--fill-gaps"``: for programs, in place of words.

    Examples
    --------
    >>> from tomomesh import TomomeshError, read_mesh
    >>> try:
    ...     read_mesh("nowhere.stl")
    ... except TomomeshError as error:
    ...     print(error.exit_code, error)
    3 the path cannot be read. File: nowhere.stl [no such file or directory].
    """

    exit_code = 1

    def __init__(
        self, what: str, *, file: str = "", found: str = "", expected: str = "", hint: str = "",
        flags: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self.flags = tuple(flags)
        where = f" File: {printable(file)}" if file else ""
        where += (" " if where else " Found: ") + f"[{printable(found)}]" if found else ""
        parts = [
            f"{printable(what)}.",
            f"{where.strip()}." if where else "",
            f"Expected: {expected}." if expected else "",
            f"Try: {hint}." if hint else "",
        ]
        super().__init__(" ".join(part for part in parts if part))

    @property
    def told(self) -> dict[str, Any]:
        """What programs are told of it: the exit code of its kind, and the line."""
        return {"exit_code": self.exit_code, "error": str(self)}

    def __reduce__(self) -> tuple[Any, ...]:
        """Let other processes hand it on as it is, and not make another sentence of it."""
        return _restored, (type(self), str(self), self.flags)


def _restored(kind: type[TomomeshError], said: str, flags: tuple[str, ...]) -> TomomeshError:
    error = kind("", flags=flags)
    error.args = (said,)
    return error


def printable(text: str) -> str:
    """Return a text whose control characters are replaced: no file name or tag may steer a terminal or forge a log."""
    return "".join(c if c.isprintable() else "?" for c in text)


class UsageError(TomomeshError):
    """A parameter is outside its limits, or two of them contradict each other."""

    exit_code = 2


class UnreadableError(TomomeshError):
    """The path does not exist, is empty or may not be read."""

    exit_code = 3


class FormatError(TomomeshError):
    """The file is corrupt, or of a kind that cannot be read."""

    exit_code = 4


class GeometryError(TomomeshError):
    """The geometry of the study or of the cloud needs a decision or a flag."""

    exit_code = 5


class EmptyError(TomomeshError):
    """Nothing is left to work on."""

    exit_code = 6


class ResourceError(TomomeshError):
    """The work would not fit into the machine."""

    exit_code = 7


class OutputError(TomomeshError):
    """A result cannot be written."""

    exit_code = 8


class InternalCheckError(TomomeshError):
    """A result failed its own check before it was written: a bug in tomomesh."""

    exit_code = 9


class BatchError(TomomeshError):
    """Some studies of a batch failed; the others were written."""

    exit_code = 10
