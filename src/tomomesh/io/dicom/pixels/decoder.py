"""Frames of DICOM files, one at a time: never more of a study in memory than the compressed frames of one file."""

from __future__ import annotations

from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ....errors import TomomeshError
from ...files.limits import require_memory
from ...files.parts import read_later
from ...files.source import third_party
from ..headers.dataset import inflated
from ..headers.deflated import DEFLATED
from ..headers.element import PixelElement, pixel_element
from .child import Child
from .encapsulated import LARGEST_FRAME_BYTES, SYNTAXES, read_encapsulated
from .layout import PixelLayout, layout_of, syntax_of
from .levels import levels
from .native import NATIVE, check_native, read_native
from .rle import is_gray_rle, read_rle
from .tables import check_tables

if TYPE_CHECKING:
    from pathlib import Path
    from types import TracebackType
    from typing import BinaryIO

    from numpy.typing import NDArray

    from ..headers.header import ImageFrame


@dataclass(frozen=True)
class _Opened:
    """A file that is being read, and its compressed frames where it has such."""

    path: Path
    file: BinaryIO
    element: PixelElement
    layout: PixelLayout
    codes: list[bytes]


class Decoder:
    """Read frames; the file of the last one stays open for its others, the child process for those of all files."""

    def __init__(self) -> None:
        self._child, self._files = Child(), ExitStack()
        self._opened: _Opened | None = None
        self._last: tuple[ImageFrame, NDArray[Any]] | None = None

    def __enter__(self) -> Decoder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._child.end()
        self._files.close()

    def __call__(self, frame: ImageFrame) -> NDArray[Any]:
        """Return a frame's gray levels before their scale, (J, I), or its colors, (J, I, 3).

        Raises
        ------
        FormatError
            For pixels that are missing, cut off, of a wrong sign, or of a kind or compression that is not read.
        ResourceError
            Where they do not fit into the memory, or take too much of it or of time to decode.
        """
        if self._last is None or self._last[0] is not frame:
            self._last = frame, self._read(frame)
        return self._last[1]

    def expect(self, frame: ImageFrame) -> None:
        """Start the child process where frames like this one need it: while it starts, headers can be read."""
        with suppress(TomomeshError), third_party("pydicom", frame.path.name):  # what is wrong is said when it is read
            layout = layout_of(frame, "PixelData")
            alone = layout.syntax not in SYNTAXES or is_gray_rle(layout)
            if not alone and layout.frame_bytes <= LARGEST_FRAME_BYTES:
                self._child.ready(layout.frame_bytes)

    def check(self, frame: ImageFrame) -> None:
        """Compare what the file of a frame promises with what it holds; of compressed pixels that is not known yet.

        Raises
        ------
        FormatError, ResourceError
            As reading the frame does.
        """
        if syntax_of(frame.header) in NATIVE - {DEFLATED}:
            self._open(frame)

    def _read(self, frame: ImageFrame) -> NDArray[Any]:
        opened = self._open(frame)
        with third_party("pydicom", frame.path.name):
            pixels, photometric = self._pixels(opened, frame.number)
            return levels(pixels, photometric, opened.layout, frame.header)

    def _open(self, frame: ImageFrame) -> _Opened:
        if self._opened is None or self._opened.path != frame.path:
            self._files.close()
            self._opened = None
            with third_party("pydicom", frame.path.name):
                self._opened = _opened(frame, self._files)
        return self._opened

    def _pixels(self, opened: _Opened, number: int) -> tuple[NDArray[Any], str]:
        if opened.codes and is_gray_rle(opened.layout):
            return read_rle(opened.codes[number], opened.layout), opened.layout.photometric
        if opened.codes:
            return self._child.decode(opened.codes[number], opened.layout)
        return read_native(opened.file, opened.element, opened.layout, number)


def _opened(frame: ImageFrame, files: ExitStack) -> _Opened:
    """Open the file of a frame, and check what it promises against what it holds."""
    check_tables(frame.header, name=frame.path.name)
    file: BinaryIO = files.enter_context(frame.path.open("rb"))
    file.seek(frame.header.pixels_at)
    if frame.header.file_meta.get("TransferSyntaxUID") == DEFLATED:
        file, element = inflated(frame.path)
    else:
        element = pixel_element(file, frame.header, name=frame.path.name)
    layout = layout_of(frame, element.keyword)
    require_memory((1 if read_later() else layout.frames) * layout.frame_bytes, file=layout.name)
    if layout.syntax not in NATIVE:
        return _Opened(frame.path, file, element, layout, read_encapsulated(file, element, layout))
    check_native(element, layout)
    return _Opened(frame.path, file, element, layout, [])
