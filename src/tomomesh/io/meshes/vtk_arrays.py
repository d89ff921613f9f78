"""The arrays of VTK's XML files of polygons: text, base 64 or appended bytes, packed by zlib or not."""

from __future__ import annotations

import base64
import re
import zlib
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ..files.limits import require_memory
from ..files.markup import parsed_xml
from ..files.source import third_party

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

    from numpy.typing import NDArray

TYPES = {
    "Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4", "UInt32": "u4",
    "Int64": "i8", "UInt64": "u8", "Float32": "f4", "Float64": "f8",
}  # fmt: skip
"""VTK's names of the types of numbers to NumPy's codes."""

APPENDED = re.compile(rb"<AppendedData([^>]*)>\s*_")
"""Where appended data begin; behind it are bytes that are no XML."""

PACKED = (None, "vtkZLibDataCompressor")
"""The compressors that are read."""


@dataclass(frozen=True)
class PolyData:
    """A file of polygons, parsed.

    Attributes
    ----------
    root : Element
        Without what is appended.
    appended : bytes
    raw : bool
        Whether that is bytes, and not base 64.
    file : str
    """

    root: Element
    appended: bytes
    raw: bool
    file: str

    @classmethod
    def parsed(cls, data: bytes, file: str) -> PolyData:
        """Parse the bytes of a file.

        Raises
        ------
        FormatError
            Where they are none of VTK's polygons.
        """
        at = data.find(b"<AppendedData")
        found = None if at < 0 else APPENDED.search(data, at)
        text, appended = (data, b"") if found is None else (data[: found.start()] + b"</VTKFile>", data[found.end() :])
        root = parsed_xml(text, file)
        kind, packed = root.get("type"), root.get("compressor")
        if root.tag != "VTKFile" or kind != "PolyData" or packed not in PACKED:
            raise FormatError(
                "the file is none of VTK's polygons that can be read", file=file,
                found=f"type = {kind}, compressor = {packed}", expected="PolyData, packed by zlib or not at all",
            )  # fmt: skip
        return cls(root, appended, found is not None and b"raw" in found[1], file)

    @property
    def pieces(self) -> list[Element]:
        """The pieces, one after the other."""
        return self.root.findall("PolyData/Piece")

    @cached_property
    def order(self) -> str:
        """The byte order."""
        return ">" if self.root.get("byte_order") == "BigEndian" else "<"

    def arrays(self, piece: Element, section: str) -> dict[str, NDArray[Any]]:
        """Return the arrays of a section, by name; several components are columns."""
        found = piece.find(section)
        every = [] if found is None else found.findall("DataArray")
        with third_party("vtk", self.file):
            return {one.get("Name", str(n)): self._array(one) for n, one in enumerate(every)}

    def texts(self) -> dict[str, str]:
        """Return the texts about the whole file."""
        every = self.root.findall("PolyData/FieldData/Array")
        codes = {one.get("Name", ""): (one.text or "").split() for one in every if one.get("format") == "ascii"}
        return {name: "".join(chr(int(code)) for code in words if code != "0") for name, words in codes.items()}

    def _array(self, one: Element) -> NDArray[Any]:
        kind, columns = np.dtype(self.order + TYPES[one.attrib["type"]]), int(one.get("NumberOfComponents", 1))
        if one.get("format") == "ascii":
            values = np.array((one.text or "").split(), np.float64 if kind.kind == "f" else np.int64).astype(kind)
        else:
            values = np.frombuffer(self._bytes(one), kind)
        return values.reshape(-1, columns) if columns > 1 else values

    def _bytes(self, one: Element) -> bytes | memoryview:
        """Return the bytes of an array, unpacked."""
        if one.get("format") == "appended":
            source, raw = self.appended[int(one.attrib["offset"]) :], self.raw
        else:
            source, raw = _joined((one.text or "").strip()).encode("ascii"), False
        size = 8 if self.root.get("header_type") == "UInt64" else 4
        word = np.dtype(f"{self.order}u{size}")
        if self.root.get("compressor") is None:
            count = int(np.frombuffer(_taken(source, raw, size), word)[0])
            return memoryview(_taken(source, raw, size + count))[size:]
        blocks = int(np.frombuffer(_taken(source, raw, size), word)[0])
        head = np.frombuffer(_taken(source, raw, (3 + blocks) * size), word).astype(np.int64)
        require_memory(int(blocks * head[1]), file=self.file)
        start = len(head) * size if raw else _letters(len(head) * size)
        packed, ends = _taken(source[start:], raw, int(head[3:].sum())), np.cumsum(head[3:])
        parts = [packed[end - length : end] for end, length in zip(ends, head[3:], strict=True)]
        return b"".join(_unpacked(part, int(head[1])) for part in parts)


def _joined(text: str) -> str:
    """Return a text without white space; most have none inside, which is quickly seen."""
    return "".join(text.split()) if any(space in text for space in " \t\r\n") else text


def _letters(count: int) -> int:
    """Return how many letters of base 64 so many bytes take."""
    return 4 * -(-count // 3)


def _taken(source: bytes, raw: bool, count: int) -> bytes:
    """Return the first bytes of a source; of base 64, what stands before its end."""
    found = source[:count] if raw else base64.b64decode(source[: _letters(count)])[:count]
    if count < 0 or len(found) < count:
        raise ValueError(count)
    return found


def _unpacked(data: bytes, most: int) -> bytes:
    """Unpack a block that is no longer than the file says."""
    return zlib.decompressobj().decompress(data, most)
