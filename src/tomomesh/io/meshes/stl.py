"""STL: a header of 80 bytes, the count of faces, and 50 bytes a face; text is read too."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from ...errors import FormatError, OutputError
from ..fields import doubles
from ..files.limits import require_bytes
from .attributes import require_single
from .cells import weld

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from .attributes import MeshAttributes
    from .cells import Arrays
    from .pieces.parts import Parts

FACE = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")]
"""One face of a binary STL file."""

LONGEST_NAME = 2**16
"""Bytes among which the first facet of a text must be; names of parts are lines of some dozen letters."""

STL_HEADER_BYTES = 80
"""Bytes of text at the start of a binary STL file."""

MOST_FACES = 2**32 - 2
"""As many as the count holds; one more says that the count was not known."""

BEFORE_FACES = STL_HEADER_BYTES + 4
"""Bytes before the first face: the text, and the count of faces."""


BEGIN = re.compile(rb"(\xef\xbb\xbf)?\s*solid\b", re.IGNORECASE)
"""How a text begins, behind the mark of UTF-8 that some editors put there."""

CORNER = re.compile(rb"\svertex\s+(\S+\s+\S+\s+\S+)", re.IGNORECASE)
NAMES = re.compile(
    rb"(?:\A\xef\xbb\xbf|(?<!\S))(end[ \t]*)?solid\b[^\r\n]*?(?=[\r\n]|\Z|\bfacet\s+normal\b)", re.IGNORECASE
)
FILLED = re.compile(rb"\bfacet\b|\bend\s*solid\b", re.IGNORECASE)
"""What stands in every text, and in no binary file but by chance."""

UNCOUNTED = (0, 2**32 - 1)
"""Counts of writers that did not know it when they wrote it: the faces go to the end of the file."""

FACET, CLOSED = re.compile(rb"\bfacet\b", re.IGNORECASE), re.compile(rb"\bend\s*facet\b", re.IGNORECASE)
"""What a text is made of: the three numbers behind a corner, the names of solids, facets and their ends. A name goes to
the end of its line, or to the next facet where all is on one line."""


def read_stl(data: bytes, file: str) -> Arrays:
    """Read vertices and faces, binary or text, of one solid or several; equal positions become one vertex.

    A binary file is at least as long as its count says; what is behind its last face is passed over.

    Raises
    ------
    FormatError
        For a file that is cut off, and a text that cannot be understood.
    """
    corners = _text_corners(data, file) if _is_text(data) else _binary_corners(data, file)
    unique, numbers = weld(corners)
    return unique, numbers.reshape(-1, 3)


def _is_text(data: bytes) -> bool:
    """Tell whether a file is text: headers of binary files may begin with ``solid`` too, but their length is told."""
    count = int(np.frombuffer(data, "<u4", 1, STL_HEADER_BYTES)[0]) if len(data) >= BEFORE_FACES else -1
    exact = len(data) == BEFORE_FACES + count * np.dtype(FACE).itemsize
    return not exact and bool(BEGIN.match(data)) and bool(FILLED.search(data, 0, LONGEST_NAME))


def _binary_corners(data: bytes, file: str) -> NDArray[np.float64]:
    require_bytes(BEFORE_FACES, len(data), file=file)
    count, size = int(np.frombuffer(data, "<u4", 1, STL_HEADER_BYTES)[0]), np.dtype(FACE).itemsize
    if count in UNCOUNTED and (len(data) - BEFORE_FACES) % size == 0:
        count = (len(data) - BEFORE_FACES) // size
    require_bytes(BEFORE_FACES + count * size, len(data), file=file)
    return doubles(np.frombuffer(data, FACE, count, BEFORE_FACES)["corners"].reshape(-1, 3))


def _text_corners(data: bytes, file: str) -> NDArray[np.float64]:
    ends = [found for found in NAMES.finditer(data) if found[1]]
    text = NAMES.sub(b"", data)
    facets, closed = len(FACET.findall(text)), len(CLOSED.findall(text))
    try:
        corners = np.array(b" ".join(CORNER.findall(text)).split(), np.float64).reshape(-1, 3)
    except ValueError:
        raise FormatError("a corner is no three numbers", file=file, expected="vertex x y z") from None
    # `endfacet` is one word, and `end facet` counts among the facets
    facets -= len(re.findall(rb"\bend\s+facet\b", text, re.IGNORECASE))
    if not ends or facets != closed or len(corners) != 3 * facets:
        raise FormatError(
            "the text is cut off, or its faces are no triangles", file=file,
            found=f"facets = {facets}, ended = {closed}, corners = {len(corners)}",
            expected="three corners a facet, and endsolid",
        )  # fmt: skip
    return corners


def stl_parts(mesh: Parts, path: str | Path, beside: MeshAttributes) -> Iterator[bytes]:
    """Yield a binary file part by part: 32-bit coordinates, each face with its normal, behind a header with the frame.

    Raises
    ------
    OutputError
        Where 32 bits cannot keep the vertices apart, or cannot count the faces; `path` is named.
    """
    if mesh.face_count > MOST_FACES:
        raise OutputError(
            "STL counts faces in 32 bits", file=str(path), found=f"faces = {mesh.face_count}",
            expected=f"at most {MOST_FACES}", hint="a .ply file, or --pieces",
        )  # fmt: skip
    require_single(mesh, path, kind="STL", known=beside.fits)
    head = _shortened(beside.head).encode("ascii").ljust(STL_HEADER_BYTES)
    yield head + np.array(mesh.face_count, "<u4").tobytes()
    for corners in mesh.corners():
        rows = np.zeros(len(corners), FACE)
        rows["corners"] = corners
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        rows["normal"] = normals / np.where(length > 0, length, 1.0)
        yield rows.tobytes()


def _shortened(head: str) -> str:
    """Drop whole words until the rest fits, the frame last: a number that is cut off would be another one."""
    words = head.split()
    while len(" ".join(words)) > STL_HEADER_BYTES:
        del words[1 if len(words) > 2 else -1]
    return " ".join(words)
