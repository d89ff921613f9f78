"""Lengths, turns and angles of a mesh in patches, as those of the whole."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...measure.links import Links
from ...measure.shape import (
    ANGLE_PARTS,
    EDGE_PARTS,
    MOST_ANGLE,
    MOST_ASPECT,
    MOST_TURN,
    angles_and_aspects,
    folded,
    lengths_and_turns,
    told_of_edges,
    told_of_faces,
    unfolded,
)
from .counts import inner_edges
from .order import digits_after, percentiles

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from ..keep import Kept
    from .patch import MeshPatch, Patches
    from .seams import Gathered

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Edges:
    """What is known of some edges: sums of their turns, the pairs of faces at them, and the largest turn."""

    turns: Floats
    pairs: int
    largest: float

    @classmethod
    def of(cls, turns: Floats, uses: NDArray[np.int32], total: int) -> Edges:
        """Add up the turns (e,) of some edges, each with so many faces; there are `total` in the whole."""
        return cls(folded(turns, MOST_TURN, total), int((uses == 2).sum()), float(turns.max(initial=0)))


@dataclass(frozen=True)
class Shaped:
    """What is measured of a patch.

    Attributes
    ----------
    lengths : (e,) float64 array
        Of the edges that no other patch has a part in.
    smallest : (f,) float64 array
        Angle of each face.
    edges : Edges
    angles, aspects : (1, FOLDS) float64 array
        Sums over the faces, of these angles and of the aspects.
    largest : float
        Angle of all.
    ends : (2, k) float64 array
        The shortest and the longest edge of each connected piece.
    """

    lengths: Floats
    smallest: Floats
    edges: Edges
    angles: Floats
    aspects: Floats
    largest: float
    ends: Floats


def shapes_in(patches: Patches, whole: Gathered) -> tuple[dict[str, float], Floats]:
    """Measure what `tomomesh.measure.shape.triangle_shapes` does on a whole mesh, to the last bit.

    Returns
    -------
    dict
    (2, p) float64 array
        The shortest and the longest edge of each connected piece.
    """
    links, theirs, edges = whole.seams.links, whole.seams.theirs, int(whole.table.edges.sum())
    kept = patches.each(_shaped, [edges], [patches.face_count])
    found: list[Shaped] = patches.slabs.fetch(patches.slabs.each(_without_arrays, kept))
    lengths, turns = lengths_and_turns(links)
    sums = [*(one.edges for one in found), Edges.of(turns[theirs], links.uses[theirs], edges)]
    total = unfolded(np.sum([one.turns for one in sums], axis=0))[0]
    told = told_of_edges(
        percentiles(_counts(patches, kept, "lengths", lengths[theirs]), edges, EDGE_PARTS),
        total / max(sum(one.pairs for one in sums), 1), max(one.largest for one in sums),
    ) | told_of_faces(
        percentiles(_counts(patches, kept, "smallest", lengths[:0]), patches.face_count, ANGLE_PARTS),
        max(one.largest for one in found), _mean([one.angles for one in found], patches),
        _mean([one.aspects for one in found], patches),
    )  # fmt: skip
    pieces = [whole.numbers, whole.numbers[whole.seams.rim.pieces[whole.seams.starts[theirs] // 3]]]
    return told, _ends([*(one.ends for one in found), np.stack([lengths[theirs]] * 2)], pieces, len(whole.table.faces))


def _shaped(patch: MeshPatch, edges: int, faces: int) -> Shaped:
    links = Links(patch)
    lengths, turns = lengths_and_turns(links)
    inner = inner_edges(patch, links)
    lengths = lengths[inner]
    smallest, largest, aspects = angles_and_aspects(links)
    return Shaped(
        lengths, smallest, Edges.of(turns[inner], links.uses[inner], edges),
        folded(smallest, MOST_ANGLE, faces), folded(aspects, MOST_ASPECT, faces), float(largest.max(initial=0)),
        _ends([np.stack([lengths] * 2)], [links.edge_pieces[inner]], links.pieces),
    )  # fmt: skip


def _ends(found: Sequence[Floats], pieces: Sequence[NDArray[np.integer[Any]]], count: int) -> Floats:
    """Return the least and the greatest of what was found (2, n) of each of so many connected pieces, (2, count)."""
    both, which = np.concatenate(found, axis=1), np.concatenate(pieces)
    ends = np.stack([np.full(count, np.inf), np.full(count, -np.inf)])
    np.minimum.at(ends[0], which, both[0])
    np.maximum.at(ends[1], which, both[1])
    return ends


def _without_arrays(shaped: Shaped) -> Shaped:
    return replace(shaped, lengths=shaped.lengths[:0], smallest=shaped.smallest[:0])


def _mean(sums: Sequence[Floats], patches: Patches) -> float:
    return float(unfolded(np.sum(sums, axis=0))[0] / patches.face_count)


def _counts(patches: Patches, kept: list[Kept], name: str, more: Floats) -> Callable[[Ints, int], Ints]:
    """Return what counts the digits of some numbers of all patches, and of more beside."""

    def counts(digits: Ints, shift: int) -> Ints:
        count = partial(_digits, name=name, digits=digits, shift=shift)
        found: list[Ints] = patches.slabs.fetch(patches.slabs.each(count, kept))
        return np.asarray(np.sum([*found, digits_after(more, digits, shift)], axis=0), np.int64)

    return counts


def _digits(shaped: Shaped, name: str, digits: Ints, shift: int) -> Ints:
    return digits_after(getattr(shaped, name), digits, shift)
