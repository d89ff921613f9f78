"""PLY: its header, which says how many bytes must follow, and meshes out."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError, OutputError
from ..fields import AXES
from ..files.atomic import replacing
from ..files.limits import require_bytes
from .attributes import kind_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from ..fields import Fields
    from .attributes import MeshAttributes
    from .pieces.parts import Parts

TYPE_NAMES = {
    "i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort",
    "i4": "int", "u4": "uint", "f4": "float", "f8": "double",
}  # fmt: skip
"""NumPy's codes of the types of properties to PLY's names."""

TYPE_CODES = {
    **{name: code for code, name in TYPE_NAMES.items()},
    **{f"{word}{8 * size}": f"{word[0]}{size}" for word in ("int", "uint") for size in (1, 2, 4)},
    "float32": "f4",
    "float64": "f8",
}
"""Every name of a type to NumPy's code."""

WRITTEN = ("u1", "i4", "u4", "f4", "f8")
"""Codes of the types that are written: meshio's reader of binary files knows no other names of ours."""

MOST_VERTICES = 2**31 - 1
"""As many as ``int`` numbers, which every reader takes; ``uint``, the longest that PLY has, reaches twice as far."""

FILLED = "filled"
"""The property of faces that were filled, not measured."""

LINE_END = re.compile(rb"[ \t]*(\r\n|\n|\r)")
"""The end of the header's last line: behind a lone carriage return the first row may begin with any byte but that of a
line feed, which no format tells from the end of both."""

BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
"""The formats to their byte orders."""


@dataclass(frozen=True)
class PlyElement:
    """One kind of row: its name, how many there are, and the words that declare each property."""

    name: str
    count: int
    properties: tuple[tuple[str, ...], ...]

    @property
    def names(self) -> list[str]:
        """Names of the properties."""
        return [words[-1] for words in self.properties]

    @property
    def has_lists(self) -> bool:
        """Whether rows differ in length."""
        return any(words[0] == "list" for words in self.properties)

    def types(self, order: str) -> list[np.dtype[Any]]:
        """Return the type of each property; of a list, that of its length."""
        kinds = [words[1] if words[0] == "list" else words[0] for words in self.properties]
        return [np.dtype(order + TYPE_CODES[kind]) for kind in kinds]

    def least_bytes(self, text: bool) -> int:
        """Return the fewest bytes that all rows can take: lists are empty, numbers have one digit."""
        types = self.types("")
        return self.count * (2 * len(types) if text else sum(kind.itemsize for kind in types))


@dataclass(frozen=True)
class PlyHeader:
    """What a PLY file promises.

    Attributes
    ----------
    format : str
        One of `BYTE_ORDERS`.
    elements : tuple of PlyElement
        In the order of the file.
    length : int
        Bytes up to the first row.
    """

    format: str
    elements: tuple[PlyElement, ...]
    length: int

    def before(self, name: str) -> tuple[tuple[PlyElement, ...], PlyElement]:
        """Return an element by its name, an empty one where there is none, and those before it."""
        names = [one.name for one in self.elements]
        at = names.index(name) if name in names else len(names)
        return self.elements[:at], (*self.elements, PlyElement(name, 0, ()))[at]


def parse_header(data: bytes, *, file: str, size: int | None = None) -> PlyHeader:
    """Read a PLY header and compare what it promises with what the file holds: `size` bytes, or those of `data`.

    Raises
    ------
    FormatError
        For a header that is broken, or promises more than there is.
    """
    end = data.find(b"end_header")
    line_end = LINE_END.match(data, end + len(b"end_header"))
    length = line_end.end() if line_end else 0
    lines = [line.split() for line in data[: max(end, 0)].decode("ascii", "replace").splitlines()]
    if end < 0 or length == 0 or len(lines) < 2 or lines[0] != ["ply"]:
        raise FormatError("the file has no PLY header", file=file, expected="ply ... end_header")
    try:
        header = PlyHeader(_format(lines), tuple(_elements(lines)), length)
        text = header.format == "ascii"
        promised = sum(element.least_bytes(text) for element in header.elements)
    except (IndexError, KeyError, ValueError):
        raise FormatError("the PLY header cannot be understood", file=file) from None
    # the last row of a text needs no line end
    held = len(data) if size is None else size
    require_bytes(promised - (1 if text else 0), held - length, file=file)
    return header


def _format(lines: list[list[str]]) -> str:
    name = next((words[1] for words in lines if words[:1] == ["format"]), "")
    if name not in BYTE_ORDERS:
        raise ValueError(name)
    return name


def _elements(lines: list[list[str]]) -> list[PlyElement]:
    found: list[tuple[str, int, list[tuple[str, ...]]]] = []
    for words in lines:
        if words[:1] == ["element"]:
            if int(words[2]) < 0:
                raise ValueError(words[2])
            found.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            found[-1][2].append(tuple(words[1:]))
    return [PlyElement(name, count, tuple(properties)) for name, count, properties in found]


def ply_parts(mesh: Parts, path: str | Path, beside: MeshAttributes) -> Iterator[bytes]:
    """Yield a file part by part: 64-bit coordinates, or 32-bit ones where asked for, with all fields.

    Raises
    ------
    OutputError
        For more vertices than the format's numbers reach.
    """
    if mesh.vertex_count > MOST_VERTICES:
        raise OutputError(
            "PLY numbers vertices in 32 bits", file=str(path), found=f"vertices = {mesh.vertex_count}",
            expected=f"at most {MOST_VERTICES}", hint="an .obj file, or --pieces",
        )  # fmt: skip
    kind = kind_of(mesh, beside)
    at, on = ({name: _storable(values) for name, values in one.items()} for one in _fields(beside))
    vertices = _numbered((dict(zip(AXES, some.astype(kind).T, strict=True)) for some in mesh.vertices()), at)
    filled = mesh.filled()
    faces = _numbered(_marked(_corners(mesh), filled), on)
    lines = _element("vertex", mesh.vertex_count, {**dict.fromkeys(AXES, np.empty(0, kind)), **at})
    lines += [f"element face {mesh.face_count}", "property list uchar int vertex_indices"]
    lines += _properties({} if filled is None else {FILLED: np.empty(0, np.uint8)}) + _properties(on)
    yield _head(beside.head, lines)
    yield from (_rows(some).tobytes() for rows in (vertices, faces) for some in rows)


def _fields(beside: MeshAttributes) -> tuple[Fields, Fields]:
    return beside.vertex_fields, beside.face_fields


def _threes(faces: NDArray[np.int64]) -> NDArray[np.uint8]:
    return np.full(len(faces), 3, np.uint8)


def _corners(mesh: Parts) -> Iterator[Fields]:
    return ({"count": _threes(some), "corners": some.astype(np.int32)} for some in mesh.faces())


def _marked(parts: Iterator[Fields], filled: Iterator[NDArray[np.bool_]] | None) -> Iterator[Fields]:
    """Put which faces were filled behind the columns of each part of them, where any was."""
    if filled is None:
        return parts
    return (columns | {FILLED: some.view(np.uint8)} for columns, some in zip(parts, filled, strict=True))


def _numbered(parts: Iterator[Fields], fields: Fields) -> Iterator[Fields]:
    """Put the rows of the fields of the whole behind the columns of each part."""
    start = 0
    for columns in parts:
        stop = start + len(next(iter(columns.values())))
        yield columns | {name: values[start:stop] for name, values in fields.items()}
        start = stop


def write_ply(path: str | Path, comment: str, vertices: Mapping[str, NDArray[Any]]) -> None:
    """Write points as a binary PLY file, little-endian.

    Parameters
    ----------
    path : path
        The file.
    comment : str
        Goes into the header.
    vertices : mapping of str to (n,) array
        One column a property; other small integers than bytes become ``int``, which every reader
        knows, and integers that PLY has no type for doubles.
    """
    columns: Fields = {name: _storable(column) for name, column in vertices.items()}
    rows = _rows(columns)
    with replacing(path) as file:
        file.write(_head(comment, _element("vertex", len(rows), columns)))
        file.write(rows.tobytes())


def _head(comment: str, elements: list[str]) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", f"comment {comment}", *elements, "end_header\n"]
    return "\n".join(lines).encode("ascii")


def _element(name: str, count: int, columns: Mapping[str, NDArray[Any]]) -> list[str]:
    return [f"element {name} {count}", *_properties(columns)]


def _storable(column: NDArray[Any]) -> NDArray[Any]:
    """Return a column in a type that every reader of PLY knows."""
    if column.dtype.str[1:] in WRITTEN:
        return column
    if column.dtype.kind == "f":
        return column.astype(np.float32 if column.dtype.itemsize < 4 else np.float64)
    return column.astype(np.int32 if np.array_equal(column.astype(np.int32), column) else np.float64)


def _rows(columns: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
    kinds = [(name, column.dtype.newbyteorder("<"), column.shape[1:]) for name, column in columns.items()]
    rows = np.empty(len(next(iter(columns.values()))), kinds)
    for name, column in columns.items():
        rows[name] = column
    return rows


def _properties(columns: Mapping[str, NDArray[Any]]) -> list[str]:
    return [f"property {TYPE_NAMES[column.dtype.str[1:]]} {name}" for name, column in columns.items()]
