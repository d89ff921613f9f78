"""A mesh as writers take it: part by part, so that it need not be whole anywhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ....measure.topology import count_positions
from ....model.columns import parts_of
from ...files.atomic import replacing

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from ....model.mesh import TriMesh

    Floats = NDArray[np.float64]


class Parts(Protocol):
    """A mesh whose vertices and faces are handed out in their order, some at a time, as often as asked for."""

    @property
    def vertex_count(self) -> int:
        """Vertices of the whole."""

    @property
    def face_count(self) -> int:
        """Faces of the whole."""

    def vertices(self) -> Iterator[Floats]:
        """Hand out positions (n, 3)."""

    def faces(self) -> Iterator[NDArray[np.int64]]:
        """Hand out vertex numbers (m, 3)."""

    def corners(self) -> Iterator[Floats]:
        """Hand out the positions of the corners of faces, (m, 3, 3)."""

    def filled(self) -> Iterator[NDArray[np.bool_]] | None:
        """Hand out which faces (m,) were filled, not measured, in the parts of `faces`; None where none was."""

    def distinct(self, kind: type[np.floating[Any]]) -> int:
        """Count the positions that stay apart at a precision."""


@dataclass(frozen=True)
class InOnePiece:
    """A mesh that is whole in memory, or positions alone, and which of its faces (m,) are marked as filled."""

    mesh: TriMesh
    marked: NDArray[np.bool_] | None = None

    @property
    def vertex_count(self) -> int:
        """Vertices of the whole."""
        return len(self.mesh.vertices)

    @property
    def face_count(self) -> int:
        """Faces of the whole."""
        return len(self.mesh.faces)

    def vertices(self) -> Iterator[Floats]:
        """Hand out positions (n, 3)."""
        return (self.mesh.vertices[part] for part in parts_of(self.vertex_count))

    def faces(self) -> Iterator[NDArray[np.int64]]:
        """Hand out vertex numbers (m, 3)."""
        return (self.mesh.faces[part] for part in parts_of(self.face_count))

    def corners(self) -> Iterator[Floats]:
        """Hand out the positions of the corners of faces, (m, 3, 3)."""
        return (self.mesh.vertices[faces] for faces in self.faces())

    def filled(self) -> Iterator[NDArray[np.bool_]] | None:
        """Hand out which faces (m,) were filled, in the parts of `faces`; None where none is marked."""
        marked = self.marked
        return None if marked is None else (marked[part] for part in parts_of(self.face_count))

    def distinct(self, kind: type[np.floating[Any]]) -> int:
        """Count the positions that stay apart at a precision."""
        with np.errstate(over="ignore"):
            return count_positions(np.array(self.mesh.vertices.astype(kind, copy=False), np.float64, order="C"))


def write_parts(parts: Iterator[bytes], path: str | Path) -> None:
    """Write a file part by part; what is refused before the first is refused before the file is begun.

    Raises
    ------
    OutputError
        Where it cannot be written.
    """
    head = next(parts)
    with replacing(path) as file:
        file.write(head)
        file.writelines(parts)
