"""LAS and LAZ, the formats of airborne and mobile scans, through laspy."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ...model.units import MM
from ..fields import AXES, side_by_side
from ..files.extras import required
from ..files.limits import require_bytes, require_memory, require_rows
from ..files.source import first_bytes, third_party
from .copc import apart, inside, nodes_meeting, unpacked
from .laz import check_chunks

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from ..fields import Cloud, Fields
    from .copc import Box

CARRIED = ("intensity", "classification", "red", "green", "blue", "nir")
"""What is taken of a point beside its position and the file's own extra dimensions; the rest is the scan's."""

HEAD = struct.Struct("<4s90xHII")
"""The beginning of a header: its mark, its own bytes, those up to the points, and how many records are between."""

RECORD_BYTES = 54
"""Least bytes of one of those records: their headers (LAS 1.4, variable length records)."""

PROJECTION, SYSTEMS = "LASF_Projection", (2112, 34735)
"""Who the records of the coordinate system are of, and their numbers: as text (WKT), and as keys of GeoTIFF."""

UNITS = {round(MM[name] / MM["m"], 9): name for name in ("m", "ft", "us-ft")}
"""Meters to the names of units."""

POINTS_AT_ONCE = 1 << 18
"""Points read at a time, at most 17 MB of them: a count that lies is found before much is allocated."""


def read_las(path: Path, box: Box | None = None) -> Cloud:
    """Read a LAS or LAZ file of any version and point format that laspy knows, or what of it lies in a box.

    Heights in another unit than the other two are brought to theirs. Of a COPC file what lies beside the box is not
    unpacked, nor is a file whose header says that all of it does.
    """
    file = str(path)
    _check_head(path)
    laspy = required("laspy", file=file)
    if path.suffix.lower() == ".laz":
        required("lazrs", file=file)
    with (
        third_party("laspy", file),
        # one thread: the parallel decoder takes memory for whatever a chunk's entry in their table says
        laspy.open(path, read_evlrs=False, laz_backend=laspy.LazBackend.Lazrs) as reader,
    ):
        heights = _meters(reader.header, file)[1]
        names = [name for name in reader.header.point_format.dimension_names if name in CARRIED]
        names += reader.header.point_format.extra_dimension_names
        _check_promises(path, reader.header)
        if box is None:
            require_memory(reader.header.point_count * reader.header.point_format.size, file=file)
            chunks = (_columns(chunk, names, heights) for chunk in reader.chunk_iterator(POINTS_AT_ONCE))
            columns = _filled(chunks, reader.header.point_count, file)
        else:
            near = _near(path, reader, (*box[:4], box[4] / heights, box[5] / heights))
            columns = _joined([_part(_columns(chunk, names, heights), box) for chunk in near])
    return columns.pop("", np.empty((0, 3))), columns


def las_frame(path: Path) -> dict[str, Any]:
    """Return the unit of the coordinate system that a LAS or LAZ file names; None where it names none."""
    file = str(path)
    with third_party("laspy", file), required("laspy", file=file).open(path, read_evlrs=False) as reader:
        return {"unit": _meters(reader.header, file)[0]}


def _meters(header: Any, file: str) -> tuple[str | None, float]:
    """Return the unit of the first two axes, and how many of them a unit of height is."""
    if not any(record.user_id == PROJECTION and record.record_id in SYSTEMS for record in header.vlrs):
        return None, 1.0
    required("pyproj", file=file)
    system = header.parse_crs()
    axes = [] if system is None else system.axis_info
    if not axes:
        return None, 1.0
    unit = UNITS.get(round(axes[0].unit_conversion_factor, 9), axes[0].unit_name)
    heights = axes[2].unit_conversion_factor / axes[0].unit_conversion_factor if len(axes) > 2 else 1.0
    return unit, heights if unit in UNITS.values() else 1.0


def _check_head(path: Path) -> None:
    """Compare the sizes of what stands before the points with the file; laspy believes them."""
    head = first_bytes(path, HEAD.size)
    require_bytes(HEAD.size, len(head), file=str(path))
    mark, size, start, records = HEAD.unpack(head)
    if mark != b"LASF" or size + records * RECORD_BYTES > start:
        raise FormatError("the LAS header cannot be understood", file=str(path))
    require_bytes(start, path.stat().st_size, file=str(path))


def _check_promises(path: Path, header: Any) -> None:
    """Compare the count of points with the file's bytes, where compressed that of the chunks."""
    if header.are_points_compressed:
        check_chunks(path, header)
    else:
        end = header.offset_to_point_data + header.point_count * header.point_format.size
        require_bytes(end, path.stat().st_size, file=str(path))


def _near(path: Path, reader: Any, box: Box) -> Iterator[Any]:
    """Read the points that may lie in a box: those of the nodes that meet it, else all or none."""
    if apart(reader.header, box):
        return iter(())
    nodes = nodes_meeting(path, reader.header, box)
    if nodes is None:
        return iter(reader.chunk_iterator(POINTS_AT_ONCE))
    require_memory(int(nodes["count"].sum(dtype=np.int64)) * reader.header.point_format.size, file=str(path))
    return unpacked(path, reader.header, nodes, at_once=POINTS_AT_ONCE)


def _columns(chunk: Any, names: list[str], heights: float) -> Fields:
    """Return a chunk's positions, under the empty name, and its fields."""
    positions = side_by_side([chunk[axis].scaled_array() for axis in AXES])
    positions[:, 2] *= heights
    return {"": positions, **{name: np.array(chunk[name]) for name in names}}


def _part(columns: Fields, box: Box) -> Fields:
    kept = inside(columns[""], box)
    return {name: values[kept] for name, values in columns.items()}


def _filled(chunks: Iterable[Fields], count: int, file: str) -> Fields:
    """Put chunks one behind the other, in columns of so many rows: they are there once."""
    columns: Fields = {}
    done = 0
    for chunk in chunks:
        columns = columns or {
            name: np.empty((count, *values.shape[1:]), values.dtype) for name, values in chunk.items()
        }
        for name, values in chunk.items():
            columns[name][done : done + len(values)] = values
        done += len(chunk[""])
    require_rows(count, done, "points", file=file)
    return columns


def _joined(chunks: list[Fields]) -> Fields:
    """Put chunks one behind the other whose rows were not known before."""
    return {name: np.concatenate([chunk[name] for chunk in chunks]) for name in (chunks[0] if chunks else ())}
