"""The patches of a mesh in pieces: the faces of each with all vertices that they use, and which of these others use."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from ...measure.shape import Extent
from ...model.columns import box

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from ..keep import Kept, Slabs
    from ..mesh import Piece

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Patch:
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
    own, centers, halves : int
        How many vertices of the first two kinds there are, and how many faces of the first.
    """

    vertices: Floats
    faces: NDArray[np.int32]
    numbers: Ints
    shared: NDArray[np.bool_]
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
        found: NDArray[np.bool_] = self.shared[self.faces].any(axis=1)
        return found


@dataclass(frozen=True)
class Patches:
    """A mesh as its patches.

    Attributes
    ----------
    slabs : Slabs
        Who works on them.
    kept : list of Kept
        Of `Patch`.
    vertices, faces : int
        Of the whole mesh.
    extent : Extent
        The box around it.
    shared : (s,) int64 array
        Numbers of the vertices that several patches may use, rising.
    """

    slabs: Slabs
    kept: list[Kept]
    vertices: int
    extent: Extent
    shared: Ints

    @property
    def faces(self) -> int:
        """Number of faces of the whole mesh."""
        return self.extent.faces

    def __iter__(self) -> Iterator[Patch]:
        """Hand out one patch after the other."""
        for one in self.kept:
            yield self.slabs.fetch([one])[0]


@dataclass(frozen=True)
class _Sizes:
    """Of a piece: its vertices, centers and faces, and the box around the first two, none where there are none."""

    own: int
    centers: int
    faces: int
    box: tuple[Floats, Floats] | None


def patches_of(slabs: Slabs, pieces: Sequence[Kept]) -> Patches:
    """Give the faces of every piece all vertices that they use.

    Parameters
    ----------
    slabs : Slabs
    pieces : sequence of Kept
        Of `Piece`, in the order of the slabs.

    Returns
    -------
    Patches
    """
    sizes: list[_Sizes] = slabs.fetch(slabs.each(_sizes, pieces))
    owns, centers = ([getattr(one, name) for one in sizes] for name in ("own", "centers"))
    first = list(accumulate(owns, initial=0))
    begins = list(zip(first, accumulate(centers, initial=first[-1]), strict=False))[: len(sizes)]
    beside: list[Ints] = slabs.fetch(slabs.each(_beside, pieces, begins))
    shared = np.unique(np.concatenate([np.empty(0, np.int64), *beside]))
    asked = [_within(shared, *begin, one) for begin, one in zip(begins, sizes, strict=True)]
    places = np.empty((len(shared), 3))
    for numbers, found in zip(asked, slabs.fetch(slabs.each(_places, pieces, begins, asked)), strict=True):
        places[np.searchsorted(shared, numbers)] = found
    given = [places[np.searchsorted(shared, numbers)] for numbers in beside]
    kept = slabs.each(_patch, pieces, begins, asked, beside, given)
    return Patches(slabs, kept, sum(owns) + sum(centers), _extent(sizes), shared)


def _sizes(piece: Piece) -> _Sizes:
    both = [values for values in (piece.vertices, piece.centers) if len(values)]
    boxes = [box(values) for values in both]
    around = (np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)) if boxes else None
    return _Sizes(len(piece.vertices), len(piece.centers), len(piece.halves) + len(piece.quarters), around)


def _extent(sizes: list[_Sizes]) -> Extent:
    boxes = [one.box for one in sizes if one.box is not None] or [(np.zeros(3), np.zeros(3))]
    low, high = np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)
    return Extent(low, high, sum(one.faces for one in sizes))


def _within(numbers: Ints, own: int, center: int, sizes: _Sizes) -> Ints:
    """Return which rising numbers are those of a piece, whose vertices and centers are numbered from these on."""
    ranges = ((own, own + sizes.own), (center, center + sizes.centers))
    return np.concatenate([numbers[slice(*np.searchsorted(numbers, ends))] for ends in ranges])


def _local(piece: Piece, begins: tuple[int, int], numbers: Ints, beside: Ints) -> Ints:
    """Number vertices within a piece: its own, its centers, then those beside it; -1 where it is none of these."""
    own, centers = len(piece.vertices), len(piece.centers)
    found = np.full(numbers.shape, -1, np.int64)
    for first, begin, count in ((0, begins[0], own), (own, begins[1], centers)):
        found = np.where((numbers >= begin) & (numbers < begin + count), first + numbers - begin, found)
    if len(beside):
        missing = found < 0
        found[missing] = own + centers + np.searchsorted(beside, numbers[missing])
    return found


def _beside(piece: Piece, begins: tuple[int, int]) -> Ints:
    """Return the rising numbers of the vertices that a piece uses and are not its own."""
    others = [faces[_owned(piece, begins, faces) < 0] for faces in (piece.halves, piece.quarters)]
    return np.unique(np.concatenate(others))


def _owned(piece: Piece, begins: tuple[int, int], numbers: Ints) -> Ints:
    return _local(piece, begins, numbers, np.empty(0, np.int64))


def _places(piece: Piece, begins: tuple[int, int], numbers: Ints) -> Floats:
    """Return the positions (n, 3) of some of a piece's own vertices."""
    return np.asarray(np.concatenate([piece.vertices, piece.centers])[_owned(piece, begins, numbers)])


def _patch(piece: Piece, begins: tuple[int, int], asked: Ints, beside: Ints, given: Floats) -> Patch:
    """Put a piece and what it uses of others together."""
    own, centers = len(piece.vertices), len(piece.centers)
    shared = np.zeros(own + centers + len(beside), np.bool_)
    shared[_owned(piece, begins, asked)] = True
    shared[own + centers :] = True
    ranges = [begins[0] + np.arange(own), begins[1] + np.arange(centers), beside]
    faces = [_local(piece, begins, some, beside).astype(np.int32) for some in (piece.halves, piece.quarters)]
    return Patch(
        np.concatenate([piece.vertices, piece.centers, given]), np.concatenate(faces), np.concatenate(ranges), shared,
        own, centers, len(piece.halves),
    )  # fmt: skip
