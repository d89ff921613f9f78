"""Parts of COPC files, which are LAZ files in the order of an octree (copc.io, 1.0)."""

from __future__ import annotations

from typing import IO, TYPE_CHECKING, Any

import numpy as np

from ..files.extras import required

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    Box = tuple[float, ...]

ENTRY = np.dtype([("level", "<i4"), ("place", "<i4", 3), ("offset", "<u8"), ("size", "<i4"), ("count", "<i4")])
"""A node: its level, its place among the cubes of that level, and where its chunk of points is, how long, and how
many; with `PAGE` of them, where more entries are."""
PAGE = -1
OWN = ("copc", 1)
"""Whose record says where the octree is, and its number."""
CHUNKS = 8
"""Bytes before the first chunk of a LAZ file."""


def nodes_meeting(path: Path, header: Any, box: Box) -> NDArray[Any] | None:
    """Find the nodes of a COPC file whose points may lie in a box, in the order of the file.

    Parameters
    ----------
    path : Path
        A LAS or LAZ file.
    header : laspy.LasHeader
        Its header.
    box : tuple of six floats
        Lowest and highest x, y and z in the file's own units.

    Returns
    -------
    (n,) array of `ENTRY`, or None
        None where the file has no octree, or one that does not lead to all points.

    Raises
    ------
    IndexError, OSError, ValueError
        Where the octree makes no sense.
    """
    info = next((record for record in header.vlrs if (record.user_id, record.record_id) == OWN), None)
    if info is None:
        return None
    nodes = _nodes(path, info)
    return nodes[_meets(nodes, info, header, box)] if _are_all(nodes, header) else None


def unpacked(path: Path, header: Any, nodes: NDArray[Any], *, at_once: int) -> Iterator[Any]:
    """Read the points of nodes, the fewest nodes at a time that have so many.

    They are not reached by `seek`, for lazrs comes to other points where chunks differ in length.

    Yields
    ------
    laspy.ScaleAwarePointRecord
    """
    laspy, lazrs = (required(package, file=str(path)) for package in ("laspy", "lazrs"))
    parts = np.cumsum(nodes["count"], dtype=np.int64) // at_once
    record, fields = header.vlrs.get("LasZipVlr")[0].record_data, laspy.DecompressionSelection.all().to_lazrs()
    with path.open("rb") as file:
        for own in np.split(nodes, np.flatnonzero(np.diff(parts)) + 1):
            packed = b"".join(_bytes(file, int(one["offset"]), int(one["size"])) for one in own)
            rows = np.zeros(own["count"].sum(dtype=np.int64), header.point_format.dtype())
            table = [(int(one["count"]), int(one["size"])) for one in own]
            lazrs.decompress_points_with_chunk_table(packed, record, rows.view(np.uint8), table, fields)
            yield laspy.ScaleAwarePointRecord(rows, header.point_format, header.scales, header.offsets)


def apart(header: Any, box: Box) -> bool:
    """Tell whether the bounds that a header states, where it states any, lie beside a box by more than a step."""
    low, high = header.mins - header.scales, header.maxs + header.scales
    stated = np.any(header.mins < header.maxs)
    return bool(stated and np.any((high < box[::2]) | (np.array(box[1::2]) < low)))


def inside(positions: NDArray[np.float64], box: Box) -> NDArray[np.bool_]:
    """Tell which points (n, 3) lie in a box, its sides included."""
    found = np.ones(len(positions), bool)
    for axis, (low, high) in enumerate(zip(box[::2], box[1::2], strict=True)):
        found &= (low <= positions[:, axis]) & (positions[:, axis] <= high)
    return found


def _nodes(path: Path, info: Any) -> NDArray[Any]:
    """Return the nodes with points in the order of their chunks; every page of entries is read once."""
    left, pages = path.stat().st_size, [(info.hierarchy_root_offset, info.hierarchy_root_size)]
    found = [np.empty(0, ENTRY)]
    with path.open("rb") as file:
        while pages:
            offset, size = pages.pop()
            left -= size
            if not 0 < size <= left + size:  # pages that lead to one another would be read for ever
                raise ValueError(size)
            entries = np.frombuffer(_bytes(file, int(offset), int(size)), ENTRY)
            found.append(entries[entries["count"] > 0])
            pages += [(one["offset"], int(one["size"])) for one in entries[entries["count"] == PAGE]]
    nodes = np.concatenate(found)
    return nodes[np.argsort(nodes["offset"], kind="stable")]


def _bytes(file: IO[bytes], offset: int, size: int) -> bytes:
    file.seek(offset)
    return file.read(size)


def _are_all(nodes: NDArray[Any], header: Any) -> bool:
    """Tell whether the nodes' chunks are all that there are, one behind the other: else a count says no place."""
    ends = nodes["offset"] + nodes["size"].astype(np.uint64)
    begins = np.append(header.offset_to_point_data + CHUNKS, ends[:-1])
    return bool(np.array_equal(nodes["offset"], begins) and nodes["count"].sum(dtype=np.int64) == header.point_count)


def _meets(nodes: NDArray[Any], info: Any, header: Any, box: Box) -> NDArray[np.bool_]:
    """Tell which nodes' cubes meet a box that is a step larger: coordinates are rounded to steps."""
    sides = np.ldexp(2 * info.halfsize, -nodes["level"])[:, None]
    low = info.center - info.halfsize + nodes["place"] * sides - header.scales
    return np.asarray(np.all((low <= box[1::2]) & (box[::2] <= low + sides + 2 * header.scales), axis=1))
