"""Which part of a slice's inside goes on as which on another slice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..measure.matching import SHARED, matched, similar
from .endings import parabola, pole
from .parts import shared_area

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .parts import Part

    Floats = NDArray[np.float64]

STEEP = 2.0
"""Farthest that a part moves sideways to the next slice, in distances of the slices, where the two do not overlap.
Chosen: half and twice of it change no case of benchmarks/constants.py."""
NEXT, MISSING = 1.5, 4.5
"""Distances of slices within which a part goes on in any case, and within which it may go on over slices that are
missing: three at most. Chosen: with half of the first slices that jitter by a quarter part, with twice of it two
objects one slice apart join; with half of the second three missing slices part a ball, with twice of it two
nodules that neither taper nor touch are one."""
LOOK = 24
"""Sliced beyond a part in which it is looked for, those of other objects among them."""
NOT, WITHIN, OVER = 0, 1, 2
"""How a part may go on as another: not at all; lying in its hole, for want of a better one; over it or beside it."""


@dataclass(frozen=True)
class Link:
    """Parts of one plane that go on as parts of another above it, by number; one side is empty where parts end."""

    below: tuple[int, ...]
    above: tuple[int, ...]


def link_parts(
    parts: Sequence[Part], groups: NDArray[np.int64], pixel: float, *, complete: bool, sparse: bool = False
) -> list[Link]:
    """Find which parts go on as which.

    A part goes on in the nearest plane of its group that holds something it overlaps, or something like it nearby;
    planes of other objects lie between. Parts of two planes that seek each other have one successor at most, those
    nearest in place and size over the whole slice (Kuhn 1955). What is left over is then a branch where, moved on as it
    moves on its other side, it overlaps a part of the other plane; else it ends.

    Parameters
    ----------
    parts : sequence of Part
        By rising plane.
    groups : (s,) int64 array
        The group of each plane.
    pixel : float
        Finest detail that matters.
    complete : bool
        Whether what is not on the next plane ends.
    sparse : bool
        Whether a part may go on in the next plane of its group however far that is.

    Returns
    -------
    list of Link
        Those below what begins, those between, those above what ends; by rising plane.
    """
    near = _Neighbors(parts, _layers(parts, groups), pixel, complete, sparse)
    sought = _sought(near)
    pairs = [pair for key in sorted(sought) for pair in near.successors(*sought[key])]
    pairs += _branches(near, sought, pairs)
    return _links(parts, pairs)


def _layers(parts: Sequence[Part], groups: NDArray[np.int64]) -> list[list[list[int]]]:
    """Gather the parts of each plane, planes by group."""
    planes: dict[int, dict[int, list[int]]] = {}
    for n, part in enumerate(parts):
        planes.setdefault(int(groups[part.plane]), {}).setdefault(part.plane, []).append(n)
    return [list(one.values()) for one in planes.values()]


def _sought(near: _Neighbors) -> dict[tuple[int, int], tuple[list[int], list[int]]]:
    """Return the parts of a lower plane that seek a part in an upper one, and those that seek one in the lower."""
    found: dict[tuple[int, int], tuple[list[int], list[int]]] = {}
    for n, part in enumerate(near.parts):
        for way in (1, -1):
            plane = near.onward(n, way)
            if plane >= 0:
                key = (part.plane, plane) if way > 0 else (plane, part.plane)
                found.setdefault(key, ([], []))[0 if way > 0 else 1].append(n)
    return found


class _Neighbors:
    """What lies over and under each part."""

    def __init__(
        self, parts: Sequence[Part], groups: list[list[list[int]]], pixel: float, complete: bool, sparse: bool
    ) -> None:
        self.parts, self.groups, self.pixel, self.complete, self.sparse = parts, groups, pixel, complete, sparse
        self.place = {n: (g, k) for g, layers in enumerate(groups) for k, layer in enumerate(layers) for n in layer}
        self.on = {parts[layer[0]].plane: layer for layers in groups for layer in layers}
        self.known: dict[tuple[int, int], int] = {}

    def layers(self, n: int, way: int) -> list[list[int]]:
        """Return the parts of the planes beyond a part, upward or downward, from near to far."""
        g, k = self.place[n]
        numbers = range(k + way, len(self.groups[g]) if way > 0 else -1, way)
        return [self.groups[g][number] for number in numbers[: 1 if self.complete else LOOK]]

    def gap(self, one: int, other: int) -> float:
        """Return how far apart two parts are along the normal."""
        return abs(self.parts[one].height - self.parts[other].height)

    def kind(self, one: int, other: int) -> int:
        """Tell how one part may go on as another: `OVER` it, `WITHIN` its hole, or `NOT`."""
        key = min(one, other), max(one, other)
        if key not in self.known:
            self.known[key] = self._kind(self.parts[key[0]], self.parts[key[1]])
        return self.known[key]

    def _kind(self, one: Part, other: Part) -> int:
        least = 0.0 if self.complete else SHARED * min(one.moments.area, other.moments.area)
        if shared_area(one, other, np.zeros(2), self.pixel) > least:
            return OVER
        like = similar([one.moments.area], [other.moments.area]).all()
        if not like or _away(one, other) > (STEEP * (one.height - other.height)) ** 2:
            return NOT
        return WITHIN if not self.complete and (_around(one, other) or _around(other, one)) else OVER

    def beyond(self, n: int, way: int, least: int) -> list[int]:
        """Return the parts that one may go on as, in the nearest plane that holds any."""
        kinds = ([m for m in layer if self.kind(n, m) >= least] for layer in self.layers(n, way))
        return next((found for found in kinds if found), [])

    def onward(self, n: int, way: int) -> int:
        """Return the plane in which a part goes on; -1 where it ends."""
        over, within = (self.beyond(n, way, least) for least in (OVER, WITHIN))
        if any(self.reaches(n, m, way) for m in over):
            return self.parts[over[0]].plane
        if over != within and any(self.gap(n, m) <= NEXT * self._nearest(n) for m in within):
            return self.parts[within[0]].plane
        return -1

    def reaches(self, n: int, m: int, way: int) -> bool:
        """Tell whether two parts are near enough to be of one body, though slices be missing between them."""
        if self.are_next(n, m, way):
            return True
        gap = self.gap(n, m)
        if max(self._pole(n, way), self._pole(m, -way)) < gap / 2 or self._lies_in(n, m):
            return False
        if self.sparse and not self._are_turns(n, m):
            return True
        near = gap <= MISSING * self._step(n, m, way)
        tapers = self._taper(n, way), self._taper(m, -way)
        return near and min(tapers) >= gap / 2 and (self._meet(n, m, way) or self._meet(m, n, -way))

    def _lies_in(self, n: int, m: int) -> bool:
        """Tell whether one of two parts ends in a hole: the other goes on around it in the planes between."""
        (g, one), (_, other) = self.place[n], self.place[m]
        between = [p for layer in self.groups[g][min(one, other) + 1 : max(one, other)] for p in layer]
        ends = ((self.parts[n], m), (self.parts[m], n))
        return any(_around(self.parts[p], end) and self.kind(p, far) == OVER for p in between for end, far in ends)

    def _meet(self, n: int, m: int, way: int) -> bool:
        """Tell whether a part overlaps another when it moves on as it comes."""
        inward, center = self.beyond(n, -way, OVER), self.parts[n].moments.center
        shift = np.zeros(2)
        if inward:
            source = min(inward, key=lambda one: _away(self.parts[one], self.parts[n]))
            shift = self.gap(n, m) / self.gap(n, source) * (center - self.parts[source].moments.center)
        least = SHARED * min(self.parts[n].moments.area, self.parts[m].moments.area)
        return shared_area(self.parts[n], self.parts[m], shift, self.pixel) > least

    def are_next(self, n: int, m: int, way: int) -> bool:
        """Tell whether no slice is missing between two parts."""
        return self.complete or self.gap(n, m) <= NEXT * self._step(n, m, way)

    def _step(self, n: int, m: int, way: int) -> float:
        """Return the distance of slices on the far sides of two parts; of any neighbors, where they have no such.

        Of two distances it is the wider one where the planes between are other parts': those are contoured in turns.
        """
        far = [self.gap(one, other) for one, w in ((n, -way), (m, way)) for other in self.beyond(one, w, OVER)[:1]]
        if not far:
            return min(self._nearest(n), self._nearest(m))
        return max(far) if self._are_turns(n, m) else min(far)

    def _are_turns(self, n: int, m: int) -> bool:
        """Tell whether a plane of their group lies between two parts."""
        return abs(self.place[n][1] - self.place[m][1]) > 1

    def _nearest(self, n: int) -> float:
        """Return how far the nearest part is that one may go on as."""
        beyond = [m for way in (1, -1) for m in self.beyond(n, way, WITHIN)]
        return min((self.gap(n, m) for m in beyond), default=0.0)

    def _taper(self, n: int, way: int) -> float:
        """Return how far a part goes on before it ends in a cone; one that nothing tells of, as far as it is thick."""
        inward, thick = self.beyond(n, -way, OVER), self.parts[n].thickness
        if not inward:
            return thick
        m = max(inward, key=lambda one: self.parts[one].thickness)
        wider = self.parts[m].thickness - thick
        return self.gap(n, m) * thick / wider if wider > 0 else np.inf

    def _pole(self, n: int, way: int) -> float:
        """Return how far a part goes on before it ends as round as its last slices show it to be."""
        key, inward = n, []
        for _ in range(2):
            beyond = self.beyond(key, -way, OVER)
            if not beyond:
                break
            key = max(beyond, key=lambda one: self.parts[one].thickness)
            inward.append(key)
        if not inward:
            return np.inf
        gaps = tuple(self.gap(n, m) for m in inward)
        squares = tuple((self.parts[m].thickness / self.parts[n].thickness) ** 2 for m in inward)
        return pole(*parabola(gaps, squares))

    def successors(self, below: list[int], above: list[int]) -> list[tuple[int, int]]:
        """Pair the parts of two planes that seek each other."""
        if not below or not above:
            return []
        allowed = np.array([[self.kind(a, b) != NOT for b in above] for a in below])
        cost = np.array([[_cost(self.parts[a], self.parts[b]) for b in above] for a in below])
        return [(below[a], above[b]) for a, b in matched(cost, allowed)]


def _away(one: Part, other: Part) -> float:
    return float(((one.moments.center - other.moments.center) ** 2).sum())


def _around(one: Part, other: Part) -> bool:
    return bool((one.low <= other.low).all() and (one.high >= other.high).all())


def _cost(one: Part, other: Part) -> float:
    return _away(one, other) + (one.moments.radius - other.moments.radius) ** 2


def _branches(
    near: _Neighbors, sought: dict[tuple[int, int], tuple[list[int], list[int]]], pairs: Sequence[tuple[int, int]]
) -> list[tuple[int, int]]:
    """Join what is left over to the part of the plane that it seeks which it overlaps most."""
    before, after = {b: a for a, b in pairs}, dict(pairs)
    found = []
    for (low, high), (below, above) in sorted(sought.items()):
        for n, source, plane in [(a, before.get(a), high) for a in below if a not in after] + [
            (b, after.get(b), low) for b in above if b not in before
        ]:
            m = _covering(near, n, source, near.on[plane])
            found += [(min(n, m), max(n, m))] if m >= 0 else []
    return found


def _covering(near: _Neighbors, n: int, source: int | None, others: Sequence[int]) -> int:
    """Return the part that one overlaps most when it moves on as it came from its source; -1 where there is none."""
    part, shift = near.parts[n], np.zeros(2)
    if source is not None:
        share = near.gap(n, others[0]) / near.gap(n, source)
        shift = share * (part.moments.center - near.parts[source].moments.center)
    shared = [shared_area(part, near.parts[m], shift, near.pixel) for m in others]
    best = int(np.argmax(shared))
    joined = shared[best] > SHARED * part.moments.area and near.reaches(n, others[best], 1 if n < others[best] else -1)
    return others[best] if joined else -1


def _links(parts: Sequence[Part], pairs: Sequence[tuple[int, int]]) -> list[Link]:
    """Gather the pairs of two planes that have a part in common, and the parts that nothing goes on from or to."""
    grouped: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for a, b in sorted(set(pairs)):
        grouped.setdefault((parts[a].plane, parts[b].plane), []).append((a, b))
    links = [link for _, group in sorted(grouped.items()) for link in _joined(group)]
    low, high = {n for link in links for n in link.above}, {n for link in links for n in link.below}
    begins = [Link((), (n,)) for n in range(len(parts)) if n not in low]
    return [*begins, *links, *(Link((n,), ()) for n in range(len(parts)) if n not in high)]


def _joined(pairs: Sequence[tuple[int, int]]) -> list[Link]:
    """Join pairs (below, above) of two planes to links."""
    names = sorted({n for pair in pairs for n in pair})
    one, other = np.searchsorted(names, np.array(pairs).T)
    graph = scipy.sparse.coo_array((np.ones(len(pairs)), (one, other)), shape=(len(names),) * 2)
    count, group = scipy.sparse.csgraph.connected_components(graph, directed=False)
    below = {a for a, _ in pairs}
    sets = [[names[n] for n in np.flatnonzero(group == g)] for g in range(count)]
    return [Link(tuple(n for n in one if n in below), tuple(n for n in one if n not in below)) for one in sets]
