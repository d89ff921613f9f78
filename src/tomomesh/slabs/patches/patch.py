"""The patches of a mesh in pieces: the faces of each with all vertices that they use, and which of these others use."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...measure.shape import MeshExtent
from ...model.columns import any_of, box, carried, parts_of
from ..keep import InMemory
from ..mesh import Piece, SlabMesh
from .positions import distinct_in

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from ...model.mesh import TriMesh
    from ..keep import Kept, Slabs

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]


@dataclass(frozen=True)
class MeshPatch:
    """The faces of a slab, over vertices that are numbered within it.

    Attributes
    ----------
    vertices : (v, 3) float64 array
        The slab's own, then the centers of its squares split into four, then those of others that its faces use.
    faces : (f, 3) int32 array
        The halves of squares, then the quarters.
    numbers : (v,) int64 array
        Number of each vertex in the whole mesh.
    shared : (v,) bool array
        Vertices that another patch may use.
    cut_off : (f,) bool array
        Faces over which the study is cut off.
    own, centers, halves : int
        How many vertices of the first two kinds there are, and how many faces of the first.
    """

    vertices: Floats
    faces: NDArray[np.int32]
    numbers: Ints
    shared: NDArray[np.bool_]
    cut_off: NDArray[np.bool_]
    own: int
    centers: int
    halves: int

    @property
    def kept(self) -> Floats:
        """The vertices (k, 3) that belong to this patch alone."""
        return self.vertices[: self.own + self.centers]

    @property
    def beside(self) -> NDArray[np.bool_]:
        """Tell which faces (f,) have a shared vertex."""
        return any_of(self.shared[self.faces])


@dataclass(frozen=True)
class Patches:
    """A mesh as its patches, which hands out its vertices and faces in the order that they have in the whole.

    Attributes
    ----------
    slabs : Slabs
        Who works on them.
    kept : list of Kept
        Of `MeshPatch`.
    vertex_count : int
        Of the whole mesh.
    extent : MeshExtent
        The box around it.
    shared : (s,) int64 array
        Numbers of the vertices that several patches may use, rising.
    along : tuple of 3 floats
        A direction along which they follow one another, as the normal of the slices. No result depends on it, only how
        many vertices and faces lie beside other patches.
    """

    slabs: Slabs
    kept: list[Kept]
    vertex_count: int
    extent: MeshExtent
    shared: Ints
    along: tuple[float, ...]

    def __len__(self) -> int:
        return len(self.kept)

    def __iter__(self) -> Iterator[MeshPatch]:
        """Hand out one patch after the other."""
        return (self.slabs.fetch([one])[0] for one in self.kept)

    def each(self, work: Callable[..., Any], *columns: Sequence[Any]) -> list[Kept]:
        """Call some work once a patch; what is one for all is given as a single entry."""
        many = [[*column] * len(self) if len(column) == 1 else column for column in columns]
        return self.slabs.each(work, self.kept, *many)

    def told(self, work: Callable[..., Any], *columns: Sequence[Any]) -> list[Any]:
        """Return what some work tells of each patch: small values."""
        return self.slabs.fetch(self.each(work, *columns))

    def carried(self, matrix: Floats) -> Patches:
        """Return the mesh in another frame, at positions times a matrix (4, 4); a mirror turns the faces over."""
        along = np.array(self.along) @ np.linalg.inv(matrix[:3, :3])
        return replace(self.moved(_carried, matrix), along=tuple(along.tolist()))

    def moved(self, work: Callable[..., MeshPatch], given: Any) -> Patches:
        """Return the mesh with what some work makes of each patch."""
        kept = self.each(work, [given])
        return replace(self, kept=kept, extent=_extent(self.slabs, kept, self.face_count))

    @property
    def face_count(self) -> int:
        """Faces of the whole mesh."""
        return self.extent.faces

    def vertices(self) -> Iterator[Floats]:
        """Hand out positions (n, 3)."""
        return self._rows(lambda one: one.vertices[: one.own], lambda one, rows: rows, _centers)

    def faces(self) -> Iterator[Ints]:
        """Hand out vertex numbers (m, 3)."""
        return self._rows(lambda one: one.faces[: one.halves], lambda one, rows: one.numbers[rows], _quarters)

    def corners(self) -> Iterator[Floats]:
        """Hand out the positions of the corners of faces, (m, 3, 3)."""
        return self._rows(lambda one: one.faces[: one.halves], lambda one, rows: one.vertices[rows], _quarter_corners)

    def filled(self) -> Iterator[NDArray[np.bool_]] | None:
        """Hand out which faces (m,) were filled, not measured: the study is cut off over them; None where none was."""
        return self._filled() if any(self.told(_any_cut_off)) else None

    def _filled(self) -> Iterator[NDArray[np.bool_]]:
        for some in (_halves_cut_off, _quarters_cut_off):
            for kept in self.each(some):
                rows = self.slabs.fetch([kept])[0]
                yield from (rows[part] for part in parts_of(len(rows)))

    def distinct(self, kind: type[np.floating[Any]]) -> int:
        """Count the positions that stay apart at a precision."""
        return distinct_in(self, kind)

    def _rows(
        self,
        many: Callable[[MeshPatch], NDArray[Any]],
        made: Callable[[MeshPatch, Any], NDArray[Any]],
        few: Callable[[MeshPatch], NDArray[Any]],
    ) -> Iterator[NDArray[Any]]:
        """Hand out what is made of many rows of each patch, then a few of each, which alone are brought here."""
        for one in self:
            rows = many(one)
            yield from (made(one, rows[part]) for part in parts_of(len(rows)))
        for kept in self.each(few):
            rows = self.slabs.fetch([kept])[0]
            yield from (rows[part] for part in parts_of(len(rows)))


def _any_cut_off(patch: MeshPatch) -> bool:
    return bool(patch.cut_off.any())


def _halves_cut_off(patch: MeshPatch) -> NDArray[np.bool_]:
    return patch.cut_off[: patch.halves]


def _quarters_cut_off(patch: MeshPatch) -> NDArray[np.bool_]:
    return patch.cut_off[patch.halves :]


def _centers(patch: MeshPatch) -> Floats:
    return patch.kept[patch.own :]


def _quarters(patch: MeshPatch) -> Ints:
    return patch.numbers[patch.faces[patch.halves :]]


def _quarter_corners(patch: MeshPatch) -> Floats:
    return patch.vertices[patch.faces[patch.halves :]]


def patches_of(mesh: SlabMesh, along: tuple[float, ...] = (0.0, 0.0, 1.0)) -> Patches:
    """Give the faces of every piece of a mesh all vertices that they use; see `Patches`."""
    slabs, pieces, begins = mesh.slabs, mesh.pieces, list(mesh.first[:, :2])
    beside: list[Ints] = slabs.fetch(slabs.each(_beside, pieces, begins))
    shared = np.unique(np.concatenate([np.empty(0, np.int64), *beside]))
    asked = [_within(shared, begin, count) for begin, count in zip(begins, mesh.counts, strict=True)]
    places = np.empty((len(shared), 3))
    for numbers, found in zip(asked, slabs.fetch(slabs.each(_places, pieces, begins, asked)), strict=True):
        places[np.searchsorted(shared, numbers)] = found
    given = [places[np.searchsorted(shared, numbers)] for numbers in beside]
    kept = slabs.each(_patch, pieces, begins, asked, beside, given)
    return Patches(slabs, kept, mesh.vertex_count, _extent(slabs, kept, mesh.face_count), shared, along)


def in_one_patch(mesh: TriMesh, cut_off: NDArray[np.bool_] | None = None) -> Patches:
    """Return a mesh that is whole in memory as a single patch; the study is cut off over some of its faces (m,)."""
    cut_off = np.zeros(len(mesh.faces), np.bool_) if cut_off is None else cut_off
    piece = Piece(mesh.vertices, mesh.vertices[:0], mesh.faces, mesh.faces[:0], cut_off)
    return patches_of(SlabMesh.of([piece], InMemory()))


def _extent(slabs: Slabs, kept: list[Kept], faces: int) -> MeshExtent:
    boxes = [one for one in slabs.fetch(slabs.each(_box, kept)) if one is not None] or [np.zeros((2, 3))]
    return MeshExtent(np.min(boxes, axis=0)[0], np.max(boxes, axis=0)[1], faces)


def _carried(patch: MeshPatch, matrix: Floats) -> MeshPatch:
    turned = slice(None, None, -1 if np.linalg.det(matrix[:3, :3]) < 0 else 1)
    places = carried(patch.vertices, matrix[:3, :3].T, matrix[:3, 3])
    return replace(patch, vertices=places, faces=np.ascontiguousarray(patch.faces[:, turned]))


def _box(patch: MeshPatch) -> Floats | None:
    return np.stack(box(patch.kept)) if len(patch.kept) else None


def _within(numbers: Ints, begins: Ints, counts: Ints) -> Ints:
    """Return which rising numbers are those of a piece's vertices and centers, which are so many from these on."""
    ends = np.searchsorted(numbers, np.stack([begins, begins + counts[:2]], axis=1))
    return np.concatenate([numbers[start:stop] for start, stop in ends])


def _local(piece: Piece, begins: Ints, numbers: Ints, beside: Ints) -> Ints:
    """Return numbers within a piece: its own vertices, its centers, then those beside it; -1 for none of these."""
    own, centers = len(piece.vertices), len(piece.centers)
    found = np.full(numbers.shape, -1, np.int64)
    for first, begin, count in ((0, begins[0], own), (own, begins[1], centers)):
        found = np.where((numbers >= begin) & (numbers < begin + count), first + numbers - begin, found)
    if len(beside):
        missing = found < 0
        found[missing] = own + centers + np.searchsorted(beside, numbers[missing])
    return found


def _beside(piece: Piece, begins: Ints) -> Ints:
    """Return the rising numbers of the vertices that a piece uses and are not its own."""
    others = [faces[_owned(piece, begins, faces) < 0] for faces in (piece.halves, piece.quarters)]
    return np.unique(np.concatenate(others))


def _owned(piece: Piece, begins: Ints, numbers: Ints) -> Ints:
    return _local(piece, begins, numbers, np.empty(0, np.int64))


def _places(piece: Piece, begins: Ints, numbers: Ints) -> Floats:
    """Return the positions (n, 3) of some of a piece's own vertices."""
    return np.asarray(np.concatenate([piece.vertices, piece.centers])[_owned(piece, begins, numbers)])


def _patch(piece: Piece, begins: Ints, asked: Ints, beside: Ints, given: Floats) -> MeshPatch:
    """Put a piece and what it uses of others together."""
    own, centers = len(piece.vertices), len(piece.centers)
    shared = np.zeros(own + centers + len(beside), np.bool_)
    shared[_owned(piece, begins, asked)] = True
    shared[own + centers :] = True
    ranges = [begins[0] + np.arange(own), begins[1] + np.arange(centers), beside]
    faces = [_local(piece, begins, some, beside).astype(np.int32) for some in (piece.halves, piece.quarters)]
    return MeshPatch(
        np.concatenate([piece.vertices, piece.centers, given]), np.concatenate(faces), np.concatenate(ranges), shared,
        piece.cut_off, own, centers, len(piece.halves),
    )  # fmt: skip
