"""A triangle mesh from a file, by its suffix."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...errors import EmptyError, FormatError
from ...model.mesh import TriMesh
from ..files.source import existing_file, reader_of, whole
from ..finite import check_finite
from .cells import joined
from .encapsulated import read_encapsulated
from .gifti import read_gifti
from .glb import read_glb
from .obj import read_obj_mesh
from .off import read_off
from .ply_rows import read_ply_mesh
from .stl import read_stl
from .threemf import read_3mf
from .vtp import read_vtp_mesh

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from .cells import Arrays


def read_mesh(path: str | Path) -> TriMesh:
    """Read a triangle mesh.

    Parameters
    ----------
    path : path
        ``.stl`` and DICOM Encapsulated STL, ``.dcm`` (equal positions become one vertex), ``.ply``, ``.obj``, ``.off``,
        ``.vtp``, ``.3mf``, ``.glb`` or ``.gii``. Polygons are cut into triangles, and borders that lie on each other
        are joined.

    Raises
    ------
    UnreadableError
        Where the file is missing or may not be read.
    FormatError
        For broken files, vertices that are not finite, and unknown suffixes.
    EmptyError
        For a file without faces.

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh import TriMesh, read_mesh, write_mesh
    >>> corner = TriMesh(np.eye(4, 3, -1), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    >>> write_mesh(corner, "corner.off")
    >>> read_mesh("corner.off").faces.tolist() == corner.faces.tolist()
    True
    """
    path = existing_file(path)
    read, file = reader_of(path, MESH_READERS), str(path)
    vertices, faces = read(whole(path), file)
    if len(faces) == 0:
        raise EmptyError("the mesh has no faces", file=file)
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise FormatError(
            "a face names a vertex that there is not",
            file=file,
            found=f"vertex numbers = {faces.min()} to {faces.max()}",
            expected=f"0 to {len(vertices) - 1}",
        )
    check_finite(vertices, "vertex", file=file)
    return TriMesh(*joined(vertices, faces))


MESH_READERS: dict[str, Callable[[bytes, str], Arrays]] = {
    ".stl": read_stl,
    ".ply": read_ply_mesh,
    ".obj": read_obj_mesh,
    ".off": read_off,
    ".dcm": read_encapsulated,
    ".vtp": read_vtp_mesh,
    ".3mf": read_3mf,
    ".glb": read_glb,
    ".gii": read_gifti,
}
"""Suffix to reader of vertices and faces."""
