"""Thresholds between classes of gray levels (Otsu 1979), and the histogram that they are found on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .slabwise.levels import TAILS, levels_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from .slabwise.levels import Levels

REACH = 0.5
"""How far the histogram reaches beyond the levels between its tails (`TAILS`), in parts of what they span; levels
beyond are not counted. Chosen: reaches of .25 and 1 move the threshold of no study at hand by more than a bin."""
ONE_CLASS = 0.75
"""Share of the variance that lies between the two halves of a uniform class; of a normal one it is 2 / pi. A histogram
that is split no better holds one class (Otsu 1979, eq. 17)."""


def otsu_threshold(levels: NDArray[Any] | Levels, *, bins: int = 256) -> float:
    """Return the gray level that splits a histogram into two classes most unlike each other (Otsu 1979).

    Parameters
    ----------
    levels : array or Levels
        Gray levels of any shape, or what is told of those of slabs; those that are not finite do not count.
    bins : int
        Bins of the histogram over the bulk of the levels (`TAILS`).

    Returns
    -------
    float
        Half way between the means of the classes, where Otsu's criterion is at rest, but within the bins that it lies
        between; so no empty bin has a say. The level itself where there is only one.
    """
    return otsu_levels(levels, 2, bins=bins)[0]


def otsu_levels(levels: NDArray[Any] | Levels, classes: int, *, bins: int = 256) -> tuple[float, ...]:
    """Return the gray levels that split a histogram into several classes most unlike each other (Otsu 1979, sec. V).

    Parameters
    ----------
    levels, bins
        As of `otsu_threshold`.
    classes : int
        Two at least; no more than there are bins that hold something.

    Returns
    -------
    tuple of float
        Rising, one fewer than classes; the level itself, alone, where there is only one.
    """
    held = levels_of(levels).finite
    if held.ends[0] == held.ends[1]:
        return (held.ends[0],)
    counts, middles = _over_bulk(held, bins)
    classes = min(classes, int(np.count_nonzero(counts)))
    ends = _last_bins(counts, middles, classes)
    return tuple(_between(counts, middles, ends, n) for n in range(classes - 1))


def two_classes(levels: Levels, *, bins: int = 256) -> bool:
    """Tell whether levels split into two classes better than one class does, without one pair of tails or the other."""
    return any(_split(*found) > ONE_CLASS for found in _histograms(levels, bins))


def _over_bulk(levels: Levels, bins: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return counts and middles of bins over the bulk of the levels; over more of them where that is one class."""
    found = None
    for found in _histograms(levels, bins):
        if _split(*found) > ONE_CLASS:
            break
    return found or _binned(levels, *levels.ends, bins)


def _histograms(levels: Levels, bins: int) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """Yield counts and middles of bins without one pair of tails after the other, but of no single level."""
    low, high = levels.ends
    for tail in TAILS:
        first, last = levels.bulk(tail)
        if first < last:
            reach = REACH * (last - first)
            yield _binned(levels, max(low, first - reach), min(high, last + reach), bins)


def _binned(levels: Levels, low: float, high: float, bins: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    return levels.histogram(low, high, bins), low + (np.arange(bins) + 0.5) * (high - low) / bins


def _split(counts: NDArray[np.int64], middles: NDArray[np.float64]) -> float:
    """Return the share of the variance that lies between the two classes that Otsu's threshold makes, 0 to 1."""
    if np.count_nonzero(counts) < 2:
        return 0.0
    last = _last_bins(counts, middles, 2)[0] + 1
    mean = np.average(middles, weights=counts)
    whole = np.sum(counts * (middles - mean) ** 2)
    parts = ((counts[part], middles[part]) for part in (slice(last), slice(last, None)))
    return float(sum(np.sum(held) * (np.average(at, weights=held) - mean) ** 2 for held, at in parts) / whole)


def _between(counts: NDArray[np.int64], middles: NDArray[np.float64], ends: list[int], n: int) -> float:
    """Return the threshold after a class: half way between two means, but within the bins that it lies between."""
    starts = [0, *(end + 1 for end in ends), len(counts)]
    lower, upper = (slice(starts[k], starts[k + 1]) for k in (n, n + 1))
    means = [np.average(middles[part], weights=counts[part]) for part in (lower, upper)]
    last = middles[lower][np.flatnonzero(counts[lower])[-1]]
    first = middles[upper][np.flatnonzero(counts[upper])[0]]
    return float(np.clip(np.mean(means), last, max(last, np.nextafter(first, last))))


def _last_bins(counts: NDArray[np.int64], middles: NDArray[np.float64], classes: int) -> list[int]:
    """Return the last bin of each class but the highest, for the largest sum of (mass of a class)^2 / its count.

    That sum is the variance between the classes but for a constant. The best split of the first bins into one class
    more follows from the best splits of fewer bins, so all splits cost as much as one more histogram, squared.
    """
    number = np.concatenate([[0], np.cumsum(counts)]).astype(np.float64)
    # about the mean, so that no digits are lost where levels lie far from zero
    mass = np.concatenate([[0.0], np.cumsum(counts * (middles - np.average(middles, weights=counts)))])
    inside, sums = number[None, :] - number[:, None], mass[None, :] - mass[:, None]
    worth = np.where(inside > 0, sums**2 / np.maximum(inside, 1), -np.inf)  # of the bins from row to column
    best, cuts = worth[0], []
    for _ in range(classes - 1):
        table = best[:, None] + worth
        cuts.append(np.argmax(table, axis=0))
        best = table.max(axis=0)
    ends = [len(counts)]
    for cut in reversed(cuts):
        ends.append(int(cut[ends[-1]]))
    return [end - 1 for end in reversed(ends[1:])]


def histogram(levels: NDArray[Any] | Levels, low: float, high: float, bins: int) -> NDArray[np.int64]:
    """Count gray levels in equal bins; exact and quick for small integers, which most studies hold."""
    return levels_of(levels).histogram(low, high, bins)
