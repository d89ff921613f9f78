"""PCD, the Point Cloud Library's format: text, binary, and through pypcd4 binary compressed."""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ..colors import packed_colors
from ..fields import AXES, split_fields
from ..files.extras import required
from ..files.limits import require_bytes, require_memory, require_rows
from ..files.source import third_party, whole
from ..text import parse_rows, typed

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..fields import Cloud, Fields

PADDING = "_"
"""The name of fields that hold nothing."""

LZF_RATIO = 88
"""No LZF stream holds more than this many times its own bytes: its longest copy, 264 bytes, takes three."""


@dataclass(frozen=True)
class PcdHeader:
    """What a PCD file promises.

    Attributes
    ----------
    fields : tuple of (str, dtype)
        Name and type of each field; the type has a length where a point has several values.
    count : int
        Points.
    organized : bool
        Whether they are the pixels of a range image, where NaN means that nothing was measured.
    data : str
        ``ascii``, ``binary`` or ``binary_compressed``.
    length, lines : int
        Bytes and lines up to the first point.
    """

    fields: tuple[tuple[str, np.dtype[Any]], ...]
    count: int
    organized: bool
    data: str
    length: int
    lines: int

    @property
    def starts(self) -> list[int]:
        """The first column of each field in a text, and the number of columns last."""
        return [0, *accumulate(math.prod(kind.shape) for _, kind in self.fields)]

    @property
    def numbered(self) -> bytes:
        """The header that pypcd4 is given: it cuts names short, and draws some for padding, so each is a number."""
        kinds = [kind for _, kind in self.fields]
        rows = {
            "VERSION": [".7"],
            "FIELDS": range(len(kinds)),
            "SIZE": [kind.base.itemsize for kind in kinds],
            "TYPE": [kind.base.kind.upper() for kind in kinds],
            "COUNT": [math.prod(kind.shape) for kind in kinds],
            "WIDTH": [self.count],
            "POINTS": [self.count],
            "DATA": [self.data],
        }
        return "".join(f"{word} {' '.join(map(str, values))}\n" for word, values in rows.items()).encode("ascii")

    @property
    def promised(self) -> int:
        """Bytes of the points where they are binary."""
        return self.count * sum(kind.itemsize for _, kind in self.fields)


def read_pcd(path: Path) -> Cloud:
    """Read a PCD file; packed colors are taken apart, and the holes of a range image are left out."""
    data, file = whole(path), str(path)
    header = _header(data, file)
    columns = {name: column for name, column in READERS[header.data](data, header, file).items() if name != PADDING}
    if header.organized:
        measured = ~np.all([np.isnan(columns[axis]) for axis in AXES], axis=0)
        columns = {name: column[measured] for name, column in columns.items()}
    return split_fields(_unpacked(columns), file=file)


def _header(data: bytes, file: str) -> PcdHeader:
    """Read the header.

    Raises
    ------
    FormatError
        Where it is none, or has no positions.
    """
    start = data.find(b"\nDATA ") + 1
    length = data.find(b"\n", start) + 1
    lines = [line.split() for line in data[:length].decode("ascii", "replace").splitlines()]
    words = {line[0]: line[1:] for line in lines if line}
    try:
        if start == 0 or length == 0 or words["DATA"][0] not in READERS:
            raise ValueError(length)
        width, height = (int(words[name][0]) for name in ("WIDTH", "HEIGHT"))
        count = int(words["POINTS"][0]) if "POINTS" in words else width * height
        if count < 0 or count != width * height:
            raise ValueError(count)
        header = PcdHeader(_fields(words), count, height > 1, words["DATA"][0], length, len(lines))
    except (KeyError, IndexError, ValueError, TypeError):
        raise FormatError("the PCD header cannot be understood", file=file) from None
    if not set(AXES) <= {name for name, kind in header.fields if not kind.shape}:
        raise FormatError("the points have no positions", file=file, expected="fields x, y and z")
    return header


def _fields(words: dict[str, list[str]]) -> tuple[tuple[str, np.dtype[Any]], ...]:
    names, sizes, kinds = words["FIELDS"], words["SIZE"], words["TYPE"]
    counts = [int(word) for word in words.get("COUNT", ["1"] * len(names))]
    named = [name for name in names if name != PADDING]
    if len(set(named)) < len(named) or any(count < 1 for count in counts) or not set(kinds) <= set("IUF"):
        raise ValueError(names)
    codes = [f"<{kind.lower()}{int(size)}" for kind, size in zip(kinds, sizes, strict=True)]
    types = [np.dtype((code, (count,)) if count > 1 else code) for code, count in zip(codes, counts, strict=True)]
    return tuple(zip(names, types, strict=True))


def _read_ascii(data: bytes, header: PcdHeader, file: str) -> Fields:
    *starts, width = header.starts
    require_bytes(2 * header.count * width - 1, len(data) - header.length, file=file)
    lines = data[header.length :].decode("ascii", "replace").splitlines()[: header.count]
    axes = [start for start, (name, _) in zip(starts, header.fields, strict=True) if name in AXES]
    required = [] if header.organized else axes
    rows = parse_rows(lines, required=required, file=file, before=header.lines, width=width)
    require_rows(header.count, len(rows), "points", file=file)
    columns: Fields = {}
    for start, (name, kind) in zip(starts, header.fields, strict=True):
        values = rows[:, start : start + math.prod(kind.shape)].reshape(-1, *kind.shape)
        columns[name] = values if name in AXES else typed(values, kind.base)
    return columns


def _read_binary(data: bytes, header: PcdHeader, file: str) -> Fields:
    """Read one point after the other."""
    require_bytes(header.promised, len(data) - header.length, file=file)
    numbered = [(f"{number}", kind.base, kind.shape) for number, (_, kind) in enumerate(header.fields)]
    rows = np.frombuffer(data, numbered, header.count, header.length)
    return {name: rows[f"{number}"] for number, (name, _) in enumerate(header.fields)}


def _read_compressed(data: bytes, header: PcdHeader, file: str) -> Fields:
    """Read one field after the other through pypcd4; of several values, those of a point are side by side."""
    _check_compressed(data, header, file)
    pypcd4 = required("pypcd4", file=file)
    with third_party("pypcd4", file):
        rows = pypcd4.PointCloud.from_fileobj(io.BytesIO(header.numbered + data[header.length :])).pc_data
    columns = iter(rows.dtype.names)
    found: Fields = {}
    for name, kind in header.fields:
        blocks = [rows[next(columns)] for _ in range(math.prod(kind.shape))]
        found[name] = np.concatenate(blocks).reshape(-1, *kind.shape)
    return found


def _check_compressed(data: bytes, header: PcdHeader, file: str) -> None:
    """Compare the two sizes in front of an LZF stream with the file, the header, what LZF can hold, and the memory."""
    require_bytes(8, len(data) - header.length, file=file)
    packed, size = (int(number) for number in np.frombuffer(data, "<u4", 2, header.length))
    require_bytes(packed, len(data) - header.length - 8, file=file)
    require_bytes(header.promised, size, file=file)
    require_bytes(size, packed * LZF_RATIO, file=file)
    require_memory(size, file=file)


READERS = {"ascii": _read_ascii, "binary": _read_binary, "binary_compressed": _read_compressed}
"""The words behind DATA to their readers."""


def _unpacked(columns: Fields) -> Fields:
    """Take packed colors apart, ``rgb`` and ``rgba``; a float's bits are the number."""
    found: dict[str, NDArray[Any]] = {}
    for name, column in columns.items():
        if name in ("rgb", "rgba") and column.ndim == 1 and column.dtype.itemsize == 4:
            found |= packed_colors(np.ascontiguousarray(column).view("<u4"), alpha=name == "rgba")
        else:
            found[name] = column
    return found
