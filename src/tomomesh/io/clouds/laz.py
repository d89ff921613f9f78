"""What a LAZ file promises, compared with its bytes: lazrs takes the memory before it reads."""

from __future__ import annotations

import os
import struct
from typing import IO, TYPE_CHECKING, Any

from ..files.limits import require_bytes, require_rows

if TYPE_CHECKING:
    from pathlib import Path

RECORD = struct.Struct("<H10xI")
"""The beginning of LASzip's record: the kind of compressor, and the points of a chunk, all ones where they vary."""

UNCHUNKED = 1
"""The compressor of the first LASzip, all points in one run."""

CHUNK_LAYERS = {6: 9, 7: 10, 8: 11, 9: 10, 10: 12}
"""Layers of a chunk for the point formats that have them (LASzip's format); each extra byte has one more."""


def check_chunks(path: Path, header: Any) -> None:
    """Refuse chunks that the file cannot hold.

    Parameters
    ----------
    path : Path
        The file.
    header : laspy.LasHeader
        Of a file whose points are compressed.

    Raises
    ------
    FormatError
        For more chunks than there can be, fewer than the points need, and layers that are longer than the file.
    IndexError, OSError, ValueError, struct.error
        Where the chunks make no sense.
    """
    size, start = path.stat().st_size, header.offset_to_point_data
    compressor, points_each = RECORD.unpack_from(header.vlrs.get("LasZipVlr")[0].record_data)
    if compressor == UNCHUNKED:
        return
    with path.open("rb") as file:
        count = _count(file, start)
        # every chunk begins with a point as it is
        require_bytes(count * header.point_format.size, size, file=str(path))
        require_rows(header.point_count, count * points_each, "points in its chunks", file=str(path))
        if header.point_format.id in CHUNK_LAYERS:
            _check_layers(file, start, header, size, str(path))


def _count(file: IO[bytes], start: int) -> int:
    """Return how many chunks the table promises that the first eight bytes lead to."""
    file.seek(start)
    table = int.from_bytes(file.read(8), "little", signed=True)
    if table <= start:  # a writer that could not go back names it in the last eight
        file.seek(-8, os.SEEK_END)
        table = int.from_bytes(file.read(8), "little", signed=True)
    file.seek(table + 4)  # behind its version
    return int.from_bytes(file.read(4), "little")


def _check_layers(file: IO[bytes], start: int, header: Any, size: int, name: str) -> None:
    """Step from chunk to chunk: a point, how many there are, the length of each layer, the layers."""
    layers = CHUNK_LAYERS[header.point_format.id] + header.point_format.num_extra_bytes
    head = struct.Struct(f"<{1 + layers}I")
    at, left = start + 8, header.point_count
    while left > 0:
        file.seek(at + header.point_format.size)
        count, *lengths = head.unpack(file.read(head.size))
        at += header.point_format.size + head.size + sum(lengths)
        require_bytes(at, size, file=name)
        if count == 0:
            raise ValueError(at)
        left -= count
