"""Clouds of points: in and out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import EmptyError
from ..settings import CloudSettings
from .arrays import read_npy, read_npz, write_npy
from .atomic import check_output
from .delimited import read_obj, read_text, write_csv, write_xyz
from .dicom import is_dicom
from .dicom.structures import read_structure
from .e57 import read_e57
from .fields import AXES, IDS, flat_columns, point_set
from .finite import check_finite
from .las import read_las
from .meshes import MESH_READERS
from .pcd import read_pcd
from .ply import write_ply
from .ply_vertices import read_ply
from .signature import signature
from .source import existing_file, reader_of, suffix_of, whole
from .vtp import write_vtp_points
from .written import Written

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from ..model.points import PointSet
    from .fields import Cloud, Fields


def read_points(path: str | Path, *, settings: CloudSettings | None = None) -> PointSet:
    """Read a cloud.

    Parameters
    ----------
    path : path
        ``.ply`` (text or binary); ``.xyz``, ``.txt`` or ``.csv`` (the columns named x, y and z, else the first
        three); ``.npy`` with an (n, 3) array or named fields; ``.npz`` with ``points`` or the like; ``.pcd``;
        ``.las``, ``.laz`` and ``.e57`` (with the extra ``clouds``); or the vertices of ``.obj``, ``.off`` and
        ``.stl`` (its equal positions become one vertex); or a DICOM RT Structure Set, of which one structure's
        contours are taken.
    settings : CloudSettings, optional
        What to do where the file leaves a choice.

    Returns
    -------
    PointSet
        Positions as the file has them, in its own unit. What else it says of each point is in ``attributes``,
        colors as uint8 ``red``, ``green`` and ``blue``; normals are passed over. Files that `write_points` wrote
        bring back slices, neurons and kinds.

    Raises
    ------
    UnreadableError
        Where the file is missing or may not be read.
    FormatError
        For text, NaN, ragged rows (it names the row), a count that lies, unknown suffixes, and a format whose
        package is not installed.
    GeometryError
        Where a structure must be chosen, or its contours are no stack.
    EmptyError
        For a file without points.
    ResourceError
        For a file that would not fit into the memory.

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh import read_points
    >>> np.savetxt("cloud.csv", [[0, 0, 0, 7], [1, 0, 2, 8]], "%d", ",", header="x,y,z,intensity", comments="")
    >>> cloud = read_points("cloud.csv")
    >>> cloud.positions.tolist(), cloud.attributes["intensity"].tolist()
    ([[0.0, 0.0, 0.0], [1.0, 0.0, 2.0]], [7, 8])
    """
    path = existing_file(path)
    if suffix_of(path) not in POINT_READERS and is_dicom(path):
        return read_structure(path, settings or CloudSettings())
    positions, fields = reader_of(path, POINT_READERS)(path)
    if len(positions) == 0:
        raise EmptyError("the cloud has no points", file=str(path))
    check_finite(positions, "row", file=str(path))
    return point_set(positions, fields)


def _read_vertices(path: Path) -> Cloud:
    """Read the vertices of a mesh."""
    vertices, _ = reader_of(path, MESH_READERS)(whole(path), str(path))
    return vertices, {}


POINT_READERS: dict[str, Callable[[Path], Cloud]] = {
    ".ply": read_ply,
    ".xyz": read_text,
    ".txt": read_text,
    ".csv": read_text,
    ".npy": read_npy,
    ".npz": read_npz,
    ".pcd": read_pcd,
    ".las": read_las,
    ".laz": read_las,
    ".e57": read_e57,
    ".obj": read_obj,
    ".off": _read_vertices,
    ".stl": _read_vertices,
}
"""Suffix to reader."""


def write_points(points: PointSet, path: str | Path, *, unit: str = "mm", frame: str = "LPS") -> None:
    """Write a cloud.

    Parameters
    ----------
    points : PointSet
        Its coordinates are written as they are.
    path : path
        ``.ply`` keeps slice, neuron, kind and the attributes of each point, and so do ``.csv`` and ``.vtp``;
        ``.xyz`` and ``.npy`` keep positions.
    unit, frame : str
        What the coordinates are in: named in the file where its format can.

    Raises
    ------
    UsageError
        For a suffix that has no writer, and attributes that are no numbers.
    OutputError
        Where the file cannot be written.
    """
    check_output(path, POINT_WRITERS)
    POINT_WRITERS[suffix_of(path)](points, path, unit, frame)


def _write_ply(points: PointSet, path: str | Path, unit: str, frame: str) -> None:
    columns: Fields = dict(zip(AXES, np.asarray(points.positions, np.float64).T, strict=True))
    columns |= zip(IDS, (points.slices, points.neurons, points.kinds), strict=True)
    columns |= flat_columns(points.attributes, len(points), columns)
    write_ply(path, signature(unit, frame), columns)


def _write_vtp(points: PointSet, path: str | Path, unit: str, frame: str) -> None:
    write_vtp_points(points, path, Written(unit, frame, {}, {}))


POINT_WRITERS: dict[str, Callable[[PointSet, str | Path, str, str], None]] = {
    ".ply": _write_ply,
    ".xyz": write_xyz,
    ".csv": write_csv,
    ".npy": write_npy,
    ".vtp": _write_vtp,
}
"""Suffix to writer."""
