"""PLY: its header, which says how many bytes must follow, and a writer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import FormatError
from .atomic import replacing
from .limits import require_bytes

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

BYTES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "int32", "uint32", "float", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}
"""Bytes of a property's type."""

NAMES = {"f8": "double", "i4": "int", "u1": "uchar"}
"""PLY's names of the types that are written."""

FORMATS = ("ascii", "binary_little_endian", "binary_big_endian")


@dataclass(frozen=True)
class Element:
    """One kind of row: its name, how many there are, and the words that declare each property."""

    name: str
    count: int
    properties: tuple[tuple[str, ...], ...]

    def least_bytes(self, text: bool) -> int:
        """Return the fewest bytes that all rows can take: lists are empty, numbers have one digit."""
        kinds = [words[1] if words[0] == "list" else words[0] for words in self.properties]
        sizes = [BYTES[kind] for kind in kinds]
        return self.count * (2 * len(sizes) if text else sum(sizes))


@dataclass(frozen=True)
class Header:
    """What a PLY file promises.

    Attributes
    ----------
    format : str
        One of `FORMATS`.
    elements : tuple of Element
        In the order of the file.
    length : int
        Bytes up to the first row.
    """

    format: str
    elements: tuple[Element, ...]
    length: int

    def element(self, name: str) -> Element:
        """Return an element by its name, an empty one where there is none."""
        return next((one for one in self.elements if one.name == name), Element(name, 0, ()))


def parse_header(data: bytes, *, file: str) -> Header:
    """Read a PLY header and compare what it promises with what the file holds.

    Raises
    ------
    FormatError
        For a header that is broken, or promises more than there is.
    """
    end = data.find(b"end_header")
    length = data.find(b"\n", end) + 1
    lines = [line.split() for line in data[: max(end, 0)].decode("ascii", "replace").splitlines()]
    if end < 0 or length == 0 or len(lines) < 2 or lines[0] != ["ply"]:
        raise FormatError("the file has no PLY header", file=file, expected="ply ... end_header")
    try:
        header = Header(_format(lines), tuple(_elements(lines)), length)
        text = header.format == "ascii"
        promised = sum(element.least_bytes(text) for element in header.elements)
    except (IndexError, KeyError, ValueError):
        raise FormatError("the PLY header cannot be understood", file=file) from None
    # the last row of a text needs no line end
    require_bytes(promised - (1 if text else 0), len(data) - length, file=file)
    return header


def _format(lines: list[list[str]]) -> str:
    name = next((words[1] for words in lines if words[:1] == ["format"]), "")
    if name not in FORMATS:
        raise ValueError(name)
    return name


def _elements(lines: list[list[str]]) -> list[Element]:
    found: list[tuple[str, int, list[tuple[str, ...]]]] = []
    for words in lines:
        if words[:1] == ["element"]:
            if int(words[2]) < 0:
                raise ValueError(words[2])
            found.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            found[-1][2].append(tuple(words[1:]))
    return [Element(name, count, tuple(properties)) for name, count, properties in found]


def write_ply(
    path: str | Path,
    comment: str,
    vertices: NDArray[Any],
    faces: NDArray[np.int64] | None = None,
) -> None:
    """Write a binary PLY file, little-endian.

    Parameters
    ----------
    path : path
        The file.
    comment : str
        Goes into the header.
    vertices : (n,) structured array
        One field a property, of the types in `NAMES`.
    faces : (m, 3) int array, optional
        Vertex numbers.
    """
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment {comment}",
        f"element vertex {len(vertices)}",
    ]
    little = vertices.astype(vertices.dtype.newbyteorder("<"))
    lines += [f"property {NAMES[little.dtype[name].str[1:]]} {name}" for name in little.dtype.names or ()]
    rows = np.empty(0 if faces is None else len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    if faces is not None:
        lines += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
        rows["count"], rows["corners"] = 3, faces
    with replacing(path) as file:
        file.write(("\n".join([*lines, "end_header"]) + "\n").encode("ascii"))
        file.write(little.tobytes())
        file.write(rows.tobytes())
