"""A triangle mesh to a file, by its suffix."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...errors import UsageError
from ...model.mesh import TriMesh
from ...model.points import COLORS
from ..fields import AXES, flat_columns
from ..files.atomic import check_output
from ..files.source import suffix_of
from .attributes import MeshAttributes
from .gifti import is_bare, write_gifti
from .glb import write_glb
from .obj import obj_parts
from .off import write_off
from .pieces.parts import InOnePiece, write_parts
from .ply import ply_parts
from .stl import stl_parts
from .threemf import write_3mf
from .vtp import write_vtp_mesh

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from .pieces.parts import Parts


def write_mesh(
    mesh: TriMesh | Parts,
    path: str | Path,
    *,
    unit: str = "mm",
    frame: str = "LPS",
    vertex_fields: Mapping[str, NDArray[Any]] | None = None,
    face_fields: Mapping[str, NDArray[Any]] | None = None,
    z_up: bool = False,
    precision: int = 64,
    fits: bool | None = None,
) -> None:
    """Write a triangle mesh; the same mesh gives the same bytes.

    Parameters
    ----------
    mesh : TriMesh or Parts
        Its coordinates are written as they are. One that is never whole, `tomomesh.slabs.patches.patch.Patches`, is
        written part by part: as ``.ply``, ``.stl`` or ``.obj``.
    path : path
        ``.ply`` and ``.vtp`` (binary), ``.obj``, ``.off`` and ``.3mf`` (text) keep 64-bit coordinates; ``.stl``,
        ``.glb`` and ``.gii`` (binary; Connectome Workbench wants ``.surf.gii``) 32-bit ones, as do 3MF's readers.
    unit, frame : str
        What the coordinates are in, named in the file; OFF has no place for it.
    vertex_fields : mapping of str to (n,) or (n, c) array, optional
        Numbers at the vertices. PLY, VTP, GLB and GIFTI keep them all, OBJ and 3MF the colors (``red``, ``green`` and
        ``blue``), STL, OFF and ``.surf.gii`` none.
    face_fields : mapping of str to (m,) or (m, c) array, optional
        Numbers on the faces, kept by PLY and VTP.
    z_up : bool
        Whether z is up where the frame does not say so, as of a part to print: GLB has y up.
    precision : {64, 32}
        Bits of the coordinates in PLY and VTP; 64 all the same where 32 would let vertices fall together.
    fits : bool, optional
        Whether 32 do not, where that is known of the whole that this mesh is a part of: all parts then have the same.

    Raises
    ------
    UsageError
        For a suffix that has no writer, and fields of another length or without numbers.
    OutputError
        Where the file cannot be written, the format cannot keep distinct vertices apart, or needs a unit.

    Examples
    --------
    >>> import numpy as np
    >>> from pathlib import Path
    >>> from tomomesh import TriMesh, write_mesh
    >>> corner = TriMesh(np.eye(4, 3, -1), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    >>> write_mesh(corner, "corner.stl")
    >>> Path("corner.stl").stat().st_size == 84 + 50 * len(corner.faces)
    True
    """
    parts = InOnePiece(mesh) if isinstance(mesh, TriMesh) else mesh
    check_output(path, MESH_WRITERS)
    at_vertices = flat_columns(vertex_fields or {}, parts.vertex_count, AXES)
    on_faces = flat_columns(face_fields or {}, parts.face_count, ["count", "corners", "vertex_indices"])
    beside = MeshAttributes(unit, frame, at_vertices, on_faces, z_up=z_up, single=precision == 32, fits=fits)
    if suffix_of(path) in PART_WRITERS:
        write_parts(PART_WRITERS[suffix_of(path)](parts, path, beside), path)
    elif isinstance(mesh, TriMesh):
        WHOLE_WRITERS[suffix_of(path)](mesh, path, beside)
    else:
        raise UsageError(
            "the format is not written part by part, as a mesh larger than memory is", file=str(path),
            expected=" | ".join(sorted(PART_WRITERS)),
        )  # fmt: skip


KEEP_ALL = (".ply", ".vtp")
KEEP_AT_VERTICES = (".glb", ".gii")
KEEP_COLORS = (".obj", ".3mf")
"""Suffixes by the fields that the format keeps: all, those at vertices, and the colors at vertices."""


def keeps(path: str | Path, field: str, *, on_faces: bool = False) -> bool:
    """Whether the format of a mesh file keeps a field."""
    suffix = suffix_of(path)
    if is_bare(path):
        return False
    if on_faces or suffix in KEEP_ALL:
        return suffix in KEEP_ALL
    return suffix in KEEP_AT_VERTICES or (suffix in KEEP_COLORS and field in COLORS)


PART_WRITERS: dict[str, Callable[[Parts, str | Path, MeshAttributes], Iterator[bytes]]] = {
    ".stl": stl_parts,
    ".ply": ply_parts,
    ".obj": obj_parts,
}
"""Suffix to what yields a file of a mesh that need not be whole, part by part."""
WHOLE_WRITERS: dict[str, Callable[[TriMesh, str | Path, MeshAttributes], None]] = {
    ".off": write_off,
    ".glb": write_glb,
    ".vtp": write_vtp_mesh,
    ".3mf": write_3mf,
    ".gii": write_gifti,
    ".surf.gii": write_gifti,
}
"""Suffix to writer; that of a surface for Connectome Workbench is both, of which the last decides."""
MESH_WRITERS = (*PART_WRITERS, *WHOLE_WRITERS)
"""Suffixes of meshes that are written."""
