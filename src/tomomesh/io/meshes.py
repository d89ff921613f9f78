"""Triangle meshes: in and out."""

from __future__ import annotations

import io
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EmptyError, FormatError
from ..model.mesh import TriMesh
from ..model.points import COLORS
from .atomic import check_output, replacing
from .colors import named_colors
from .fields import AXES, flat_columns
from .finite import check_finite
from .gifti import write_gifti
from .glb import write_glb
from .limits import require_bytes
from .off import write_off
from .ply import parse_header, write_ply
from .source import existing_file, reader_of, suffix_of, third_party, whole
from .threemf import write_3mf
from .vtp import write_vtp_mesh
from .weld import weld
from .written import Written, single

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    Arrays = tuple[NDArray[np.float64], NDArray[np.int64]]

STL_ROW = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")]
"""One face of a binary STL file."""

STL_TEXT = 80
"""Bytes of text at the start of a binary STL file."""

STL_HEAD = STL_TEXT + 4
"""Bytes before the first face: the text, and the count of faces."""


def read_mesh(path: str | Path) -> TriMesh:
    """Read a triangle mesh.

    Parameters
    ----------
    path : path
        ``.stl`` (its equal positions become one vertex), ``.ply``, ``.obj`` or ``.off``.

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
    return TriMesh(vertices, faces)


def _loaded(kind: str, data: bytes, file: str) -> Arrays:
    import trimesh

    options: dict[str, Any] = {"skip_materials": True, "maintain_order": True} if kind == "obj" else {}
    with third_party("trimesh", file):
        mesh: Any = trimesh.load(io.BytesIO(data), file_type=kind, force="mesh", process=False, **options)
        vertices = np.array(mesh.vertices, np.float64).reshape(-1, 3)
        return vertices, np.array(mesh.faces, np.int64).reshape(-1, 3)


def _read_ply(data: bytes, file: str) -> Arrays:
    parse_header(data, file=file)
    return _loaded("ply", data, file)


def _read_stl(data: bytes, file: str) -> Arrays:
    """Compare a binary file's count with its bytes first; text begins with ``solid``."""
    if not (data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:1000]):
        require_bytes(STL_HEAD, len(data), file=file)
        count = int(np.frombuffer(data, "<u4", 1, STL_HEAD - 4)[0])
        require_bytes(STL_HEAD + count * np.dtype(STL_ROW).itemsize, len(data), file=file)
    vertices, faces = _loaded("stl", data, file)
    unique, numbers = weld(vertices)
    return unique, numbers[faces]


MESH_READERS: dict[str, Callable[[bytes, str], Arrays]] = {
    ".stl": _read_stl,
    ".ply": _read_ply,
    ".obj": partial(_loaded, "obj"),
    ".off": partial(_loaded, "off"),
}
"""Suffix to reader of vertices and faces."""


def write_mesh(
    mesh: TriMesh,
    path: str | Path,
    *,
    unit: str = "mm",
    frame: str = "LPS",
    vertex_fields: Mapping[str, NDArray[Any]] | None = None,
    face_fields: Mapping[str, NDArray[Any]] | None = None,
) -> None:
    """Write a triangle mesh; the same mesh gives the same bytes.

    Parameters
    ----------
    mesh : TriMesh
        Its coordinates are written as they are.
    path : path
        ``.ply`` and ``.vtp`` (binary), ``.obj``, ``.off`` and ``.3mf`` (text) keep 64-bit coordinates; ``.stl``,
        ``.glb`` and ``.gii`` (binary) 32-bit ones.
    unit, frame : str
        What the coordinates are in, named in the file.
    vertex_fields : mapping of str to (n,) or (n, c) array, optional
        Numbers at the vertices. PLY, VTP, GLB and GIFTI keep them all, OBJ, OFF and 3MF the colors (``red``,
        ``green`` and ``blue``), STL none.
    face_fields : mapping of str to (m,) or (m, c) array, optional
        Numbers on the faces, kept by PLY and VTP.

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
    check_output(path, MESH_WRITERS)
    at_vertices = flat_columns(vertex_fields or {}, len(mesh.vertices), AXES)
    on_faces = flat_columns(face_fields or {}, len(mesh.faces), ["count", "corners", "vertex_indices"])
    MESH_WRITERS[suffix_of(path)](mesh, path, Written(unit, frame, at_vertices, on_faces))


KEEP_ALL = (".ply", ".vtp")
KEEP_AT_VERTICES = (".glb", ".gii")
KEEP_COLORS = (".obj", ".off", ".3mf")
"""Suffixes by the fields that the format keeps: all, those at vertices, and the colors at vertices."""


def keeps(path: str | Path, field: str, *, on_faces: bool = False) -> bool:
    """Whether the format of a mesh file keeps a field."""
    suffix = suffix_of(path)
    if on_faces or suffix in KEEP_ALL:
        return suffix in KEEP_ALL
    return suffix in KEEP_AT_VERTICES or (suffix in KEEP_COLORS and field in COLORS)


def _write_stl(mesh: TriMesh, path: str | Path, beside: Written) -> None:
    rows = np.zeros(len(mesh.faces), STL_ROW)
    rows["corners"] = single(mesh.vertices, path, kind="STL")[mesh.faces]
    length = np.linalg.norm(mesh.face_vectors, axis=1, keepdims=True)
    rows["normal"] = mesh.face_vectors / np.where(length > 0, length, 1.0)
    with replacing(path) as file:
        file.write(_shortened(beside.head).encode("ascii").ljust(STL_TEXT))
        file.write(np.array(len(rows), "<u4").tobytes())
        file.write(rows.tobytes())


def _shortened(head: str) -> str:
    """Drop whole words until the rest fits, the frame last: a number that is cut off would be another one."""
    words = head.split()
    while len(" ".join(words)) > STL_TEXT:
        del words[1 if len(words) > 2 else -1]
    return " ".join(words)


def _write_ply(mesh: TriMesh, path: str | Path, beside: Written) -> None:
    positions = dict(zip(AXES, np.asarray(mesh.vertices, np.float64).T, strict=True))
    write_ply(path, beside.head, {**positions, **beside.vertex_fields}, mesh.faces, beside.face_fields)


def _write_obj(mesh: TriMesh, path: str | Path, beside: Written) -> None:
    colors = named_colors(beside.vertex_fields)
    behind = [""] * len(mesh.vertices)
    if colors:
        fractions = [f" {value / 255:.6g}" for value in range(256)]
        behind = ["".join(fractions[value] for value in color) for color in colors[1].tolist()]
    vertices = (f"v {x!r} {y!r} {z!r}{color}" for (x, y, z), color in zip(mesh.vertices.tolist(), behind, strict=True))
    faces = (f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist())
    with replacing(path) as file:
        file.write(("\n".join([f"# {beside.head}", *vertices, *faces]) + "\n").encode("ascii"))


MESH_WRITERS: dict[str, Callable[[TriMesh, str | Path, Written], None]] = {
    ".stl": _write_stl,
    ".ply": _write_ply,
    ".obj": _write_obj,
    ".off": write_off,
    ".glb": write_glb,
    ".vtp": write_vtp_mesh,
    ".3mf": write_3mf,
    ".gii": write_gifti,
}
"""Suffix to writer."""
