"""A cloud to a file, by its suffix."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..fields import AXES, IDS, flat_columns
from ..files.atomic import check_output
from ..files.source import suffix_of
from ..meshes.attributes import MeshAttributes, narrowed
from ..meshes.ply import write_ply
from ..meshes.vtp import write_vtp_points
from .arrays import write_npy
from .delimited import write_csv, write_xyz

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from ...model.points import PointSet
    from ..fields import Fields


def write_points(
    points: PointSet, path: str | Path, *, unit: str = "mm", frame: str = "LPS", precision: int = 64
) -> None:
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
    precision : {64, 32}
        Bits of the coordinates in PLY and VTP; 64 all the same where 32 would let points fall together.

    Raises
    ------
    UsageError
        For a suffix that has no writer, and attributes that are no numbers.
    OutputError
        Where the file cannot be written.
    """
    check_output(path, POINT_WRITERS)
    POINT_WRITERS[suffix_of(path)](points, path, MeshAttributes(unit, frame, {}, {}, single=precision == 32))


def _write_ply(points: PointSet, path: str | Path, beside: MeshAttributes) -> None:
    columns: Fields = dict(zip(AXES, narrowed(points.positions, beside).T, strict=True))
    columns |= zip(IDS, (points.slices, points.neurons, points.kinds), strict=True)
    columns |= flat_columns(points.attributes, len(points), columns)
    write_ply(path, beside.head, columns)


POINT_WRITERS: dict[str, Callable[[PointSet, str | Path, MeshAttributes], None]] = {
    ".ply": _write_ply,
    ".xyz": write_xyz,
    ".csv": write_csv,
    ".npy": write_npy,
    ".vtp": write_vtp_points,
}
"""Suffix to writer."""
