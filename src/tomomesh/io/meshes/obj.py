"""OBJ: vertices and faces as text, with colors behind the positions where there are any."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from ...errors import FormatError
from ..colors import named_colors
from ..files.atomic import replacing
from ..text import written
from .cells import fans, weld

if TYPE_CHECKING:
    from pathlib import Path

    from ...model.mesh import TriMesh
    from .attributes import MeshAttributes
    from .cells import Arrays

VERTEX, FACE = (["v"], ["V"]), (["f"], ["F"], ["fo"])
"""The words that begin the lines of vertices and of faces; old files name outlines of faces apart."""


def write_obj(mesh: TriMesh, path: str | Path, beside: MeshAttributes) -> None:
    """Write 64-bit coordinates, and colors as fractions behind them."""
    colors = named_colors(beside.vertex_fields)
    behind = []
    if colors:
        # rounded up: VTK cuts off what it makes of them
        fractions = [f" {math.ceil(value / 255 * 1e6) / 1e6:.6g}" for value in range(256)]
        behind = [["".join(fractions[value] for value in color) for color in colors[1].tolist()]]
    vertices = written(f"v %r %r %r{'%s' * len(behind)}\n", *mesh.vertices.T.tolist(), *behind)
    faces = written("f %d %d %d\n", *(mesh.faces + 1).T.tolist())
    with replacing(path) as file:
        file.write(f"# {beside.head}\n{vertices}{faces}".encode("ascii"))


def read_obj_mesh(data: bytes, file: str) -> Arrays:
    """Read vertices and faces, polygons cut into fans; equal vertices become one where each is used once.

    Numbers below 0 count back from the vertices so far.

    Raises
    ------
    FormatError
        For a vertex or a face that cannot be understood.
    """
    words = [line.split() for line in unfolded(data, file)]
    places = [line[1:4] for line in words if line[:1] in VERTEX]
    polygons = [[corner.partition("/")[0] for corner in line[1:]] for line in words if line[:1] in FACE]
    before = np.cumsum([line[:1] in VERTEX for line in words], dtype=np.int64)[[line[:1] in FACE for line in words]]
    try:
        vertices = np.array(places, np.float64).reshape(-1, 3)
        corners = np.array([corner for polygon in polygons for corner in polygon], np.int64)
    except (ValueError, OverflowError):  # of numbers beyond 64 bits
        raise FormatError("a vertex or a face cannot be understood", file=file, expected="numbers") from None
    sizes = np.array([len(polygon) for polygon in polygons], np.int64)
    if (corners == 0).any() or (sizes < 3).any():
        raise FormatError("a face cannot be understood", file=file, expected="three vertices or more, from 1 on")
    numbers = np.where(corners > 0, corners - 1, corners + np.repeat(before, sizes))
    faces = fans(numbers, sizes)
    if len(numbers) == 0 or not np.array_equal(np.sort(numbers), np.arange(len(vertices))):
        return vertices, faces
    unique, merged = weld(vertices)
    return unique, merged[faces]


def unfolded(data: bytes, file: str) -> list[str]:
    """Return the lines of a text without comments, those joined that end with a backslash."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # names of materials may be in any code; the numbers are ASCII
    return [line.partition("#")[0] for line in re.sub(r"\\[ \t]*\r?\n", " ", text).splitlines()]
