"""A mesh for viewers of large data: Neuroglancer's precomputed meshes, several levels of detail in cells of an octree.

The format is that of github.com/google/neuroglancer, datasource/precomputed/meshes.md, without shards.
"""

from __future__ import annotations

import json
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import OutputError, UsageError
from ....model.mesh import TriMesh
from ....model.units import MM
from ....slabs.patches.clipping import CellGrid
from ....slabs.patches.patch import in_one_patch
from ...documents import json_of
from ...files.atomic import replacing
from ...files.extras import required
from ...files.signature import signature
from .octree import fragments

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ....slabs.patches.patch import Patches
    from .octree import Fragment

KIND = "neuroglancer_multilod_draco"
BITS = 16
"""Of a coordinate within its cell: the more of the two numbers that the format allows."""
FACES = 2**16
"""Faces in a cell, about: some hundred kilobytes, which a viewer loads at once. Chosen; no position depends on it."""
NANOMETERS = 1e6
"""In a millimeter. A viewer's positions are nanometers."""


def write_neuroglancer(
    mesh: TriMesh | Patches,
    folder: str | Path,
    *,
    unit: str = "mm",
    frame: str = "LPS",
    segment: int = 1,
    faces: int = FACES,
) -> None:
    """Write a mesh as levels of detail that Neuroglancer and cloud-volume read; all files or none.

    Positions are kept to 1/65535 of the side of a cell at the finest level.

    Parameters
    ----------
    mesh : TriMesh or Patches
        One face at least.
    folder : path
        Made where it is missing; it may hold other meshes of the kind.
    unit, frame : str
        What the coordinates are in; an unknown unit counts as mm.
    segment : int
        The number of the mesh.
    faces : int
        About how many faces a cell is to hold.

    Raises
    ------
    FormatError
        Where DracoPy and pyfqmr are missing: the extra ``neuroglancer`` brings them.
    UsageError
        Where the folder is one of other data.
    OutputError
        Where a file cannot be written.
    """
    draco, _ = (required(package, file=str(folder)) for package in ("DracoPy", "pyfqmr"))
    whole = in_one_patch(mesh) if isinstance(mesh, TriMesh) else mesh
    _check(Path(folder))
    grid, levels = _grid(whole, faces)
    with _made(Path(folder)) as into, ExitStack() as files:
        info, index, data = (
            files.enter_context(replacing(into / name)) for name in ("info", f"{segment}.index", str(segment))
        )
        written = []
        for fragment in fragments(whole, grid, levels, _simplified):
            raw = _encoded(draco, fragment, grid)
            data.write(raw)
            written.append(_Written(fragment.level, fragment.cell, len(raw)))
        index.write(_index(written, grid, levels, _detail(whole)))
        info.write(json_of(_info(unit, frame)))


def _check(folder: Path) -> None:
    """Refuse a folder that holds other data of the kind that has a file of this name."""
    try:
        kind = json.loads((folder / "info").read_bytes()).get("@type") if (folder / "info").exists() else KIND
    except (OSError, ValueError, AttributeError):
        kind = None
    if kind != KIND:
        raise UsageError(
            "the folder holds other data", file=str(folder), found=f"info = {kind}", expected=KIND, hint="a new folder"
        )


@contextmanager
def _made(folder: Path) -> Iterator[Path]:
    """Make a folder where it is missing; one that was made is gone again where the block fails."""
    new = not folder.exists()
    try:
        folder.mkdir(exist_ok=True)
    except OSError as fault:
        raise OutputError("the folder cannot be made", file=str(folder), found=str(fault.strerror).lower()) from None
    try:
        yield folder
    except BaseException:
        if new:
            folder.rmdir()
        raise


def _grid(whole: Patches, faces: int) -> tuple[CellGrid, int]:
    """Return the finest grid, and how many levels there are until one cell holds all.

    A surface passes through about so many cells as a square of the box's longest side has.
    """
    extent = whole.extent
    levels = 1 + int(np.ceil(np.log2(max(whole.face_count / faces, 1)) / 2))
    origin = np.nextafter(extent.low.astype(np.float32), np.float32(-np.inf))
    longest = max(float((extent.high - origin).max()), float(np.finfo(np.float32).tiny))
    side = np.nextafter(np.float32(longest / 2 ** (levels - 1)), np.float32(np.inf))
    return CellGrid(origin.astype(np.float64), float(side)), levels


def _simplified(mesh: TriMesh, faces: int) -> TriMesh:
    """Return a mesh with about so many faces, with the same borders."""
    from pyfqmr import Simplify

    if len(mesh.faces) < 2 or faces < 1:
        return mesh
    work = Simplify()
    work.setMesh(mesh.vertices, mesh.faces.astype(np.int32))
    work.simplify_mesh(target_count=faces, preserve_border=True, verbose=False)
    vertices, triangles, _ = work.getMesh()
    return TriMesh(vertices, triangles)


@dataclass(frozen=True)
class _Written:
    level: int
    cell: tuple[int, ...]
    length: int


def _encoded(draco: Any, fragment: Fragment, grid: CellGrid) -> bytes:
    """Return a fragment by Draco, positions as whole numbers from 0 to 65535 within the cell."""
    most, side = 2**BITS - 1, grid.side * 2**fragment.level
    low = grid.origin + side * np.array(fragment.cell)
    places = np.clip(np.round((fragment.mesh.vertices - low) / side * most), 0, most).astype(np.float32)
    found: bytes = draco.encode(
        places, fragment.mesh.faces.astype(np.uint32), quantization_bits=BITS, quantization_range=most,
        quantization_origin=np.zeros(3), compression_level=1,
    )  # fmt: skip
    return found


def _detail(whole: Patches) -> float:
    """Return about how long edges are: those of even triangles that cover the box's sides."""
    a, b, c = whole.extent.high - whole.extent.low
    return float(np.sqrt(2 * (a * b + b * c + c * a) / max(whole.face_count, 1)))


def _index(written: list[_Written], grid: CellGrid, levels: int, detail: float) -> bytes:
    """Return where the fragments are: those of each level, their cells as columns, then their lengths."""
    parts = [
        np.full(3, grid.side, "<f4"), grid.origin.astype("<f4"), np.array([levels], "<u4"),
        (detail * 2.0 ** np.arange(levels)).astype("<f4"), np.zeros((levels, 3), "<f4"),
        np.bincount([one.level for one in written], minlength=levels).astype("<u4"),
    ]  # fmt: skip
    for _, level in groupby(written, lambda one: one.level):
        some = list(level)
        parts += [np.array([one.cell for one in some], "<u4").T, np.array([one.length for one in some], "<u4")]
    return b"".join(part.tobytes() for part in parts)


def _info(unit: str, frame: str) -> dict[str, Any]:
    scale = NANOMETERS * MM.get(unit, 1.0)
    return {
        "@type": KIND,
        "vertex_quantization_bits": BITS,
        "transform": [scale if row == column else 0 for row in range(3) for column in range(4)],
        "lod_scale_multiplier": 1,
        "written_by": signature(unit, frame),
    }
