"""The vertices of PLY files, text and binary."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...errors import FormatError
from ..fields import AXES, split_fields
from ..files.limits import require_bytes, require_rows
from ..files.source import whole
from ..meshes.ply import BYTE_ORDERS, TYPE_CODES, parse_header
from ..text import parse_rows, typed

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..fields import Cloud, Fields
    from ..meshes.ply import PlyElement, PlyHeader


def read_ply(path: Path) -> Cloud:
    """Read the vertices of a PLY file with all their properties but lists, as multi-view stereo adds to them.

    Raises
    ------
    FormatError
        For a broken header, rows that lie, and vertices without positions.
    """
    data, file = whole(path), str(path)
    return vertices_of(data, parse_header(data, file=file), file)


def vertices_of(data: bytes, header: PlyHeader, file: str) -> Cloud:
    """Read the vertices behind a header.

    Raises
    ------
    FormatError
    """
    before, vertex = header.before("vertex")
    if vertex.count == 0:
        return np.empty((0, 3)), {}
    single = [words[-1] for words in vertex.properties if words[0] != "list"]
    if not set(AXES) <= set(single) or len(set(vertex.names)) < len(vertex.names):
        raise FormatError("the vertices have no positions", file=file, expected="single properties x, y and z")
    read = _text_rows if header.format == "ascii" else _binary_rows
    return split_fields(read(data, header, before, vertex, file), file=file)


def _text_rows(data: bytes, header: PlyHeader, before: tuple[PlyElement, ...], vertex: PlyElement, file: str) -> Fields:
    first = sum(element.count for element in before)
    lines = data[header.length :].decode("ascii", "replace").splitlines()[first : first + vertex.count]
    lines = [_without_lists(line, vertex) for line in lines] if vertex.has_lists else lines
    numbers = [
        (name, kind) for name, kind, words in zip(vertex.names, vertex.types(""), vertex.properties, strict=True)
        if words[0] != "list"
    ]  # fmt: skip
    names = [name for name, _ in numbers]
    rows = parse_rows(
        lines,
        required=[names.index(axis) for axis in AXES],
        file=file,
        before=data[: header.length].count(b"\n") + first,
        width=len(names),
    )
    require_rows(vertex.count, len(rows), "vertices", file=file)
    columns = zip(numbers, rows.T, strict=True)
    return {name: column if name in AXES else typed(column, kind) for (name, kind), column in columns}


def _without_lists(line: str, vertex: PlyElement) -> str:
    """Return the numbers of a row without its lists; all of it where these are broken, so that the row is told."""
    words, kept, at = line.split(), [], 0
    for declared in vertex.properties:
        if at >= len(words) or (declared[0] == "list" and not words[at].isdigit()):
            return line
        if declared[0] == "list":
            at += int(words[at])
        else:
            kept.append(words[at])
        at += 1
    return " ".join([*kept, *words[at:]])


def _binary_rows(
    data: bytes, header: PlyHeader, before: tuple[PlyElement, ...], vertex: PlyElement, file: str
) -> Fields:
    order, start = BYTE_ORDERS[header.format], header.length
    for element in before:
        start = _rows(data, start, element, order, file)[1] if element.has_lists else start + element.least_bytes(False)
    if vertex.has_lists:
        return _gathered(np.frombuffer(data, np.uint8), _rows(data, start, vertex, order, file)[0], vertex, order)
    kind = np.dtype(list(zip(vertex.names, vertex.types(order), strict=True)))
    require_bytes(vertex.count * kind.itemsize, len(data) - start, file=file)
    rows = np.frombuffer(data, kind, vertex.count, start)
    return {name: rows[name] for name in vertex.names}


def _rows(data: bytes, start: int, element: PlyElement, order: str, file: str) -> tuple[NDArray[np.int64], int]:
    """Return where the rows of an element with lists begin, the first at `start`, and where they end."""
    from ...kernels.files.rows import row_starts

    kinds, starts = element.types(order), np.empty(element.count, np.int64)
    try:
        items = [np.dtype(TYPE_CODES[words[2]]).itemsize if words[0] == "list" else 0 for words in element.properties]
        if any(kind.kind == "f" for kind, item in zip(kinds, items, strict=True) if item):
            raise ValueError(kinds)
    except (KeyError, IndexError, ValueError):
        raise FormatError("the lists cannot be understood", file=file, expected="whole numbers as lengths") from None
    end = row_starts(
        np.array(np.frombuffer(data, np.uint8)), start, np.array([kind.itemsize for kind in kinds]), np.array(items),
        np.array([kind.kind == "i" for kind in kinds]), order == ">", starts,
    )  # fmt: skip
    if end < 0:
        raise FormatError("the lists are broken, or the file is cut off", file=file, found=f"element = {element.name}")
    return starts, end


def _gathered(data: NDArray[np.uint8], at: NDArray[np.int64], element: PlyElement, order: str) -> Fields:
    """Return the single properties of rows that begin at `at` and have lists between them."""
    found: Fields = {}
    for words, kind in zip(element.properties, element.types(order), strict=True):
        values = data[at[:, None] + np.arange(kind.itemsize)].view(kind)[:, 0]
        at = at + kind.itemsize
        if words[0] == "list":
            at = at + values.astype(np.int64) * np.dtype(TYPE_CODES[words[2]]).itemsize
        else:
            found[words[-1]] = values
    return found
