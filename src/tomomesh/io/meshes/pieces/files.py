"""One mesh as several files that weld exactly, and an index of them."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....errors import UsageError
from ....model.columns import box
from ....model.mesh import TriMesh
from ....slabs.patches.patch import in_one_patch
from ....slabs.patches.shares import shares
from ...documents import json_of
from ...files.atomic import check_output, replacing
from ...files.source import suffix_of
from ..attributes import MeshAttributes, fits_single, require_single
from ..write import PART_WRITERS
from .parts import InOnePiece

if TYPE_CHECKING:
    from ....slabs.patches.patch import Patches

MOST_PIECES = 200
"""Files of one mesh: all are open until the last is whole, and macOS lets a process have 256."""


def write_pieces(
    mesh: TriMesh | Patches,
    path: str | Path,
    count: int,
    *,
    unit: str = "mm",
    frame: str = "LPS",
    precision: int = 64,
) -> list[Path]:  # fmt: skip
    """Write a mesh as several files of about as many faces each, all of them or none.

    ``mesh.ply`` becomes ``mesh-001.ply``, ``mesh-002.ply`` and so on, and ``mesh-pieces.json``, which names them. Every
    face is in one of them; a vertex that several of them use has the same coordinates in each, to the last bit, and no
    two vertices are equal: so joining equal positions gives the whole. How the mesh was cut into slabs changes no byte.

    Parameters
    ----------
    mesh : TriMesh or Patches
    path : path
        ``.ply``, ``.stl`` or ``.obj``.
    count : int
        Number of files, from 1 to 200.
    unit, frame, precision
        As `write_mesh` takes them.

    Returns
    -------
    list of path
        The files, the index last.

    Raises
    ------
    UsageError
        For another suffix or number.
    OutputError
        Where a file cannot be written, or 32 bits cannot keep the vertices apart.
    """
    check_output(path, PART_WRITERS)
    if not 1 <= count <= MOST_PIECES:
        raise UsageError("a mesh is written in 1 to 200 pieces", file=str(path), found=f"pieces = {count}")
    whole = in_one_patch(mesh) if isinstance(mesh, TriMesh) else mesh
    names = _names(Path(path), count)
    beside = MeshAttributes(unit, frame, {}, {}, single=precision == 32, fits=_fits(whole, path, precision))
    with ExitStack() as files:
        *pieces, index = (files.enter_context(replacing(name)) for name in names)
        told, marked = [], whole.filled() is not None
        for file, name, (piece, filled) in zip(pieces, names, shares(whole, count), strict=False):
            part = InOnePiece(piece, filled if marked else None)
            file.writelines(PART_WRITERS[suffix_of(path)](part, name, beside))
            told.append(_told(name, piece))
        index.write(json_of({"written_by": beside.head, **_counts(whole), "pieces": told}))
    return names


def _names(path: Path, count: int) -> list[Path]:
    files = [path.with_name(f"{path.stem}-{number:03d}{path.suffix}") for number in range(1, count + 1)]
    return [*files, path.with_name(f"{path.stem}-pieces.json")]


def _fits(whole: Patches, path: str | Path, precision: int) -> bool | None:
    """Whether 32 bits hold the whole, where that is asked: what one piece holds all must."""
    if suffix_of(path) == ".stl":
        require_single(whole, path, kind="STL")
        return True
    return fits_single(whole) if precision == 32 and suffix_of(path) == ".ply" else None


def _counts(whole: Patches) -> dict[str, int]:
    return {"vertices": whole.vertex_count, "faces": whole.face_count}


def _told(name: Path, piece: TriMesh) -> dict[str, Any]:
    low, high = box(piece.vertices) if len(piece.vertices) else (None, None)
    return {"file": name.name, "vertices": len(piece.vertices), "faces": len(piece.faces), "low": low, "high": high}
