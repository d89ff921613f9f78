"""Gray levels in few numbers that add up over slabs, from which percentiles and histograms follow exactly.

Of short integers these are the counts of all levels. Other numbers are looked through once more for each 16 bits of a
percentile: in their order, the bits of numbers are those of integers without a sign, so its first 16 bits follow from
counts of first 16 bits, its next from those of the levels that begin alike, and so on. Nothing is sampled.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

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


def _keys(levels: NDArray[Any]) -> NDArray[np.unsignedinteger]:
    """Return integers without a sign that are in the order of levels; NaN lies beyond what is infinite."""
    kind = levels.dtype
    bits = levels.view(f"{kind.byteorder}u{kind.itemsize}")
    if kind.kind == "u":
        return bits
    first = 1 << (8 * kind.itemsize - 1)
    return bits ^ first if kind.kind == "i" else np.where(bits & first, ~bits, bits | first)


def _level(key: int, kind: np.dtype[Any]) -> float:
    """Return the level of a key."""
    first = 1 << (8 * kind.itemsize - 1)
    bits = key if kind.kind == "u" or (kind.kind == "f" and key < first) else key ^ first
    held = np.array([bits], f"u{kind.itemsize}")
    return float((~held if kind.kind == "f" and key < first else held).view(f"{kind.kind}{kind.itemsize}")[0])


def _digits(levels: NDArray[Any], begun: Sequence[int], depth: int) -> Ints:
    """Count levels whose keys begin with some digits by their next digit, (b, 65536); short keys have one digit."""
    keys = _keys(_plain(levels))
    bits = min(8 * keys.dtype.itemsize, DIGIT)
    below = 8 * keys.dtype.itemsize - bits * (depth + 1)
    counts = np.empty((len(begun), 1 << bits), np.int64)
    for n, first in enumerate(begun):
        held = keys[keys >> (below + bits) == first] if depth else keys
        digit = (held >> below) & ((1 << bits) - 1) if depth or below else held
        counts[n] = np.bincount(digit.ravel().astype(np.int64), minlength=1 << bits)
    return counts


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

    def count(self, level: float) -> int:
        """Count a level that is held."""
        return int(self.counts[int(level) - self.base])

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
    """

    heads: Ints
    kind: np.dtype[Any]
    each: Each

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
        limits = _keys(np.array([-np.inf, np.inf], f"f{self.kind.itemsize}"))
        low, high = (int(limit) >> (8 * self.kind.itemsize - DIGIT) for limit in limits)
        inner = np.arange(low + 1, high)
        heads = np.zeros_like(self.heads)
        heads[inner] = self.heads[inner]
        return Ordered(heads, self.kind, self.each)

    def count(self, level: float) -> int:
        """Count a level."""
        return int(sum(self.each(partial(_count, level=level))))

    def without(self, level: float) -> Levels:
        """Return all but a level."""
        return gathered(lambda work: self.each(partial(_without, work, level)))

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
            number = np.cumsum(counts, axis=1)
            for n, key in enumerate(keys):
                row = number[begun.index(key)]
                digit = int(np.searchsorted(row, left[n], "right"))
                left[n] -= int(row[digit - 1]) if digit else 0
                keys[n] = (key << DIGIT) + digit
        return keys

    def histogram(self, low: float, high: float, bins: int) -> Ints:
        """Count the levels in equal bins."""
        return np.sum(self.each(partial(_histogram, low=low, high=high, bins=bins)), axis=0)


def _count(levels: NDArray[Any], *, level: float) -> int:
    return int(np.count_nonzero(levels == level))


def _without(work: Looked, level: float, levels: NDArray[Any]) -> Any:
    return work(levels[levels != level])


def _histogram(levels: NDArray[Any], *, low: float, high: float, bins: int) -> Ints:
    return np.histogram(levels, bins, (low, high))[0].astype(np.int64)
