"""Where rings pass between the slices: point to point along their tracks."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ...kernels.contours.between import match_rings
from ...kernels.threads import in_blocks
from ...measure.polygon import along, evenly
from ...model.cubics import cubic, limited

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Indices = NDArray[np.int64]

FEWEST = 4
"""Points of a ring at least; else there is one a pixel. Chosen: half and twice change nothing."""
STEEP = 1.5
"""Farthest that a point moves to the next slice, in distances of the slices. Chosen, on a skull in slabs of 4 mm: half
of it changes the distance by +0.6 %, twice by -0.4 % and the turn from face to face by +4.3 %."""
WINDOW, STRETCH = 4, 2.0
"""Points before and after one over which a ring must not grow or shrink by more than this factor: where it does, a bay
opens or closes, and its bottom does not come from its mouth. Chosen: half and twice of the points change the distance
by +0.2 %, a factor of 1 by +0.7 % and of 4 by 0.0 %."""


@dataclass(frozen=True)
class Course:
    """Points of a ring on its way from one slice to the next.

    Attributes
    ----------
    below, above : (p, 2) float array
        Points in pixels, those of one row belonging together.
    rising, reaching : (p, 2) float array
        Slopes at both, in pixels a slice.
    """

    below: Floats
    above: Floats
    rising: Floats
    reaching: Floats

    def at(self, share: float) -> tuple[Floats, Floats]:
        """Return where the points pass, (p, 2), and the ways from there to the slices below and above, (p, 4).

        A cubic of given slopes (Hermite), so that rings bend over more than two slices.
        """
        points = cubic(share, 1.0, self.below, self.above, self.rising, self.reaching)
        return points, np.concatenate([self.below - points, self.above - points], axis=1)


def courses_of(curves: Sequence[dict[int, Floats]], pixel: Floats, step: float, threads: int = 0) -> list[list[Course]]:
    """Match the points of each ring to those of the next on its track, and find how they pass between the slices.

    Parameters
    ----------
    curves : sequence of dict
        Of each slice, as those of `Insides`.
    pixel : (2,) float array
    step : float
        Distance of the slices.
    threads : int

    Returns
    -------
    list of lists of Course
        For the space above each slice; none above the last. Of some slices of a study, all but those above the first
        and the last but one are those of the whole.
    """
    points = [{track: _even(curve, pixel) for track, curve in row.items()} for row in curves]
    gaps = [sorted(set(row) & set(after)) for row, after in pairwise(points)]
    pairs: list[dict[int, Indices]] = [{} for _ in gaps]

    def work(start: int, stop: int) -> None:
        for k in range(start, stop):
            for track in gaps[k]:
                pairs[k][track] = _matched(points[k][track] * pixel, points[k + 1][track] * pixel)

    in_blocks(work, len(gaps), block=1, threads=threads)
    slopes = _slopes(points, pairs)
    return [
        [_course(points, slopes, k, track, pairs[k][track], pixel, step) for track in gaps[k]] for k in range(len(gaps))
    ]


def _even(curve: Floats, pixel: Floats) -> Floats:
    """Return points a pixel apart along a closed curve (p, 2)."""
    closed = np.concatenate([curve, curve[:1]]) * pixel
    count = max(int(np.ceil(along(closed)[-1] / pixel.min())), FEWEST)
    return evenly(closed, count + 1)[:-1] / pixel


def _matched(one: Floats, other: Floats) -> Indices:
    """Return which points of two closed curves belong together, (p, 2)."""
    n, m = len(one), len(other)
    pairs = np.empty((n + m, 2), np.int64)
    count = match_rings(one, other, np.empty((n + 1, m + 1), np.int8), np.empty(m + 1), pairs)
    return pairs[:count]


def _slopes(points: list[dict[int, Floats]], pairs: list[dict[int, Indices]]) -> list[dict[int, Floats]]:
    """Return the slope of every point that goes on, in pixels a slice: as a mean of its ways up and down."""
    ups: list[dict[int, Floats]] = [{} for _ in points]
    downs: list[dict[int, Floats]] = [{} for _ in points]
    for k, row in enumerate(pairs):
        for track, (a, b) in ((track, found.T) for track, found in row.items()):
            way = points[k + 1][track][b] - points[k][track][a]
            ups[k][track], downs[k + 1][track] = _means(way, a), _means(way, b)
    return [
        {**up, **down, **{t: limited(up[t], down[t]) for t in up.keys() & down.keys()}}
        for up, down in zip(ups, downs, strict=True)
    ]


def _means(way: Floats, at: Indices) -> Floats:
    """Average ways (p, 2) over the points that they are of, of which each has one at least."""
    count = np.bincount(at)
    return np.stack([np.bincount(at, axis) / count for axis in way.T], axis=1)


def _course(
    points: list[dict[int, Floats]], slopes: list[dict[int, Floats]], k: int, track: int, pairs: Indices,
    pixel: Floats, step: float,
) -> Course:  # fmt: skip
    """Keep the points that can be followed from slice k to the next."""
    a, b = pairs.T
    below, above = points[k][track][a], points[k + 1][track][b]
    moved = np.sqrt((((above - below) * pixel) ** 2).sum(axis=1))
    one, other = (_around(line * pixel) for line in (below, above))
    kept = (moved <= STEEP * step) & (one <= STRETCH * other) & (other <= STRETCH * one)
    return Course(below[kept], above[kept], slopes[k][track][a[kept]], slopes[k + 1][track][b[kept]])


def _around(line: Floats) -> Floats:
    """Return how long a closed line (p, 2) is around each of its points."""
    step = np.sqrt(((np.roll(line, -1, axis=0) - line) ** 2).sum(axis=1))
    return np.asarray(np.sum([np.roll(step, n) for n in range(-WINDOW, WINDOW)], axis=0))
