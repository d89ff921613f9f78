"""Gray levels in few numbers that add up over slabs, from which percentiles and histograms follow exactly.

Of short integers these are the counts of all levels. Other numbers are looked through once more for each 16 bits of a
percentile: in their order, the bits of numbers are those of integers without a sign, so its first 16 bits follow from
counts of first 16 bits, its next from those of the levels that begin alike, and so on. Nothing is sampled.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from .keys import DIGIT, bits_of, count_bits, digit_counts, key_of, level_of, plain

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    Ints = NDArray[np.int64]
    Looked = Callable[[NDArray[Any]], Any]
    Sum = Callable[[Looked], Any]
    Levels: TypeAlias = "LevelCounts | Ordered"

TAILS = (2.0, 0.01)
"""Percents of the levels at each end that have no say in the range of the histogram, tried in turn. 2 % are twice the
hot or metal voxels that the threshold must withstand. Where the rest is one class, a small object may lie in the tails:
then only one level in 10,000 is left out. Chosen: tails of 1 and 4 % move the threshold of no study at hand by more
than a bin."""


def levels_of(levels: Levels | NDArray[Any]) -> Levels:
    """Look at gray levels in memory, of any shape; what was looked at stays as it is."""
    return levels if isinstance(levels, LevelCounts | Ordered) else gathered(lambda work: work(levels), levels.dtype)


def gathered(total: Sum, dtype: np.dtype[Any]) -> Levels:
    """Look at gray levels in slabs.

    Parameters
    ----------
    total : callable
        Has a function of a module, or a partial of one, look at the levels of every slab, one slab at least, in an
        array of any shape; adds up the arrays of numbers that are found.
    dtype : dtype
        Of the levels.
    """
    kind, counts = plain(np.empty(0, dtype)).dtype, total(partial(digit_counts, begun=[0], depth=0))[0]
    short = kind.kind in "iu" and 8 * kind.itemsize <= DIGIT
    return LevelCounts(counts, int(np.iinfo(kind).min)) if short else Ordered(counts, kind, total)


@dataclass(frozen=True)
class LevelCounts:
    """How many there are of each level.

    Attributes
    ----------
    counts : (n,) int64 array
    base : int
        The level that is counted first.
    """

    counts: Ints
    base: int

    @cached_property
    def present(self) -> Ints:
        """The levels that are held, rising."""
        return np.flatnonzero(self.counts) + self.base

    @property
    def numbers(self) -> Ints:
        """How many there are of each of these."""
        return self.counts[self.present - self.base]

    @cached_property
    def size(self) -> int:
        """How many levels there are."""
        return int(self.counts.sum())

    @property
    def ends(self) -> tuple[float, float]:
        """The lowest and the highest."""
        return float(self.present[0]), float(self.present[-1])

    @property
    def finite(self) -> LevelCounts:
        """What is finite of it."""
        return self

    def count(self, levels: Sequence[float]) -> list[int]:
        """Count levels that are held."""
        return [int(self.counts[int(level) - self.base]) for level in levels]

    def within(self, windows: Sequence[tuple[float, float]]) -> list[int]:
        """Count the levels above a first bound and up to a second, for several windows."""
        return [int(self.numbers[(self.present > low) & (self.present <= high)].sum()) for low, high in windows]

    def without(self, level: float) -> LevelCounts:
        """Return all but a level."""
        return LevelCounts(np.where(np.arange(len(self.counts)) + self.base == level, 0, self.counts), self.base)

    def bulk(self, tail: float = TAILS[0]) -> tuple[float, float]:
        """Return the percentiles that leave out so many percent of the levels at each end; levels that are held."""
        ranks = np.searchsorted(np.cumsum(self.numbers), np.array([tail, 100 - tail]) / 100 * self.size)
        return float(self.present[ranks[0]]), float(self.present[ranks[1]])

    def histogram(self, low: float, high: float, bins: int) -> Ints:
        """Count the levels in equal bins."""
        return np.histogram(self.present, bins, (low, high), weights=self.numbers)[0].astype(np.int64)


@dataclass(frozen=True)
class Ordered:
    """Levels of more than 16 bits, which are looked at again for what is asked of them.

    Attributes
    ----------
    heads : (65536,) int64 array
        How many levels there are by the first 16 bits of their keys.
    kind : dtype
    total : callable
        As of `gathered`.
    absent : mapping of int to int
        Keys of what is left out, and how often each is seen.
    """

    heads: Ints
    kind: np.dtype[Any]
    total: Sum
    absent: Mapping[int, int] = field(default_factory=dict)

    @cached_property
    def size(self) -> int:
        """How many levels there are."""
        return int(self.heads.sum())

    @property
    def ends(self) -> tuple[float, float]:
        """The lowest and the highest; NaN where there is one."""
        return self.bulk(0.0)

    @cached_property
    def finite(self) -> Ordered:
        """What is finite of it."""
        if self.kind.kind != "f":
            return self
        low, high = (key_of(end, self.kind) >> (8 * self.kind.itemsize - DIGIT) for end in (-np.inf, np.inf))
        heads = np.zeros_like(self.heads)
        heads[low + 1 : high] = self.heads[low + 1 : high]
        return replace(self, heads=heads)

    def count(self, levels: Sequence[float]) -> list[int]:
        """Count levels."""
        return [int(count) for count in self.total(partial(_count, sought=levels))]

    def within(self, windows: Sequence[tuple[float, float]]) -> list[int]:
        """Count the levels above a first bound and up to a second, for several windows."""
        gone = [(level_of(key, self.kind), number) for key, number in self.absent.items()]
        less = [sum(number for level, number in gone if low < level <= high) for low, high in windows]
        return [int(count) for count in self.total(partial(_within, windows=windows)) - np.array(less)]

    def without(self, level: float) -> Ordered:
        """Return all but a level."""
        keys = sorted({key_of(one, self.kind) for one in ((0.0, -0.0) if level == 0 else (level,))})
        bits = [bits_of(key, 8 * self.kind.itemsize, self.kind) for key in keys]
        absent = dict(zip(keys, self.total(partial(count_bits, sought=bits)).tolist(), strict=True))
        return replace(self, heads=self._less(self.heads[None], [0], 0, absent)[0], absent=absent)

    def bulk(self, tail: float = TAILS[0]) -> tuple[float, float]:
        """Return the percentiles that leave out so many percent of the levels at each end; levels that are held."""
        return self._bulks[tail]

    @cached_property
    def _bulks(self) -> dict[float, tuple[float, float]]:
        tails = (0.0, *TAILS)
        shares = np.array([(tail, 100 - tail) for tail in tails]) / 100
        ranks = np.ceil(shares * self.size - 1).clip(0).astype(np.int64)
        levels = [level_of(key, self.kind) for key in self._keys_at(ranks.ravel())]
        if np.isnan([levels[0], levels[1]]).any():  # as NaN lies beyond all others
            levels = [np.nan] * len(levels)
        return dict(zip(tails, zip(levels[::2], levels[1::2], strict=True), strict=True))

    def _keys_at(self, ranks: Ints) -> list[int]:
        """Return the keys at places in the order of all levels."""
        keys, left = [0] * len(ranks), ranks.tolist()
        counts, begun = self.heads[None], [0]
        for depth in range(8 * self.kind.itemsize // DIGIT):
            if depth:
                begun = sorted(set(keys))
                counts = self.total(partial(digit_counts, begun=begun, depth=depth))
                counts = self._less(counts, begun, depth, self.absent)
            number = np.cumsum(counts, axis=1)
            for n, key in enumerate(keys):
                row = number[begun.index(key)]
                digit = int(np.searchsorted(row, left[n], "right"))
                left[n] -= int(row[digit - 1]) if digit else 0
                keys[n] = (key << DIGIT) + digit
        return keys

    def _less(self, counts: Ints, begun: Sequence[int], depth: int, absent: Mapping[int, int]) -> Ints:
        """Take away what is left out from counts of a digit (b, 65536) behind others."""
        counts = counts.copy()
        below = 8 * self.kind.itemsize - DIGIT * (depth + 1)
        for key, number in absent.items():
            first, digit = divmod(key >> below, 1 << DIGIT)
            if first in begun:
                counts[begun.index(first), digit] -= number
        return counts

    def histogram(self, low: float, high: float, bins: int) -> Ints:
        """Count the levels in equal bins."""
        gone = np.array([level_of(key, self.kind) for key in self.absent], self.kind)
        less = np.histogram(gone, bins, (low, high), weights=np.array([*self.absent.values()], np.int64))[0]
        every = self.total(partial(_histogram, low=low, high=high, bins=bins))
        return np.asarray(every - less.astype(np.int64))


def _count(levels: NDArray[Any], *, sought: Sequence[float]) -> Ints:
    return np.array([np.count_nonzero(levels == level) for level in sought])


def _within(levels: NDArray[Any], *, windows: Sequence[tuple[float, float]]) -> Ints:
    return np.array([np.count_nonzero((levels > low) & (levels <= high)) for low, high in windows])


def _histogram(levels: NDArray[Any], *, low: float, high: float, bins: int) -> Ints:
    return np.histogram(levels, bins, (low, high))[0].astype(np.int64)
