"""STL: a header of 80 bytes, the count of faces, and 50 bytes a face; text is read too."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..files.atomic import replacing
from ..files.limits import require_bytes
from .attributes import single_precision
from .through_trimesh import loaded
from .weld import weld

if TYPE_CHECKING:
    from pathlib import Path

    from ...model.mesh import TriMesh
    from .attributes import MeshAttributes
    from .through_trimesh import Arrays

FACE = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")]
"""One face of a binary STL file."""

STL_HEADER_BYTES = 80
"""Bytes of text at the start of a binary STL file."""

BEFORE_FACES = STL_HEADER_BYTES + 4
"""Bytes before the first face: the text, and the count of faces."""


def read_stl(data: bytes, file: str) -> Arrays:
    """Read vertices and faces, once a binary file is as long as its count says; text begins with ``solid``."""
    if not (data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:1000]):
        require_bytes(BEFORE_FACES, len(data), file=file)
        count = int(np.frombuffer(data, "<u4", 1, STL_HEADER_BYTES)[0])
        require_bytes(BEFORE_FACES + count * np.dtype(FACE).itemsize, len(data), file=file)
    vertices, faces = loaded("stl", data, file)
    unique, numbers = weld(vertices)
    return unique, numbers[faces]


def write_stl(mesh: TriMesh, path: str | Path, beside: MeshAttributes) -> None:
    """Write a binary file.

    Raises
    ------
    OutputError
        Where 32 bits cannot keep the vertices apart.
    """
    data = stl_bytes(mesh, path, beside)
    with replacing(path) as file:
        file.write(data)


def stl_bytes(mesh: TriMesh, path: str | Path, beside: MeshAttributes) -> bytes:
    """Return a binary file: 32-bit coordinates, each face with its normal, behind a header that names the frame.

    Raises
    ------
    OutputError
        Where 32 bits cannot keep the vertices apart; `path` is named.
    """
    rows = np.zeros(len(mesh.faces), FACE)
    rows["corners"] = single_precision(mesh.vertices, path, kind="STL")[mesh.faces]
    length = np.linalg.norm(mesh.face_vectors, axis=1, keepdims=True)
    rows["normal"] = mesh.face_vectors / np.where(length > 0, length, 1.0)
    head = _shortened(beside.head).encode("ascii").ljust(STL_HEADER_BYTES)
    return head + np.array(len(rows), "<u4").tobytes() + rows.tobytes()


def _shortened(head: str) -> str:
    """Drop whole words until the rest fits, the frame last: a number that is cut off would be another one."""
    words = head.split()
    while len(" ".join(words)) > STL_HEADER_BYTES:
        del words[1 if len(words) > 2 else -1]
    return " ".join(words)
