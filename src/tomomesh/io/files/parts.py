"""Files that are opened now and read later, part by part: whether that is wanted, and whether they are still the same.

No handle is kept: whoever reads a part, in this process or in another, opens the path itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ...errors import UnreadableError
from .source import existing

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

Each = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]
"""Who does the same work on several parts, as `map` does, here or elsewhere; what comes out is in their order."""

_each: ContextVar[Each | None] = ContextVar("_each", default=None)


def read_later() -> bool:
    """Tell whether voxels are to stay in their file, where its format allows it."""
    return _each.get() is not None


def each_part(work: Callable[[Any], Any], parts: Sequence[Any]) -> Iterable[Any]:
    """Do the work on all parts, by whoever was named for that."""
    return (_each.get() or map)(work, parts)


@contextmanager
def reading_later(each: Each | None) -> Iterator[None]:
    """Let voxels stay in their file; who is named goes through all of them where that cannot wait. None: read now."""
    before = _each.set(each)
    try:
        yield
    finally:
        _each.reset(before)


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
        UnreadableError
            Where it is gone, or was written since it was opened.
        """
        try:
            stat = self.path.stat()
        except OSError as fault:
            raise UnreadableError(
                "the file that was opened is not there", file=self.path.name, found=str(fault.strerror).lower(),
                hint="the same command, with the file at the same path on every machine that works on it",
            ) from None  # fmt: skip
        if (stat.st_size, stat.st_mtime_ns) != (self.size, self.changed_ns):
            found = f"size = {stat.st_size} bytes, {self.size} before"
            hint = "the same command again, once nothing writes to it"
            raise UnreadableError(
                "the file has changed since it was opened", file=self.path.name, found=found, hint=hint
            )
        return self.path
