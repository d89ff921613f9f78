"""The vertices of PLY files, text and binary."""

from __future__ import annotations

import struct
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

    from ..fields import Cloud, Fields
    from ..meshes.ply import PlyElement, PlyHeader


def read_ply(path: Path) -> Cloud:
    """Read the vertices of a PLY file with all their properties.

    Raises
    ------
    FormatError
        For a broken header, rows that lie, and vertices without positions or with lists.
    """
    data, file = whole(path), str(path)
    header = parse_header(data, file=file)
    before, vertex = header.before("vertex")
    if vertex.count == 0:
        return np.empty((0, 3)), {}
    if not set(AXES) <= set(vertex.names) or vertex.has_lists or len(set(vertex.names)) < len(vertex.names):
        raise FormatError("the vertices have no positions", file=file, expected="single properties x, y and z")
    read = _text_rows if header.format == "ascii" else _binary_rows
    return split_fields(read(data, header, before, vertex, file), file=file)


def _text_rows(data: bytes, header: PlyHeader, before: tuple[PlyElement, ...], vertex: PlyElement, file: str) -> Fields:
    first = sum(element.count for element in before)
    lines = data[header.length :].decode("ascii", "replace").splitlines()[first : first + vertex.count]
    rows = parse_rows(
        lines,
        required=[vertex.names.index(axis) for axis in AXES],
        file=file,
        before=data[: header.length].count(b"\n") + first,
        width=len(vertex.names),
    )
    require_rows(vertex.count, len(rows), "vertices", file=file)
    columns = zip(vertex.names, vertex.types(""), rows.T, strict=True)
    return {name: column if name in AXES else typed(column, kind) for name, kind, column in columns}


def _binary_rows(
    data: bytes, header: PlyHeader, before: tuple[PlyElement, ...], vertex: PlyElement, file: str
) -> Fields:
    order, start = BYTE_ORDERS[header.format], header.length
    try:
        for element in before:
            start = _end(data, start, element, order)
    except (struct.error, KeyError, IndexError, ValueError, OverflowError):
        raise FormatError("the lists before the vertices are broken", file=file) from None
    kind = np.dtype(list(zip(vertex.names, vertex.types(order), strict=True)))
    require_bytes(vertex.count * kind.itemsize, len(data) - start, file=file)
    rows = np.frombuffer(data, kind, vertex.count, start)
    return {name: rows[name] for name in vertex.names}


def _end(data: bytes, start: int, element: PlyElement, order: str) -> int:
    """Return where the rows of an element end that begin at `start`."""
    types = element.types(order)
    if not element.has_lists:
        return start + element.count * sum(kind.itemsize for kind in types)
    words = element.properties
    items = [np.dtype(TYPE_CODES[one[2]]).itemsize if one[0] == "list" else 0 for one in words]
    lengths = [struct.Struct((order or "=") + kind.char) for kind in types]
    for _ in range(element.count):
        for length, item in zip(lengths, items, strict=True):
            listed = int(length.unpack_from(data, start)[0]) if item else 0
            if listed < 0:
                raise ValueError(listed)
            start += length.size + listed * item
    return start
