"""A cloud from a file, by its suffix."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import EmptyError, FormatError, GeometryError
from ...settings import CloudSettings
from ..dicom import is_dicom
from ..fields import point_set
from ..files.source import existing, existing_file, reader_of, regular_files, suffix_of, whole
from ..finite import check_finite
from ..meshes.read import MESH_READERS
from ..meshes.vtp import read_vtp
from .arrays import read_npy, read_npz
from .delimited import read_obj, read_text
from .e57 import read_e57
from .frame import frame_of_cloud
from .las import read_las
from .leica import read_pts, read_ptx
from .pcd import read_pcd
from .ply_vertices import read_ply

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...model.points import PointSet
    from ..fields import Cloud

TILES = (".las", ".laz")
"""Suffixes of the files of a folder that are read as one cloud; ``.copc.laz`` is one of them."""


def read_points(path: str | Path, *, settings: CloudSettings | None = None) -> PointSet:
    """Read a cloud.

    Parameters
    ----------
    path : path
        ``.ply`` (text or binary) and ``.vtp``; ``.xyz``, ``.xyzn``, ``.xyzrgb``, ``.asc``, ``.txt``, ``.csv`` or
        ``.tsv`` (the columns named x, y and z or the like, else the first three; a count may come first); ``.pts`` and
        ``.ptx``; ``.npy`` with an (n, 3) array or named fields; ``.npz`` with ``points`` or the like; ``.pcd``;
        ``.las``, ``.laz`` and ``.e57`` (with the extra ``clouds``, which compressed ``.pcd`` needs too); or the
        vertices of ``.obj``, ``.off``, ``.3mf``, ``.glb``, ``.gii`` and ``.stl`` (its equal positions become
        one vertex); or a DICOM RT Structure Set, of which one structure's contours are taken; or a folder of ``.las``
        and ``.laz`` tiles of one cloud.
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
        Where a structure must be chosen, or its contours are no stack; where tiles are in several units.
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
    if Path(path).is_dir():
        return _read_tiles(existing(path))
    path = existing_file(path)
    if suffix_of(path) not in POINT_READERS and is_dicom(path):
        from ..dicom.objects.structures import read_structure  # its columns of contours load SciPy and the kernels

        return read_structure(path, settings or CloudSettings())
    positions, fields = reader_of(path, POINT_READERS)(path)
    if len(positions) == 0:
        raise EmptyError("the cloud has no points", file=str(path))
    check_finite(positions, "row", file=str(path))
    return replace(point_set(positions, fields), **frame_of_cloud(path))


def _read_tiles(folder: Path) -> PointSet:
    """Read the tiles in a folder as one cloud; those without points are none."""
    files, _ = regular_files(folder)
    tiles = [path for path in files if suffix_of(path) in TILES]
    if not tiles:
        raise FormatError(
            "the path is a folder", file=str(folder), expected="a file, or a folder of .las or .laz tiles"
        )
    clouds = [cloud for cloud in map(_tile, tiles) if cloud is not None]
    if not clouds:
        raise EmptyError("the tiles have no points", file=str(folder), found=f"{len(tiles)} file(s)")
    units = {str(cloud.unit) for cloud in clouds}
    if len(units) > 1:
        raise GeometryError(
            "the tiles are not of one cloud", file=str(folder), found=f"units = {', '.join(sorted(units))}",
            expected="one coordinate system",
        )  # fmt: skip
    told = f"{len(clouds)} tiles of {len(files)} files in the folder were read as one cloud"
    return replace(clouds[0].joined(*clouds[1:]), notes=(told,))


def _tile(path: Path) -> PointSet | None:
    try:
        return read_points(path)
    except EmptyError:
        return None


def _read_vertices(path: Path) -> Cloud:
    """Read the vertices of a mesh."""
    vertices, _ = reader_of(path, MESH_READERS)(whole(path), str(path))
    return vertices, {}


POINT_READERS: dict[str, Callable[[Path], Cloud]] = {
    ".ply": read_ply,
    ".xyz": read_text,
    ".txt": read_text,
    ".csv": read_text,
    ".tsv": read_text,
    ".npy": read_npy,
    ".npz": read_npz,
    ".pcd": read_pcd,
    ".las": read_las,
    ".laz": read_las,
    ".e57": read_e57,
    ".obj": read_obj,
    ".off": _read_vertices,
    ".stl": _read_vertices,
    ".3mf": _read_vertices,
    ".glb": _read_vertices,
    ".gii": _read_vertices,
    ".vtp": read_vtp,
    ".asc": read_text,
    ".xyzn": read_text,
    ".xyzrgb": read_text,
    ".pts": read_pts,
    ".ptx": read_ptx,
}
"""Suffix to reader."""
