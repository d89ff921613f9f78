"""OFF: vertices and faces as text, and what may stand behind each.

Written by hand: trimesh's exporter rounds to ten digits. Neither comments nor colors (COFF): niivue shows nothing of
files that have one, meshio and CloudCompare refuse some.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from ...errors import FormatError
from ..files.atomic import replacing
from ..files.limits import require_rows
from ..text import lists_of, numbers_of, written
from .cells import fans

if TYPE_CHECKING:
    from pathlib import Path

    from ...model.mesh import TriMesh
    from .attributes import MeshAttributes
    from .cells import Arrays

HEAD = re.compile(r"\s*(ST|C|N)*OFF\b(?!\s*BINARY)")
"""The word that begins a file, and says what stands behind the three numbers of a vertex; it may be left out."""


def read_off(data: bytes, file: str) -> Arrays:
    """Read vertices and polygons, these cut into fans; comments, normals, colors and textures are passed over.

    Raises
    ------
    FormatError
        For a file that is cut off, or cannot be understood.
    """
    text = data.decode("utf-8-sig", "replace")
    text = re.sub(r"#.*", "", text) if "#" in text else text
    head = HEAD.match(text)
    lines = [line for line in text[head.end() if head else 0 :].splitlines() if line and not line.isspace()]
    try:
        vertices, faces = (int(word) for word in (lines[0] if lines else "").split()[:2])
        if min(vertices, faces) < 0:
            raise ValueError(vertices, faces)
        require_rows(vertices + faces, len(lines) - 1, "vertices and faces", file=file)
        places = numbers_of(lines[1 : vertices + 1], (0, 1, 2), np.float64)
        polygons = lines[vertices + 1 : vertices + faces + 1]
        sizes = numbers_of(polygons, (0,), np.int64)[:, 0]
        if (sizes < 3).any() or (sizes >= [len(line.split()) for line in polygons]).any():
            raise FormatError("a face cannot be understood", file=file, expected="three vertices or more")
        return places, fans(lists_of(polygons, sizes), sizes)
    except ValueError:
        raise FormatError("the file cannot be understood", file=file, expected="OFF: vertices and faces") from None


def write_off(mesh: TriMesh, path: str | Path, _beside: MeshAttributes) -> None:
    """Write 64-bit coordinates; neither unit nor frame has a place."""
    vertices = written("%r %r %r\n", *mesh.vertices.T.tolist())
    faces = written("3 %d %d %d\n", *mesh.faces.T.tolist())
    with replacing(path) as file:
        file.write(f"OFF\n{len(mesh.vertices)} {len(mesh.faces)} 0\n{vertices}{faces}".encode("ascii"))
