"""From the points of one slice to the closed rings around its inside, whatever their sampling and its gaps.

The strategy: a contour that is sampled well runs along sides of the Delaunay triangles of its points, along none that
is the longest of a triangle (Urquhart 1980). Those sides that are short beside the sampling around them are barriers;
the triangles fall into regions that no barrier parts, and a region is inside where an odd number of barriers parts it
from the outside. Contours that do not close yet may have longer barriers, step by step, and to one that does only where
nothing
else closes them.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..measure.polygon import area, inside

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

REACHES = tuple(2.0 * 1.3**n for n in range(5))
"""Lengths of barriers that are tried, in local sampling distances: from twice to some six times. Chosen: half of it
changes nothing, with twice of it the stack is not found."""
CLOSED, OPEN = 0.8, 0.5
"""Shares of a contour's points with two sides: it need not be closed further; it counts as open where fewer have.
Chosen: half and twice of them change no case of benchmarks/constants.py."""
LEAST = 6
"""Points that a contour has at least. Chosen: half and twice of it change no case of benchmarks/constants.py."""
STIRRED = 1e-3
"""Share of the mean distance by which points are moved before they are triangulated: thousands of points on one circle
would take seconds. Chosen: half and twice of it change no case of benchmarks/constants.py."""
BIG = 1_000_000
"""More than the barriers between any two regions."""


@dataclass(frozen=True)
class Outline:
    """The inside of a slice.

    Attributes
    ----------
    rings : list of (u,) int64 array
        Numbers of the points along each ring, the inside on the left.
    parts : list of int
        The connected part of the inside that each ring bounds.
    open : list of (p,) int64 array
        Points of each contour that does not close.
    reach : float
        The longest barrier that closed a contour, in local sampling distances.
    """

    rings: list[NDArray[np.int64]]
    parts: list[int]
    open: list[NDArray[np.int64]]
    reach: float


def outline(points: NDArray[np.float64]) -> Outline:
    """Find the inside of a slice and the rings around it.

    Parameters
    ----------
    points : (n, 2) float array
        Each once; their order decides nothing but ties.

    Returns
    -------
    Outline
    """
    if len(points) < LEAST or np.linalg.matrix_rank(points - points[0], tol=1e-9 * np.ptp(points)) < 2:
        return Outline([], [], [np.arange(len(points))] if len(points) >= LEAST else [], 0.0)
    web = _Web.over(points)
    barriers = np.zeros(web.length.shape, np.bool_)
    pending, reach = np.ones(len(points), np.bool_), 0.0
    for to_others, step in product((False, True), REACHES):
        grown = barriers | (web.candidate & (web.length <= step * web.scale) & web.among(pending, to_others))
        reach = step if (grown != barriers).any() else reach
        barriers = grown
        contour, share = web.shares(barriers)
        pending = ((share < CLOSED) | (np.bincount(contour) < LEAST))[contour]
        if not pending.any():
            break
    numbers = np.arange(len(points))
    opened = [numbers[contour == c] for c in np.flatnonzero((share < OPEN) & (np.bincount(contour) >= LEAST))]
    rings, parts = web.rings(barriers)
    return Outline(rings, parts, opened, reach)


def nested(curves: Sequence[NDArray[np.float64]]) -> Outline:
    """Find which closed curves bound the inside of a slice, and which of them bound one part of it.

    A place is inside where the curves wind around it in all, those with the inside on their left once forward: so
    curves within others count by turns, outer border and hole, and an outer border within another counts for nothing.

    Parameters
    ----------
    curves : sequence of (u, 2) float arrays
        The inside on the left. They should not cross.

    Returns
    -------
    Outline
        Its numbers are of the points of all curves, one after the other.
    """
    first = np.cumsum([0, *map(len, curves)])
    areas = np.array([area(curve) for curve in curves])
    turn = np.sign(areas).astype(np.int64)
    within = _within(curves, np.abs(areas))
    around = within @ turn
    bounding = (around > 0) != (around + turn > 0)
    rings, parts = [], []
    for n in np.flatnonzero(bounding).tolist():
        outer = np.flatnonzero(within[n] & bounding & (turn > 0))
        part = n if turn[n] > 0 else int(outer[np.argmin(areas[outer])])
        rings.append(np.arange(first[n], first[n + 1]))
        parts.append(part)
    return Outline(rings, parts, [], 0.0)


def holes(curves: Sequence[NDArray[np.float64]]) -> NDArray[np.bool_]:
    """Tell which closed curves (u, 2) are holes: those within an odd number of others."""
    areas = np.array([abs(area(curve)) for curve in curves])
    return np.asarray(_within(curves, areas).sum(axis=1) % 2 == 1)


def _within(curves: Sequence[NDArray[np.float64]], areas: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which curves (one a row) lie within which others, by most of their points."""
    low, high = (np.array([end(curve, axis=0) for curve in curves]) for end in (np.min, np.max))
    apart = (low[:, None] > high[None]).any(axis=2) | (high[:, None] < low[None]).any(axis=2)
    found = ~apart & (areas[:, None] < areas[None, :])
    for one, other in np.argwhere(found).tolist():
        found[one, other] = inside(curves[other], curves[one]).mean() > 0.5
    return np.asarray(found)


@dataclass(frozen=True)
class _Web:
    """Delaunay triangles of points and a frame far around them; side i of a triangle is opposite its corner i.

    `ends` (t, 3, 2) are the corners of each side, `beyond` (t, 3) the triangle across, or the first one: a corner of
    the frame, where there is none.
    """

    count: int
    ends: NDArray[np.int64]
    beyond: NDArray[np.int64]
    length: NDArray[np.float64]
    scale: NDArray[np.float64]
    candidate: NDArray[np.bool_]
    outer: int

    @classmethod
    def over(cls, points: NDArray[np.float64]) -> _Web:
        low, high = points.min(axis=0), points.max(axis=0)
        wide = float((high - low).max())
        # three widths away from the middle: what closes the web outside is no part of a contour
        frame = (low + high) / 2 + 3.0 * wide * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        placed = np.concatenate([points, frame])
        stirred = np.random.default_rng(0).uniform(-STIRRED, STIRRED, points.shape) * (wide / len(points))
        found = scipy.spatial.Delaunay(np.concatenate([points + stirred, frame]))
        corners = found.simplices.astype(np.int64)
        ends = np.stack([corners[:, [1, 2, 0]], corners[:, [2, 0, 1]]], axis=2)
        length = np.sqrt(((placed[ends[:, :, 0]] - placed[ends[:, :, 1]]) ** 2).sum(axis=2))
        framed = (corners >= len(points)).any(axis=1)
        outer = int(np.flatnonzero(framed)[0])
        beyond = np.where(found.neighbors < 0, outer, found.neighbors).astype(np.int64)
        longest = np.argmax(length, axis=1)[:, None] == np.arange(3)
        local = np.asarray(scipy.spatial.cKDTree(placed).query(placed, k=[3])[0])[:, 0]
        candidate = ~longest & ~_across(longest, ends, len(placed)) & (ends < len(points)).all(axis=2)
        return cls(len(points), ends, beyond, length, local[ends].min(axis=2), candidate, outer)

    def among(self, chosen: NDArray[np.bool_], to_others: bool) -> NDArray[np.bool_]:
        """Tell which sides run between two of the chosen points, or to others too."""
        ends = np.concatenate([chosen, np.zeros(4, np.bool_)])[self.ends]
        return np.asarray(ends.any(axis=2) if to_others else ends.all(axis=2))

    def regions(self, barriers: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Return the region of each triangle; barriers part them."""
        rows = np.broadcast_to(np.arange(len(barriers))[:, None], barriers.shape)
        return _linked(rows[~barriers], self.beyond[~barriers], len(barriers))

    def shares(self, barriers: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the contour of each point, and the share of each contour's points with two sides."""
        region = self.regions(barriers)
        contour = _linked(self.ends[barriers][:, 0], self.ends[barriers][:, 1], self.count)
        parting = barriers & (region[:, None] != region[self.beyond])
        sided = np.zeros(self.count, np.bool_)
        sided[self.ends[parting].ravel()] = True
        return contour, np.bincount(contour, sided) / np.bincount(contour)

    def inside(self, barriers: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Tell which triangles an odd number of barriers parts from the outside."""
        region = self.regions(barriers)
        one = np.broadcast_to(region[:, None], barriers.shape)[barriers]
        other = region[self.beyond][barriers]
        depth = np.full(int(region.max()) + 1, BIG)
        depth[region[self.outer]] = 0
        for _ in range(len(depth)):
            before = depth.copy()
            np.minimum.at(depth, one, before[other] + 1)
            if (before == depth).all():
                break
        return np.asarray((depth[region] % 2 == 1) & (depth[region] < BIG))

    def rings(self, barriers: NDArray[np.bool_]) -> tuple[list[NDArray[np.int64]], list[int]]:
        """Follow the sides between inside and outside around every part of the inside."""
        inside = self.inside(barriers)
        rows = np.broadcast_to(np.arange(len(barriers))[:, None], barriers.shape)
        joined = inside[:, None] & inside[self.beyond]
        part = _linked(rows[joined], self.beyond[joined], len(barriers))
        border = inside[:, None] & ~inside[self.beyond]
        return _chained(self.ends[border], part[rows[border]])


def _across(marked: NDArray[np.bool_], ends: NDArray[np.int64], count: int) -> NDArray[np.bool_]:
    """Tell which sides are marked in one of their two triangles."""
    keys = ends.min(axis=2) * count + ends.max(axis=2)
    return np.isin(keys, keys[marked])


def _linked(one: NDArray[np.int64], other: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    links = scipy.sparse.coo_array((np.ones(len(one)), (one, other)), shape=(count, count))
    return np.asarray(scipy.sparse.csgraph.connected_components(links, directed=False)[1], np.int64)


def _chained(sides: NDArray[np.int64], part: NDArray[np.int64]) -> tuple[list[NDArray[np.int64]], list[int]]:
    """Chain directed sides (e, 2) of parts (e,) into rings of `LEAST` points or more."""
    following = np.empty(len(sides), np.int64)
    following[np.lexsort((part, sides[:, 1]))] = np.lexsort((part, sides[:, 0]))
    unseen, onward = np.ones(len(sides), np.bool_).tolist(), following.tolist()
    rings, parts = [], []
    for first in range(len(sides)):
        chain, side = [], first
        while unseen[side]:
            unseen[side] = False
            chain.append(side)
            side = onward[side]
        if len(chain) >= LEAST:
            rings.append(sides[chain, 0])
            parts.append(int(part[first]))
    return rings, parts
