"""E57, the exchange format of terrestrial scans, through pye57."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ...model.columns import carried
from ..fields import side_by_side
from ..files.extras import required
from ..files.limits import require_rows
from ..files.source import third_party
from ..text import typed

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..fields import Cloud, Fields

CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
INVALID = ("cartesianInvalidState", "sphericalInvalidState")
E57_COLORS = ("colorRed", "colorGreen", "colorBlue")

POINTS_AT_ONCE = 1 << 17
"""Points read at a time, a megabyte a field: a count that lies is found before much is allocated."""


def read_e57(path: Path) -> Cloud:
    """Read the points of all scans, each at its own pose; points marked invalid are left out.

    Fields that only some scans have are dropped.
    """
    file = str(path)
    pye57 = required("pye57", file=file)
    with third_party("pye57", file), closing(pye57.libe57.ImageFile(file, "r")) as image:
        scans = image.root()["data3D"]
        clouds = [_read_scan(pye57, image, scans[number], file) for number in range(len(scans))]
    if not clouds:
        return np.empty((0, 3)), {}
    shared = set.intersection(*(set(fields) for _, fields in clouds))
    names = [name for name in clouds[0][1] if name in shared]
    positions = np.concatenate([positions for positions, _ in clouds])
    return positions, {name: np.concatenate([fields[name] for _, fields in clouds]) for name in names}


def _read_scan(pye57: Any, image: Any, scan: Any, file: str) -> Cloud:
    header = pye57.ScanHeader(scan)
    axes = next((axes for axes in (CARTESIAN, SPHERICAL) if set(axes) <= set(header.point_fields)), None)
    if axes is None:
        raise FormatError("a scan has no positions", file=file, expected="cartesian or spherical coordinates")
    wanted = [*axes, *E57_COLORS, "intensity", INVALID[axes == SPHERICAL]]
    columns = _columns(pye57, image, header, [name for name in wanted if name in header.point_fields])
    require_rows(header.point_count, len(columns[axes[0]]), "points", file=file)
    if (invalid := columns.pop(wanted[-1], None)) is not None:
        columns = {name: column[invalid == 0] for name, column in columns.items()}
    placed = side_by_side([columns.pop(axis) for axis in axes])
    local = placed if axes == CARTESIAN else pye57.utils.convert_spherical_to_cartesian(placed)
    return carried(local, header.rotation_matrix.T, header.translation), {
        name: _whole(column) for name, column in columns.items()
    }


def _columns(pye57: Any, image: Any, header: Any, names: list[str]) -> Fields:
    """Read fields of a scan, chunk after chunk."""
    buffers = pye57.libe57.VectorSourceDestBuffer()
    chunk = {name: np.empty(POINTS_AT_ONCE) for name in names}
    for name, array in chunk.items():
        buffers.append(pye57.libe57.SourceDestBuffer(image, name, array, POINTS_AT_ONCE, True, True))
    parts: list[Fields] = []
    with closing(header.points.reader(buffers)) as reader:
        while count := reader.read():
            parts.append({name: array[:count].copy() for name, array in chunk.items()})
    return {name: np.concatenate([np.empty(0), *(part[name] for part in parts)]) for name in names}


def _whole(column: NDArray[np.float64]) -> NDArray[Any]:
    """Return whole numbers, as colors are, in 16 bits, others in 32."""
    values = typed(column, np.dtype(np.uint16))
    return values if values.dtype.kind == "u" else column.astype(np.float32)
