"""OBJ: vertices and faces as text, with colors behind the positions where there are any."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from ...errors import FormatError
from ..colors import named_colors
from ..text import lists_of, numbers_of, written
from .cells import fans, weld

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from .attributes import MeshAttributes
    from .cells import Arrays
    from .pieces.parts import Parts

VERTEX, FACE = re.compile(r"\s*[vV](?!\S)"), re.compile(r"\s*(f|F|fo)(?!\S)")
"""How the lines of vertices and of faces begin; old files name outlines of faces apart."""

BESIDE = re.compile(r"(?<=\d)/\S*")
"""The numbers of textures and normals behind that of a vertex."""


def obj_parts(mesh: Parts, path: str | Path, beside: MeshAttributes) -> Iterator[bytes]:
    """Yield a file part by part: 64-bit coordinates, and colors as fractions behind them."""
    yield f"# {beside.head}\n".encode("ascii")
    yield from (text.encode("ascii") for text in _vertices(mesh, beside))
    yield from (written("f %d %d %d\n", *(some + 1).T.tolist()).encode("ascii") for some in mesh.faces())


def _vertices(mesh: Parts, beside: MeshAttributes) -> Iterator[str]:
    """Yield the lines of the vertices, some at a time."""
    colors, start = named_colors(beside.vertex_fields), 0
    # rounded up: VTK cuts off what it makes of them
    fractions = [f" {math.ceil(value / 255 * 1e6) / 1e6:.6g}" for value in range(256)]
    for some in mesh.vertices():
        stop = start + len(some)
        own = colors[1][start:stop].tolist() if colors else []
        behind = [["".join(fractions[value] for value in color) for color in own]] if colors else []
        yield written(f"v %r %r %r{'%s' * len(behind)}\n", *some.T.tolist(), *behind)
        start = stop


def read_obj_mesh(data: bytes, file: str) -> Arrays:
    """Read vertices and faces, polygons cut into fans; equal vertices become one where each is used once.

    Numbers below 0 count back from the vertices so far.

    Raises
    ------
    FormatError
        For a vertex or a face that cannot be understood.
    """
    lines = unfolded(data, file)
    polygons = BESIDE.sub("", "\n".join(filter(FACE.match, lines))).splitlines()
    sizes = np.array([len(line.split()) - 1 for line in polygons], np.int64)
    try:
        vertices = numbers_of(list(filter(VERTEX.match, lines)), (1, 2, 3), np.float64)
        corners = lists_of(polygons, sizes)
    except ValueError:
        raise FormatError("a vertex or a face cannot be understood", file=file, expected="numbers") from None
    if (corners == 0).any() or (sizes < 3).any():
        raise FormatError("a face cannot be understood", file=file, expected="three vertices or more, from 1 on")
    numbers = corners - 1
    if (corners < 0).any():
        numbers = np.where(corners > 0, numbers, corners + np.repeat(_vertices_before(lines), sizes))
    faces = fans(numbers, sizes)
    if len(numbers) == 0 or not np.array_equal(np.sort(numbers), np.arange(len(vertices))):
        return vertices, faces
    unique, merged = weld(vertices)
    return unique, merged[faces]


def _vertices_before(lines: list[str]) -> NDArray[np.int64]:
    """Return how many vertices stand before each face."""
    vertices = np.cumsum([bool(VERTEX.match(line)) for line in lines], dtype=np.int64)
    return vertices[[bool(FACE.match(line)) for line in lines]]


def unfolded(data: bytes, file: str) -> list[str]:
    """Return the lines of a text without comments, those joined that end with a backslash."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # names of materials may be in any code; the numbers are ASCII
    lines = (re.sub(r"\\[ \t]*\r?\n", " ", text) if "\\" in text else text).splitlines()
    return [line.partition("#")[0] for line in lines] if "#" in text else lines
