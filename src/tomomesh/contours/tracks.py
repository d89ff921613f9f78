"""Which part of a slice's inside goes on as which from slice to slice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ..measure.matching import SHARED, matched, similar
from .curves import mask_of, moments_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .curves import Moments

    Floats = NDArray[np.float64]

STEEP = 2.0
"""Farthest that a part moves sideways to the next slice, in distances of the slices, where the two do not overlap.
Chosen: half and twice of it change no case of benchmarks/constants.py."""
COARSE = 48
"""Pixels across two parts on which overlaps are counted, at most. Chosen: half and twice of it change no case of
benchmarks/constants.py."""


@dataclass(frozen=True)
class Part:
    """A connected part of a slice's inside.

    Attributes
    ----------
    curves : sequence of (u, 2) float arrays
        Its outer curve and its holes, the inside on the left.
    moments : Moments
    low, high : (2,) float arrays
        Its box.
    """

    curves: Sequence[Floats]
    moments: Moments
    low: Floats
    high: Floats

    @classmethod
    def within(cls, curves: Sequence[Floats]) -> Part:
        """Measure the part within curves."""
        every = np.concatenate(list(curves))
        return cls(curves, moments_of(curves), every.min(axis=0), every.max(axis=0))


@dataclass(frozen=True)
class Link:
    """Parts of one slice that go on as parts of the next; one side is empty where parts end."""

    below: tuple[int, ...]
    above: tuple[int, ...]


def shared_area(one: Part, other: Part, shift: Floats, pixel: float) -> float:
    """Return the area that a shifted part has in common with another, to about a pixel of the outlines."""
    low, high = np.minimum(one.low + shift, other.low), np.maximum(one.high + shift, other.high)
    if ((one.low + shift > other.high) | (other.low > one.high + shift)).any():
        return 0.0
    size = max(pixel, float((high - low).max()) / COARSE)
    box = np.floor(low / size).astype(np.int64) - 1, np.ceil(high / size).astype(np.int64) + 2
    still = np.zeros(2)
    both = mask_of(one.curves, size, *box, shift) & mask_of(other.curves, size, *box, still)
    return float(np.count_nonzero(both)) * size**2


def link_slices(slices: Sequence[Sequence[Part]], heights: Floats, pixel: float) -> list[list[Link]]:
    """Find which parts go on as which.

    First each part has one successor at most, those nearest in place and size over the whole slice (Kuhn 1955). What
    is left over is then a branch where, moved on as it moves on its other side, it overlaps a part of the next slice;
    else it ends.

    Parameters
    ----------
    slices : sequence of sequences of Part
    heights : (s,) float array
    pixel : float
        Finest detail that matters.

    Returns
    -------
    list of lists of Link
        For the space below each slice, and at last that above the last one.
    """
    steps = np.diff(heights)
    pairs = [_successors(slices[k], slices[k + 1], float(steps[k]), pixel) for k in range(len(steps))]
    links = [[Link((), (b,)) for b in range(len(slices[0]))]]
    for k in range(len(steps)):
        branches = _branches(slices, pairs, steps, k, pixel)
        links.append(_joined(pairs[k] + branches, len(slices[k]), len(slices[k + 1])))
    return [*links, [Link((a,), ()) for a in range(len(slices[-1]))]]


def _successors(below: Sequence[Part], above: Sequence[Part], step: float, pixel: float) -> list[tuple[int, int]]:
    cost, like = (
        np.zeros((len(below), len(above))),
        similar(*([part.moments.area for part in one] for one in (below, above))),
    )
    allowed = np.zeros(like.shape, np.bool_)
    for a, one in enumerate(below):
        for b, other in enumerate(above):
            p, q = one.moments, other.moments
            away = float(((p.center - q.center) ** 2).sum())
            near = like[a, b] and away <= (STEEP * step) ** 2
            allowed[a, b] = near or shared_area(one, other, np.zeros(2), pixel) > 0
            cost[a, b] = away + (p.radius - q.radius) ** 2
    return matched(cost, allowed)


def _branches(
    slices: Sequence[Sequence[Part]], pairs: Sequence[Sequence[tuple[int, int]]], steps: Floats, k: int, pixel: float
) -> list[tuple[int, int]]:
    """Join what is left over between slices k and k + 1 to the part that it overlaps most."""
    below, above = slices[k], slices[k + 1]
    found = []
    before = {b: a for a, b in pairs[k - 1]} if k else {}
    after = dict(pairs[k + 1]) if k + 1 < len(pairs) else {}
    for a in sorted(set(range(len(below))) - {a for a, _ in pairs[k]}):
        source = slices[k - 1][before[a]] if a in before else below[a]
        b = _covering(below[a], source, steps[k] / steps[k - 1] if k else 0.0, above, pixel)
        found += [(a, b)] if b >= 0 else []
    for b in sorted(set(range(len(above))) - {b for _, b in pairs[k]}):
        source = slices[k + 2][after[b]] if b in after else above[b]
        a = _covering(above[b], source, steps[k] / steps[k + 1] if b in after else 0.0, below, pixel)
        found += [(a, b)] if a >= 0 else []
    return found


def _covering(part: Part, source: Part, share: float, others: Sequence[Part], pixel: float) -> int:
    """Return the part that one overlaps most when it moves on as it came from its source; -1 where there is none."""
    shift = share * (part.moments.center - source.moments.center)
    shared = [shared_area(part, other, shift, pixel) for other in others]
    best = int(np.argmax(shared)) if shared else -1
    return best if shared and shared[best] > SHARED * part.moments.area else -1


def _joined(pairs: Sequence[tuple[int, int]], below: int, above: int) -> list[Link]:
    one, other = [a for a, _ in pairs], [below + b for _, b in pairs]
    links = sparse.coo_array((np.ones(len(pairs)), (one, other)), shape=(below + above,) * 2)
    count, group = connected_components(links, directed=False)
    numbers = [np.flatnonzero(group == g).tolist() for g in range(count)]
    return [Link(tuple(n for n in g if n < below), tuple(n - below for n in g if n >= below)) for g in numbers]
