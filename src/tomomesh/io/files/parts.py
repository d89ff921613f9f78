"""Files that are opened now and read later, part by part: whether that is wanted, and whether they are still the same.

No handle is kept: whoever reads a part, in this process or in another, opens the path itself.
"""

from __future__ import annotations

from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...errors import UnreadableError
from .source import existing

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

_later = ContextVar("_later", default=False)


def read_later() -> bool:
    """Tell whether voxels are to stay in their file, where its format allows it."""
    return _later.get()


@contextmanager
def reading_later(later: bool) -> Iterator[None]:
    """Say whether voxels are to stay in their file."""
    before = _later.set(later)
    try:
        yield
    finally:
        _later.reset(before)


@dataclass(frozen=True)
class Seen:
    """A file, or a folder, as it was when it was opened.

    Attributes
    ----------
    path : Path
    size, changed_ns : int
        Its bytes, and when it was written last.
    """

    path: Path
    size: int
    changed_ns: int

    @classmethod
    def of(cls, path: Path) -> Seen:
        """Look at a file.

        Raises
        ------
        UnreadableError, FormatError
            As `existing`.
        """
        stat = existing(path).stat()
        return cls(path.absolute(), stat.st_size, stat.st_mtime_ns)

    def unchanged(self) -> Path:
        """Return its path.

        Raises
        ------
        UnreadableError, FormatError
            Where it is gone, or was written since it was opened.
        """
        if Seen.of(self.path) != self:
            raise UnreadableError(
                "the file has changed since it was opened",
                file=str(self.path),
                hint="the same command again, once nothing writes to it",
            )
        return self.path
