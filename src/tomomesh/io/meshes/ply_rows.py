"""The rows of a PLY file's elements, text and binary, with their lists, and the mesh that they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ..fields import AXES
from ..files.limits import require_bytes, require_rows
from .cells import fans, strips
from .ply import BYTE_ORDERS, TYPE_CODES, parse_header

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..fields import Fields
    from .cells import Arrays
    from .ply import PlyElement, PlyHeader

    Lists = dict[str, tuple[NDArray[Any], NDArray[np.int64]]]
    """By their names: all entries, one row's after the other's, and how many each row has."""


CORNERS = ("vertex_indices", "vertex_index")
"""Names of the list of a face's corners."""


def read_ply_mesh(data: bytes, file: str) -> Arrays:
    """Read vertices, and faces cut into triangles, whatever other elements, properties and lists stand beside them.

    Raises
    ------
    FormatError
        For a broken header, rows that lie, vertices without positions, and faces of less than three corners.
    """
    header = parse_header(data, file=file)
    single, _ = rows_of(data, header, "vertex", file)
    if not set(AXES) <= set(single):
        raise FormatError("the vertices have no positions", file=file, expected="single properties x, y and z")
    vertices = np.stack([single[axis] for axis in AXES], axis=1).astype(np.float64)
    faces = [np.empty((0, 3), np.int64)]
    for element, cut in (("face", fans), ("tristrips", strips)):
        lists = rows_of(data, header, element, file)[1]
        name = next((name for name in CORNERS if name in lists), "")
        if name:
            corners, sizes = lists[name]
            with np.errstate(invalid="ignore"):
                numbers = corners.astype(np.int64)
            if (sizes < 3).any() or not np.array_equal(numbers, corners):
                raise FormatError("a face cannot be understood", file=file, expected="three vertices or more")
            faces.append(cut(numbers, sizes))
    return vertices, np.concatenate(faces)


def rows_of(data: bytes | memoryview, header: PlyHeader, name: str, file: str) -> tuple[Fields, Lists]:
    """Return the single properties of an element, and its lists; none where there is no such element.

    Raises
    ------
    FormatError
        For a file that is cut off, and lists that lie.
    """
    before, element = header.before(name)
    if element.count == 0 or not element.properties:
        return {}, {}
    if len(set(element.names)) < len(element.names):
        raise FormatError("two properties have one name", file=file, found=f"element = {name}")
    if header.format == "ascii":
        return _of_text(bytes(data), header, sum(one.count for one in before), element, file)
    order, start = BYTE_ORDERS[header.format], start_of(data, header, before, file)
    block = _block(data, start, element, order)
    if block is not None:
        return _of_block(block, element)
    starts, _ = row_places(data, start, element, order, file)
    items = [np.dtype(order + TYPE_CODES[words[2]]) if words[0] == "list" else None for words in element.properties]
    return gathered(np.frombuffer(data, np.uint8), starts, element.names, element.types(order), items)


def start_of(data: bytes | memoryview, header: PlyHeader, before: tuple[PlyElement, ...], file: str) -> int:
    """Return where the rows behind some elements of a binary file begin."""
    order, start = BYTE_ORDERS[header.format], header.length
    for element in before:
        has_lists, length = element.has_lists, element.least_bytes(False)
        start = row_places(data, start, element, order, file)[1] if has_lists else start + length
    return start


def row_places(
    data: bytes | memoryview, start: int, element: PlyElement, order: str, file: str
) -> tuple[NDArray[np.int64], int]:
    """Return where the rows of an element begin, the first at `start`, and where they end.

    Raises
    ------
    FormatError
        For lists that cannot be understood, or go beyond the file.
    """
    kinds = element.types(order)
    try:
        items = [np.dtype(TYPE_CODES[words[2]]).itemsize if words[0] == "list" else 0 for words in element.properties]
        if any(kind.kind == "f" for kind, item in zip(kinds, items, strict=True) if item):
            raise ValueError(kinds)
    except (KeyError, IndexError, ValueError):
        raise FormatError("the lists cannot be understood", file=file, expected="whole numbers as lengths") from None
    return _stepped(np.frombuffer(data, np.uint8), start, kinds, items, order == ">", element, file)


def _stepped(
    data: NDArray[np.uint8], start: int, kinds: list[np.dtype[Any]], items: list[int], big: bool, element: PlyElement,
    file: str,
) -> tuple[NDArray[np.int64], int]:  # fmt: skip
    from ...kernels.files.rows import row_starts

    starts = np.empty(element.count, np.int64)
    sizes, signed = np.array([kind.itemsize for kind in kinds]), np.array([kind.kind == "i" for kind in kinds])
    end = row_starts(np.array(data), start, sizes, np.array(items), signed, big, starts)
    if end < 0:
        raise FormatError("the lists are broken, or the file is cut off", file=file, found=f"element = {element.name}")
    return starts, end


def _block(data: bytes | memoryview, start: int, element: PlyElement, order: str) -> NDArray[Any] | None:
    """Return the rows as one array where each list is as long in all of them; None where they differ."""
    kinds: list[tuple[Any, ...]] = []
    for words, kind in zip(element.properties, element.types(order), strict=True):
        kinds.append((f"n {words[-1]}" if words[0] == "list" else words[-1], kind))
        if words[0] == "list":
            at = start + np.dtype(kinds).itemsize - kind.itemsize
            if at + kind.itemsize > len(data) or kind.kind == "f" or len(words) < 4 or words[2] not in TYPE_CODES:
                return None
            length = int(np.frombuffer(data, kind, 1, at)[0])
            if not 0 <= length * np.dtype(TYPE_CODES[words[2]]).itemsize <= len(data):
                return None
            kinds.append((words[-1], order + TYPE_CODES[words[2]], (length,)))
    size = np.dtype(kinds).itemsize
    if start + element.count * size > len(data):
        return None
    rows = np.frombuffer(data, np.dtype(kinds), element.count, start)
    return rows if all((rows[one[0]] == rows[one[0]][0]).all() for one in kinds if one[0].startswith("n ")) else None


def _of_block(rows: NDArray[Any], element: PlyElement) -> tuple[Fields, Lists]:
    lists: Lists = {}
    for words in element.properties:
        if words[0] == "list":
            lists[words[-1]] = rows[words[-1]].reshape(-1), np.full(len(rows), rows[words[-1]].shape[1], np.int64)
    return {words[-1]: rows[words[-1]] for words in element.properties if words[0] != "list"}, lists


def gathered(
    data: NDArray[np.uint8], at: NDArray[np.int64], names: list[str], kinds: list[np.dtype[Any]],
    items: list[np.dtype[Any] | None],
) -> tuple[Fields, Lists]:  # fmt: skip
    """Return the single properties and the lists of rows that begin at `at`, the n-th with entries of ``items[n]``."""
    found: Fields = {}
    lists: Lists = {}
    for name, kind, item in zip(names, kinds, items, strict=True):
        values, at = _taken(data, at, kind), at + kind.itemsize
        if item is None:
            found[name] = values
            continue
        sizes = values.astype(np.int64)
        within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        lists[name] = _taken(data, np.repeat(at, sizes) + within * item.itemsize, item), sizes
        at = at + sizes * item.itemsize
    return found, lists


def _taken(data: NDArray[np.uint8], at: NDArray[np.int64], kind: np.dtype[Any]) -> NDArray[Any]:
    return np.asarray(data[at[:, None] + np.arange(kind.itemsize)].view(kind)[:, 0])


def _of_text(
    data: bytes, header: PlyHeader, first: int, element: PlyElement, file: str
) -> tuple[Fields, Lists]:  # fmt: skip
    """Read the numbers of all rows as doubles, and then as those of a binary file."""
    lines = data[header.length :].splitlines()[first : first + element.count]
    require_rows(element.count, len(lines), element.name, file=file)
    try:
        numbers = np.array(b" ".join(lines).split(), np.float64)
    except ValueError:
        raise FormatError("a row cannot be understood", file=file, found=f"element = {element.name}") from None
    whole, double = np.dtype("<i8"), np.dtype("<f8")
    with np.errstate(invalid="ignore"):  # of what is no whole number, lengths are refused
        lengths = numbers.astype(whole).view(np.uint8)
    items = [double if words[0] == "list" else None for words in element.properties]
    sizes = [8 if item else 0 for item in items]
    starts, end = _stepped(lengths, 0, [whole] * len(items), sizes, False, element, file)
    require_bytes(8 * len(numbers), end, file=file)
    return gathered(numbers.astype(double).view(np.uint8), starts, element.names, [double] * len(items), items)
