"""The pages of a TIFF file: their chain, looked at before tifffile follows it, and those that make one stack."""

from __future__ import annotations

import logging
import struct
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ..files.extras import required
from ..files.source import third_party

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from ..files.parts import Seen


SLICES = "ZIQ"
"""tifffile's letters for the axis of a stack: Z, or pages of an unknown kind."""


@contextmanager
def opened(path: Path, name: str) -> Iterator[Any]:
    """Open a file of pages; what it names beside it is not opened.

    Raises
    ------
    FormatError
        For pages that are damaged, and where the package is not installed.
    """
    tifffile = required("tifffile", file=name)
    check_chain(path, file=name)
    with _complaints_refused(name), third_party("tifffile", name), tifffile.TiffFile(path, _multifile=False) as pages:
        yield pages


class _Complaints(logging.Handler):
    """Keep what is logged as an error."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.found: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.found.append(record)


@contextmanager
def _complaints_refused(name: str) -> Iterator[None]:
    """Refuse what tifffile only logs: pages behind a broken link would be missing in silence."""
    complaints, logger = _Complaints(), logging.getLogger("tifffile")
    propagate, logger.propagate = logger.propagate, False
    logger.addHandler(complaints)
    try:
        yield
    except FormatError:
        if not complaints.found:  # else they tell why
            raise
    finally:
        logger.removeHandler(complaints)
        logger.propagate = propagate
    if complaints.found:
        raise FormatError(
            "the pages of the file are damaged",
            file=name,
            found=f"tifffile = {len(complaints.found)} complaints",
            expected="a whole and valid file",
            hint="a fresh copy of the file",
        )


def stack_of(series: list[Any], name: str) -> list[Any]:
    """Return the one stack of a file, or the pages of one size that were written one by one; none that is a preview."""
    found = [one for one in series if not one.keyframe.is_reduced] or series
    kinds = {(one.kind, one.axes, one.shape, one.dtype) for one in found}
    alone = found[0].kind == "shaped" and not _before_page(found[0])  # as tifffile writes pages one by one
    if len(found) > 1 and (len(kinds) > 1 or not alone):
        raise FormatError(
            "the file holds several images",
            file=name,
            found=f"images = {len(found)}",
            expected="one stack of pages of one size",
            hint="one stack, written to a file of its own",
        )
    before = "".join(_before_page(found[0]))
    if len(found) == 1 and not before:
        raise FormatError("the file holds one slice", file=name, hint="the folder of the slices")
    if len(before) > 1 or before.strip(SLICES):
        raise FormatError(
            f"the file holds several {'channels' if before.strip(SLICES) == 'C' else 'frames'}",
            file=name,
            found=f"axes = {found[0].axes}, shape = {found[0].shape}",
            expected="slices, rows and columns",
            hint="one of them, written to a file of its own",
        )
    return found


def page_axes(series: Any) -> str:
    """Return the letters of the axes within a page; S is a color, which may be planar."""
    return next(axes for axes in ("SYX", "YXS", "YX", series.axes) if series.axes.endswith(axes))


def _before_page(series: Any) -> list[str]:
    """Return the letters of the axes before those of a page along which there is more than one."""
    before = len(series.axes) - len(page_axes(series))
    return [axis for axis, size in zip(series.axes[:before], series.shape[:before], strict=True) if size > 1]


def pages_of(found: list[Any]) -> list[Any]:
    """Return the pages of a stack."""
    return [page for one in found for page in one.pages]


@dataclass(frozen=True)
class Pages:
    """The pages of a file, each of which is read alone.

    Attributes
    ----------
    shape : tuple of int
        Sizes of all axes: pages, those of a page, and one of 1.
    dtype : data type
    seen : Seen
        The file.
    file : str
        The path as the user typed it.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    seen: Seen
    file: str

    @property
    def chunks(self) -> tuple[int, ...]:
        """Sizes of what is read together: a page."""
        return (1, *self.shape[1:])

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Return a part.

        Raises
        ------
        FormatError, UnreadableError
            For pages that are damaged, and a file that was written since it was opened.
        """
        numbers = range(self.shape[0])[box[0]]
        with opened(self.seen.unchanged(), self.file) as pages:
            found = pages_of(stack_of(pages.series, self.file))
            return np.stack([found[n].asarray().reshape(self.shape[1:])[box[1:]] for n in numbers])


def check_chain(path: Path, *, file: str) -> None:
    """Refuse a file of which a page leads back to an earlier one: tifffile would go around for ever. It tells the rest.

    Raises
    ------
    FormatError
        For a circle of pages.
    """
    size, seen = path.stat().st_size, set[int]()
    with path.open("rb") as stream:
        head = stream.read(4)
        order = ">" if head[:2] == b"MM" else "<"
        big = head[2:] in (b"\0\x2b", b"\x2b\0")
        count, entry, place = ("Q", 20, "Q") if big else ("H", 12, "I")
        offset = _number(stream, 8 if big else 4, order + place, size)
        while offset:
            if offset in seen:
                found = f"pages = {len(seen)}, then the one at byte {offset} again"
                raise FormatError("the pages of the file go around in a circle", file=file, found=found)
            seen.add(offset)
            entries = _number(stream, offset, order + count, size)
            after = offset + struct.calcsize(order + count) + entries * entry
            offset = _number(stream, after, order + place, size)


def _number(stream: Any, start: int, layout: str, size: int) -> int:
    """Return a whole number of the file, 0 behind its end."""
    length = struct.calcsize(layout)
    if start + length > size:
        return 0
    stream.seek(start)
    return int(struct.unpack(layout, stream.read(length))[0])
