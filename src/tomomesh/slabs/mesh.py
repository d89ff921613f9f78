"""A mesh that is never whole: one piece a slab, in the order that it has in memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..model.mesh import TriMesh

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from .keep import Kept, Slabs


@dataclass(frozen=True)
class Piece:
    """What a slab has of a mesh; faces know vertices by their numbers in the whole.

    Attributes
    ----------
    vertices : (n, 3) float array
        Its vertices, mm.
    centers : (c, 3) float array
        Those in the middle of its squares that are split into four, mm.
    halves : (2 q, 3) int64 array
        Two triangles a square.
    quarters : (2 c, 3) int64 array
        The other two of those that are split into four.
    cut_off : (2 q + 2 c,) bool array
        Which of these faces the study is cut off over.
    """

    vertices: NDArray[np.float64]
    centers: NDArray[np.float64]
    halves: NDArray[np.int64]
    quarters: NDArray[np.int64]
    cut_off: NDArray[np.bool_]

    @property
    def counts(self) -> tuple[int, int, int, int]:
        """How many rows each of its arrays has."""
        return len(self.vertices), len(self.centers), len(self.halves), len(self.quarters)


@dataclass(frozen=True)
class SlabMesh:
    """A triangle mesh as pieces.

    Its vertices are those of all pieces, then the centers of all; its faces the halves of all, then the quarters of
    all.

    Attributes
    ----------
    pieces : list
        What is kept of each `Piece`.
    counts : (s, 4) int64 array
        Vertices, centers, halves and quarters of each.
    slabs : Slabs
        Who keeps them.
    """

    pieces: list[Kept]
    counts: NDArray[np.int64]
    slabs: Slabs

    @classmethod
    def of(cls, pieces: Sequence[Kept], slabs: Slabs) -> SlabMesh:
        """Count what is in the pieces."""
        counts = slabs.fetch(slabs.each(_counts, pieces))
        return cls(list(pieces), np.array(counts, np.int64).reshape(-1, 4), slabs)

    @property
    def first(self) -> NDArray[np.int64]:
        """Number of the first vertex, center, half and quarter of each piece, (s, 4)."""
        before = np.cumsum(self.counts, axis=0) - self.counts
        before[:, 1] += self.counts[:, 0].sum()
        before[:, 3] += self.counts[:, 2].sum()
        return np.asarray(before)

    @property
    def squares(self) -> NDArray[np.int64]:
        """How many squares lie before each piece, and in all, (s + 1,): each has two halves."""
        return np.append(0, np.cumsum(self.counts[:, 2])) // 2

    @property
    def vertex_count(self) -> int:
        """Vertices of the whole."""
        return int(self.counts[:, :2].sum())

    @property
    def face_count(self) -> int:
        """Faces of the whole."""
        return int(self.counts[:, 2:].sum())

    def __iter__(self) -> Iterator[Piece]:
        """Hand over one piece after another."""
        return (self.slabs.fetch([piece])[0] for piece in self.pieces)

    def joined(self) -> TriMesh:
        """Return the whole, for meshes that fit into the memory."""
        pieces = list(self)
        vertices = [piece.vertices for piece in pieces] + [piece.centers for piece in pieces]
        faces = [piece.halves for piece in pieces] + [piece.quarters for piece in pieces]
        return TriMesh(np.concatenate(vertices), np.concatenate(faces))


def _counts(piece: Piece) -> tuple[int, int, int, int]:
    return piece.counts
