"""The vertices of PLY files, text and binary."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...errors import FormatError
from ..fields import AXES, split_fields
from ..files.limits import require_bytes, require_rows
from ..files.source import stored
from ..meshes.ply import BYTE_ORDERS, parse_header
from ..meshes.ply_rows import rows_of, start_of
from ..text import parse_rows, typed

if TYPE_CHECKING:
    from pathlib import Path

    from ..fields import Cloud, Fields
    from ..meshes.ply import PlyElement, PlyHeader

HEADER = 1 << 20
"""Bytes in which headers end, but for very long comments: then the whole file is searched."""


def read_ply(path: Path) -> Cloud:
    """Read the vertices of a PLY file with all their properties but lists, as multi-view stereo adds to them.

    Raises
    ------
    FormatError
        For a broken header, rows that lie, and vertices without positions.
    """
    data, file = stored(path), str(path)
    begin = bytes(data[:HEADER])
    begin = begin if b"end_header" in begin[: HEADER - 2] else bytes(data)  # and the end of its line
    return _vertices_of(data, parse_header(begin, file=file, size=len(data)), file)


def _vertices_of(data: memoryview, header: PlyHeader, file: str) -> Cloud:
    before, vertex = header.before("vertex")
    if vertex.count == 0:
        return np.empty((0, 3)), {}
    single = [words[-1] for words in vertex.properties if words[0] != "list"]
    if not set(AXES) <= set(single) or len(set(vertex.names)) < len(vertex.names):
        raise FormatError("the vertices have no positions", file=file, expected="single properties x, y and z")
    if header.format == "ascii":
        return split_fields(_text_rows(bytes(data), header, before, vertex, file), file=file)
    return split_fields(_binary_rows(data, header, before, vertex, file), file=file)


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
    data: memoryview, header: PlyHeader, before: tuple[PlyElement, ...], vertex: PlyElement, file: str
) -> Fields:
    order, start = BYTE_ORDERS[header.format], start_of(data, header, before, file)
    if vertex.has_lists:
        return rows_of(data, header, vertex.name, file)[0]
    kind = np.dtype(list(zip(vertex.names, vertex.types(order), strict=True)))
    require_bytes(vertex.count * kind.itemsize, len(data) - start, file=file)
    rows = np.frombuffer(data, kind, vertex.count, start)
    return {name: rows[name] for name in vertex.names}
