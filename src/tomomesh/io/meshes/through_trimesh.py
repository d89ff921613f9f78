"""What trimesh reads of a mesh file: vertices and faces as they stand."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from ..files.source import third_party

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Arrays = tuple[NDArray[np.float64], NDArray[np.int64]]


def loaded(kind: str, data: bytes, file: str) -> Arrays:
    """Return the vertices (n, 3) and faces (m, 3) in the bytes of a file of the given suffix, without its dot.

    Raises
    ------
    FormatError
        Where trimesh cannot read it.
    """
    import trimesh

    options: dict[str, Any] = {"skip_materials": True, "maintain_order": True} if kind == "obj" else {}
    with third_party("trimesh", file):
        mesh: Any = trimesh.load(io.BytesIO(data), file_type=kind, force="mesh", process=False, **options)
        vertices = np.array(mesh.vertices, np.float64).reshape(-1, 3)
        return vertices, np.array(mesh.faces, np.int64).reshape(-1, 3)
