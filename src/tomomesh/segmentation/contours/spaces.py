"""The spaces between neighboring slices of rings, and how they are filled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ...kernels.contours.between import blend, carry_along
from ...model.contours import BIRTH, DEATH
from .courses import courses_of
from .insides import insides_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .between import Between
    from .courses import Course
    from .insides import Depths, Insides

    Floats = NDArray[np.float64]

TOUCHING = np.ones((3, 3, 3), bool)
"""Voxels that touch at a corner are of one piece."""


@dataclass(frozen=True)
class Spaces:
    """The spaces above some slices: that below the first slice has number -1, that above what is above the last count.

    Attributes
    ----------
    all : Between
    first : int
        Number of the first slice of `insides`.
    insides : Insides
        Of the slices beside the spaces.
    deep : dict of (J, I) float32 array
        The depths of slices that are blended, if there are slices between them or none beyond.
    courses : dict of lists of Course
        How rings pass, by the space, where there are slices in it.
    """

    all: Between
    first: int
    insides: Insides
    deep: dict[int, Depths]
    courses: dict[int, list[Course]]

    @classmethod
    def of(cls, all: Between, low: int, stop: int) -> Spaces:
        """Look at what the spaces from `low` to before `stop` are made of."""
        count, between = all.frame.shape[0], all.times > 1
        start = min(max(low, 0), count - 1)
        end = max(min(stop + between, count), start + 1)
        insides = insides_of(all.contours, all.mask, all.frame, all.threads, start, end)
        ends = {k for k, space in ((0, -1), (count - 1, count)) if low <= space < stop}
        deep: dict[int, Depths] = {}
        for first, last in [(start, end)] if between else [(k, k + 1) for k in ends]:
            some = insides.only(first - start, last - start)
            deep |= enumerate(some.depths if all.gray is None else all.gray.tempered(some, all.threads), first)
        return cls(all, start, insides, deep, _courses(all, low, stop) if between else {})

    def filled(self, k: int) -> Depths:
        """Return slice k and those up to the next."""
        count, times = self.all.frame.shape[0], self.all.times
        own = 0 <= k < count
        levels = np.empty((times, *self.insides.depths.shape[1:]), np.float32)
        if own:
            levels[0] = self._depths(k)
        if times > 1 or not own:
            below, above = self._closed(k)
            for n in range(int(own), times):
                self._blend(k, below, above, n / times, levels[n])
        if 0 <= k < count - 1 and times > 1:
            _without_specks(levels, self._depths(k + 1))
        return levels

    def _depths(self, k: int) -> Depths:
        return np.asarray(self.insides.depths[k - self.first])

    def _curves(self, k: int) -> dict[int, Floats]:
        return self.insides.curves[k - self.first]

    def _closed(self, k: int) -> tuple[Depths, Depths]:
        """Return the depths of slice k and the next, where what has nothing there lies as far outside as it is deep."""
        count, deep = self.all.frame.shape[0], self.deep
        if k == count:
            return -np.abs(deep[k - 1]), -np.abs(deep[k - 1])
        if k + 1 == count or not self._curves(k + 1):
            return deep[k], -np.abs(deep[k])
        if k < 0 or not self._curves(k):
            return -np.abs(deep[k + 1]), deep[k + 1]
        below, above = deep[k].copy(), deep[k + 1].copy()
        self._close(self.all.ended.get((DEATH, k), []), k, above)
        self._close(self.all.ended.get((BIRTH, k + 1), []), k + 1, below)
        return below, above

    def _close(self, tracks: list[int], k: int, beside: Depths) -> None:
        """Let rings of slice k that have nothing beside them go on for half of the way."""
        for track in tracks:
            curve, hole = self._curves(k)[track], track in self.all.holes
            low = np.maximum(np.floor(curve.min(axis=0)).astype(np.int64) - 1, 0)
            high = np.ceil(curve.max(axis=0)).astype(np.int64) + 2
            window = slice(low[1], high[1]), slice(low[0], high[0])
            own, other = self.deep[k][window], beside[window]
            within = np.empty(own.shape, np.float32)
            self.insides.draw([np.ascontiguousarray((curve[::-1] if hole else curve) - low)], within)
            if hole:
                np.minimum(other, -own, out=other, where=(within > 0) & (own < 0))
            else:
                np.maximum(other, -own, out=other, where=(within > 0) & (own > 0))

    def _blend(self, k: int, below: Depths, above: Depths, share: float, depths: Depths) -> None:
        """Blend the depths of two slices along the rings that pass between them."""
        passing = [course.at(share) for course in self.courses.get(k, [])]
        points = np.concatenate([np.zeros((0, 2)), *(points for points, _ in passing)])
        ways = np.concatenate([np.zeros((0, 4)), *(ways for _, ways in passing)])
        away, carried = np.empty(depths.shape, np.float32), np.empty((*depths.shape, 4), np.float32)
        carry_along(points, ways, self.insides.pixel, self.insides.reach, away, carried)
        blend(below, above, away, carried, self.insides.reach, share, depths)


def _courses(all: Between, low: int, stop: int) -> dict[int, list[Course]]:
    """Return how rings pass through some spaces; their slopes tell of one slice more on each side."""
    first, end = max(low - 1, 0), min(stop + 2, all.frame.shape[0])
    curves = all.frame.curves(all.contours, first, end)
    return dict(enumerate(courses_of(curves, all.frame.pixel, all.step, all.threads), first))


def _without_specks(levels: Depths, after: Depths) -> None:
    """Turn over what lies between two slices alone: `levels` are those from one on, `after` is the next."""
    inside = np.concatenate([levels, after[None]]) > 0
    for part, touching in ((inside, TOUCHING), (~inside, None)):
        labels, count = scipy.ndimage.label(part, touching)
        known = np.zeros(count + 1, bool)
        known[labels[0]] = known[labels[-1]] = known[0] = True
        np.negative(levels, out=levels, where=~known[labels[:-1]])
