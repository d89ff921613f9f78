"""Gray levels in few numbers that add up over slabs, from which percentiles and histograms follow exactly.

Of short integers these are the counts of all levels. Other numbers are looked through once more for each 16 bits of a
percentile: in their order, the bits of numbers are those of integers without a sign, so its first 16 bits follow from
counts of first 16 bits, its next from those of the levels that begin alike, and so on. Nothing is sampled.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from ...model.boxes import Box
    from .cut import Cut

    Ints = NDArray[np.int64]
    Looked = Callable[[NDArray[Any]], Any]
    Each = Callable[[Looked], list[Any]]
    Levels = "Counted | Ordered"

DIGIT = 16
"""Bits that are looked at in one pass: counts of all of them take 512 KiB, and stay in the cache of a core."""
TAILS = (2.0, 0.01)
"""Percents of the levels at each end that have no say in the range of the histogram, tried in turn. 2 % are twice the
hot or metal voxels that the threshold must withstand. Where the rest is one class, a small object may lie in the tails:
then only one level in 10,000 is left out. Chosen: tails of 1 and 4 % move the threshold of no study at hand by more
than a bin."""


def levels_of(levels: Levels | NDArray[Any]) -> Levels:
    """Look at gray levels in memory, of any shape; what was looked at stays as it is."""
    return levels if isinstance(levels, Counted | Ordered) else gathered(lambda work: [work(levels)])


def levels_in(cut: Cut, layer: int | None = None) -> Levels:
    """Look at the gray levels of a study, or of one of its layers."""
    return gathered(lambda work: cut.each(partial(_alone, work, layer)))


def gathered(each: Each) -> Levels:
    """Look at gray levels in slabs.

    Parameters
    ----------
    each : callable
        Has a function of a module, or a partial of one, look at the levels of every slab, one slab at least, in an
        array of any shape; hands over what is found.
    """
    looks = each(_look)
    counts = np.sum([counts for _, counts in looks], axis=0)
    kind = looks[0][0]
    return Counted(counts, int(np.iinfo(kind).min)) if _is_short(kind) else Ordered(counts, kind, each)


def _alone(work: Looked, layer: int | None, levels: NDArray[Any], box: Box) -> Any:
    return work(levels if layer is None else levels[..., layer])


def _is_short(kind: np.dtype[Any]) -> bool:
    return kind.kind in "iu" and 8 * kind.itemsize <= DIGIT


def _look(levels: NDArray[Any]) -> tuple[np.dtype[Any], Ints]:
    """Count levels by the first bits of their keys, which are all that short integers have."""
    levels = _plain(levels)
    return levels.dtype, _digits(levels, [0], 0)[0]


def _plain(levels: NDArray[Any]) -> NDArray[Any]:
    """Take truths for numbers, and longer floats than of 64 bits for those."""
    levels = levels.view(np.uint8) if levels.dtype.kind == "b" else levels
    return levels.astype(np.float64) if levels.dtype.itemsize > 8 else levels


def _digits(levels: NDArray[Any], begun: Sequence[int], depth: int) -> Ints:
    """Count levels whose keys begin with some digits by their next digit, (b, 65536); of 8 bits there are 256."""
    levels = _plain(levels)
    kind, width = levels.dtype, 8 * levels.dtype.itemsize
    bits, digit = levels.view(f"{kind.byteorder}u{kind.itemsize}"), min(width, DIGIT)
    below = width - digit * (depth + 1)
    heads = bits >> (below + digit) if depth else bits
    counts = np.empty((len(begun), 1 << digit), np.int64)
    for n, first in enumerate(begun):
        held = bits[heads == _turned(first, digit * depth, kind)] if depth else bits
        held = (held >> below) & ((1 << digit) - 1) if width > digit else held
        found = np.bincount(held.ravel().astype(np.int64), minlength=1 << digit)
        counts[n] = _in_order(found, first >> (digit * depth - 1) if depth else None, kind)
    return counts


def _turned(key: int, width: int, kind: np.dtype[Any]) -> int:
    """Return the first bits of levels, so many, whose keys begin with others.

    Keys are integers without a sign in the order of the levels; NaN lies beyond what is infinite.
    """
    first = 1 << (width - 1)
    if kind.kind == "u":
        return key
    return key ^ first if kind.kind == "i" or key & first else key ^ (2 * first - 1)


def _in_order(counts: Ints, sign: int | None, kind: np.dtype[Any]) -> Ints:
    """Bring counts of digits into the order of keys: of first digits, or of those of keys whose first bit is known."""
    if sign is not None:
        return counts[::-1] if kind.kind == "f" and not sign else counts
    low, high = np.split(counts, 2)
    return counts if kind.kind == "u" else np.concatenate([high[::-1] if kind.kind == "f" else high, low])


def _key(level: float, kind: np.dtype[Any]) -> int:
    """Return the key of a level."""
    bits = int(np.array([level], f"{kind.kind}{kind.itemsize}").view(f"u{kind.itemsize}")[0])
    first = 1 << (8 * kind.itemsize - 1)
    return (
        _turned(bits, 8 * kind.itemsize, kind)
        if kind.kind != "f"
        else bits ^ (2 * first - 1 if bits & first else first)
    )


def _level(key: int, kind: np.dtype[Any]) -> float:
    """Return the level of a key."""
    bits = np.array([_turned(key, 8 * kind.itemsize, kind)], f"u{kind.itemsize}")
    return float(bits.view(f"{kind.kind}{kind.itemsize}")[0])


@dataclass(frozen=True)
class Counted:
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
    def finite(self) -> Counted:
        """What is finite of it."""
        return self

    def count(self, levels: Sequence[float]) -> list[int]:
        """Count levels that are held."""
        return [int(self.counts[int(level) - self.base]) for level in levels]

    def without(self, level: float) -> Counted:
        """Return all but a level."""
        return Counted(np.where(np.arange(len(self.counts)) + self.base == level, 0, self.counts), self.base)

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
    each : callable
        As of `gathered`.
    absent : mapping of int to int
        Keys of what is left out, and how often each is seen.
    """

    heads: Ints
    kind: np.dtype[Any]
    each: Each
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
        low, high = (_key(end, self.kind) >> (8 * self.kind.itemsize - DIGIT) for end in (-np.inf, np.inf))
        heads = np.zeros_like(self.heads)
        heads[low + 1 : high] = self.heads[low + 1 : high]
        return replace(self, heads=heads)

    def count(self, levels: Sequence[float]) -> list[int]:
        """Count levels."""
        return np.sum(self.each(partial(_count, sought=levels)), axis=0).tolist()

    def without(self, level: float) -> Ordered:
        """Return all but a level."""
        keys = sorted({_key(one, self.kind) for one in ((0.0, -0.0) if level == 0 else (level,))})
        bits = [_turned(key, 8 * self.kind.itemsize, self.kind) for key in keys]
        absent = dict(zip(keys, np.sum(self.each(partial(_count_bits, sought=bits)), axis=0).tolist(), strict=True))
        return replace(self, heads=self._less(self.heads[None], [0], 0, absent)[0], absent=absent)

    def bulk(self, tail: float = TAILS[0]) -> tuple[float, float]:
        """Return the percentiles that leave out so many percent of the levels at each end; levels that are held."""
        return self._bulks[tail]

    @cached_property
    def _bulks(self) -> dict[float, tuple[float, float]]:
        tails = (0.0, *TAILS)
        shares = np.array([(tail, 100 - tail) for tail in tails]) / 100
        ranks = np.ceil(shares * self.size - 1).clip(0).astype(np.int64)
        levels = [_level(key, self.kind) for key in self._keys_at(ranks.ravel())]
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
                counts = np.sum(self.each(partial(_digits, begun=begun, depth=depth)), axis=0)
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
        gone = np.array([_level(key, self.kind) for key in self.absent], self.kind)
        less = np.histogram(gone, bins, (low, high), weights=np.array([*self.absent.values()], np.int64))[0]
        return np.sum(self.each(partial(_histogram, low=low, high=high, bins=bins)), axis=0) - less.astype(np.int64)


def _count(levels: NDArray[Any], *, sought: Sequence[float]) -> list[int]:
    return [int(np.count_nonzero(levels == level)) for level in sought]


def _count_bits(levels: NDArray[Any], *, sought: Sequence[int]) -> list[int]:
    levels = _plain(levels)
    bits = levels.view(f"{levels.dtype.byteorder}u{levels.dtype.itemsize}")
    return [int(np.count_nonzero(bits == one)) for one in sought]


def _histogram(levels: NDArray[Any], *, low: float, high: float, bins: int) -> Ints:
    return np.histogram(levels, bins, (low, high))[0].astype(np.int64)
