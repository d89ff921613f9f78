"""What pydicom reads of a file, with a bound to what a broken or hostile one can ask for."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any, BinaryIO

from ....errors import FormatError
from .deflated import check_deflated
from .element import ELEMENTS, PixelElement

if TYPE_CHECKING:
    from pathlib import Path

SHORT = 2**16
"""Bytes that are asked for without a look at how many there are: what the lengths of 16 bits can ask for."""


class Bounded(io.BufferedReader):
    """A file that makes room for no more bytes than it holds: a length in a header may say anything."""

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self._bytes = path.stat().st_size

    def read(self, size: int | None = -1, /) -> bytes:
        """Read as `io.BufferedReader` does."""
        if size is not None and size > SHORT:
            size = min(size, max(self._bytes - self.tell(), 0))
        return super().read(size)


def read_dataset(path: Path, **options: Any) -> Any:
    """Read a DICOM file; `options` are those of ``pydicom.dcmread``.

    Returns
    -------
    pydicom Dataset
        With the attribute `pixels_at`: how far the file was read.

    Raises
    ------
    ResourceError
        Where the file is packed as a whole, and holds too much.
    """
    import pydicom

    with Bounded(path) as file:
        check_deflated(file, name=path.name)
        data: Any = pydicom.dcmread(file, force=True, **options)
        data.pixels_at = file.tell()
    return data


def inflated(path: Path) -> tuple[BinaryIO, PixelElement]:
    """Return the pixels of a packed file, and where they stand."""
    data = read_dataset(path)
    for keyword in ELEMENTS.values():
        if keyword in data:
            value = data[keyword].value
            return io.BytesIO(value), PixelElement(keyword, "OW", 0, len(value), encapsulated=False)
    raise FormatError("the file holds no pixels", file=path.name, found="PixelData = missing", hint="a fresh copy")
