"""A cloud from a file, by its suffix."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import EmptyError, FormatError, GeometryError, UsageError
from ...settings import CloudSettings
from ...settings.crop import CropSettings
from ..dicom import is_dicom
from ..fields import point_set
from ..files.source import existing, existing_file, reader_of, regular_files, suffix_of, whole
from ..finite import check_finite
from ..meshes.read import MESH_READERS
from ..meshes.vtp import read_vtp
from .arrays import read_npy, read_npz
from .copc import inside
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
    from .copc import Box

TILES = (".las", ".laz")
"""Suffixes of the files of a folder that are read as one cloud; ``.copc.laz`` is one of them."""
NONE_INSIDE = "no point of the cloud lies in the box"


def read_points(path: str | Path, *, settings: CloudSettings | None = None, roi: Box | None = None) -> PointSet:
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
    roi : tuple of six floats, optional
        Lowest and highest x, y and z of what is kept, in the cloud's own frame and unit, both included. Of LAS and LAZ
        files, tiles among them, no more is held than that, and of COPC files (``.copc.laz``) no more unpacked than the
        nodes that meet it.

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
        For a file without points, or without any in the box.
    UsageError
        For a box of a structure's contours, which are closed curves.
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
    roi = CropSettings(roi=roi).roi
    if Path(path).is_dir():
        return _read_tiles(existing(path), roi)
    path = existing_file(path)
    if suffix_of(path) not in POINT_READERS and is_dicom(path):
        from ..dicom.objects.structures import read_structure  # its columns of contours load SciPy and the kernels

        if roi is not None:
            raise UsageError("contours are not cut to a box", file=str(path), found="--roi", hint="--structure")
        return read_structure(path, settings or CloudSettings())
    positions, fields = _within(path, roi)
    if len(positions) == 0:
        raise EmptyError("the cloud has no points" if roi is None else NONE_INSIDE, file=str(path), found=_said(roi))
    check_finite(positions, "row", file=str(path))
    return replace(point_set(positions, fields), **frame_of_cloud(path))


def _within(path: Path, roi: Box | None) -> Cloud:
    """Read a file's points, or those in a box."""
    if suffix_of(path) in TILES:
        return read_las(path, roi)
    positions, fields = reader_of(path, POINT_READERS)(path)
    if roi is None:
        return positions, fields
    check_finite(positions, "row", file=str(path))
    kept = inside(positions, roi)
    return positions[kept], {name: values[kept] for name, values in fields.items()}


def _read_tiles(folder: Path, roi: Box | None) -> PointSet:
    """Read the tiles in a folder as one cloud; those without points are none."""
    files, _ = regular_files(folder)
    tiles = [path for path in files if suffix_of(path) in TILES]
    if not tiles:
        raise FormatError(
            "the path is a folder", file=str(folder), expected="a file, or a folder of .las or .laz tiles"
        )
    clouds = [cloud for cloud in (_tile(path, roi) for path in tiles) if cloud is not None]
    if not clouds:
        told = "the tiles have no points" if roi is None else NONE_INSIDE
        raise EmptyError(told, file=str(folder), found=", ".join(filter(None, [f"{len(tiles)} file(s)", _said(roi)])))
    units = {str(cloud.unit) for cloud in clouds}
    if len(units) > 1:
        raise GeometryError(
            "the tiles are not of one cloud", file=str(folder), found=f"units = {', '.join(sorted(units))}",
            expected="one coordinate system",
        )  # fmt: skip
    told = f"{len(clouds)} tiles of {len(files)} files in the folder were read as one cloud"
    return replace(clouds[0].joined(*clouds[1:]), notes=(told,))


def _tile(path: Path, roi: Box | None) -> PointSet | None:
    try:
        return read_points(path, roi=roi)
    except EmptyError:
        return None


def _said(roi: Box | None) -> str:
    return "" if roi is None else f"--roi = {' '.join(f'{side:.10g}' for side in roi)}"


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
    **dict.fromkeys(TILES, read_las),
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
