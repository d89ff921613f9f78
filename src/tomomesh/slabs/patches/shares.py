"""A mesh in patches shared out anew: into meshes of about as many faces each, wherever the slabs were cut."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...model.mesh import TriMesh

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ..keep import Kept, Slabs
    from .patch import MeshPatch, Patches

    Ints = NDArray[np.int64]

BINS = 2**16
"""Ranges of vertices among which meshes end: they differ by so small a part of the faces. Chosen: half a megabyte."""


def shares(patches: Patches, count: int) -> Iterator[tuple[TriMesh, NDArray[np.bool_]]]:
    """Share the faces out by their lowest vertex, and hand out each part as a mesh with the vertices that it uses.

    With each it is told over which of its faces the study is cut off.

    Vertices that two parts use have the same bits in both, and are in both in the order of the whole.

    Parameters
    ----------
    patches : Patches
    count : int
        Number of parts. One needs memory.
    """
    lowest = patches.each(_lowest)
    found = patches.slabs.fetch(patches.slabs.each(_spread, lowest, [patches.vertex_count] * len(patches)))
    spans = np.array([span for span, _ in found], np.int64)
    reached = np.cumsum(np.sum([faces for _, faces in found], axis=0))
    bins = np.searchsorted(reached, np.arange(1, count) * patches.face_count / count)
    # the first vertex whose bin is behind these
    ends = -(-(bins + 1) * patches.vertex_count // BINS)
    for start, stop in zip([0, *ends.tolist()], [*ends.tolist(), patches.vertex_count], strict=True):
        some = np.flatnonzero((spans[:, 0] < stop) & (spans[:, 1] >= start))
        columns = [patches.kept[one] for one in some], [lowest[one] for one in some]
        yield _together(patches.slabs, patches.slabs.each(_between, *columns, [start] * len(some), [stop] * len(some)))


def _lowest(patch: MeshPatch) -> Ints:
    """Return the lowest vertex of every face, (f,)."""
    a, b, c = patch.numbers[patch.faces.T]
    lowest: Ints = np.minimum(np.minimum(a, b), c)
    return lowest


def _spread(lowest: Ints, total: int) -> tuple[tuple[int, int], Ints]:
    """Return the lowest and the highest of the faces' lowest vertices, and how many faces have theirs in each bin."""
    bins = np.bincount(lowest * BINS // max(total, 1), minlength=BINS)
    return (int(lowest.min(initial=total)), int(lowest.max(initial=-1))), bins.astype(np.int64)


def _together(slabs: Slabs, kept: list[Kept]) -> tuple[TriMesh, NDArray[np.bool_]]:
    """Put faces of several patches into one mesh, halves before quarters, over each vertex once."""
    found = slabs.fetch(kept)
    faces = np.concatenate([np.empty((0, 3), np.int64), *(one.faces[n] for n in (0, 1) for one in found)])
    cut_off = np.concatenate([np.empty(0, np.bool_), *(one.cut_off[n] for n in (0, 1) for one in found)])
    numbers = np.concatenate([np.empty(0, np.int64), *(one.numbers for one in found)])
    places = np.concatenate([np.empty((0, 3)), *(one.places for one in found)])
    once, first = np.unique(numbers, return_index=True)
    return TriMesh(places[first], np.searchsorted(once, faces)), cut_off


class _Some(NamedTuple):
    """Some faces of a patch, halves and quarters: their vertices, over which the study is cut off, and all they use."""

    faces: list[Ints]
    cut_off: list[NDArray[np.bool_]]
    numbers: Ints
    places: NDArray[np.float64]


def _between(patch: MeshPatch, lowest: Ints, start: int, stop: int) -> _Some:
    """Return the faces of a patch whose lowest vertex lies in a range."""
    some = (lowest >= start) & (lowest < stop)
    used = np.unique(patch.faces[some])
    parts = (slice(patch.halves), slice(patch.halves, None))
    faces = [patch.numbers[patch.faces[part][some[part]]] for part in parts]
    cut_off = [patch.cut_off[part][some[part]] for part in parts]
    return _Some(faces, cut_off, patch.numbers[used], patch.vertices[used])
