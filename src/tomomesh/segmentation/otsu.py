"""Thresholds between classes of gray levels (Otsu 1979), and the histogram that they are found on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

PILED, SPAN = 0.999, (0.01, 99.99)
"""Share of the levels in one bin over which a histogram tells nothing, and the percentiles that it then spans. In 256
bins no two classes are then told apart: under one level in a thousand lies beyond the bin. The percentiles leave out
one level in 10,000 on each side, ten times fewer."""


def otsu_threshold(levels: NDArray[Any], *, bins: int = 256) -> float:
    """Return the gray level that splits a histogram into two classes most unlike each other (Otsu 1979).

    Parameters
    ----------
    levels : array
        Gray levels of any shape; those that are not finite do not count.
    bins : int
        Bins of the histogram between the lowest and the highest level; between the percentiles `SPAN` where a
        few far levels pile all others up in one bin.

    Returns
    -------
    float
        Middle of the last bin of the lower class; the level itself where there is only one.
    """
    return otsu_levels(levels, 2, bins=bins)[0]


def otsu_levels(levels: NDArray[Any], classes: int, *, bins: int = 256) -> tuple[float, ...]:
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
        Rising, one fewer than classes: the middle of the last bin of each but the highest class. The level itself,
        alone, where there is only one.
    """
    levels = levels[np.isfinite(levels)] if levels.dtype.kind == "f" else levels
    low, high = float(levels.min()), float(levels.max())
    if low == high:
        return (low,)
    counts = histogram(levels, low, high, bins)
    if counts.max() > PILED * counts.sum():
        inner = np.percentile(levels, SPAN)
        low, high = inner if inner[0] < inner[1] else (low, high)
        counts = histogram(levels, low, high, bins)
    middles = low + (np.arange(bins) + 0.5) * (high - low) / bins
    classes = min(classes, int(np.count_nonzero(counts)))
    return tuple(float(middles[last]) for last in _last_bins(counts, middles, classes))


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


def histogram(levels: NDArray[Any], low: float, high: float, bins: int) -> NDArray[np.int64]:
    """Count gray levels in equal bins; exact and quick for small integers, which most studies hold."""
    levels = levels.view(np.uint8) if levels.dtype.kind == "b" else levels
    if levels.dtype.kind in "iu" and levels.dtype.itemsize <= 2:
        base = int(np.iinfo(levels.dtype).min)
        counts = np.bincount(levels.ravel().astype(np.int64) - base)
        present = np.flatnonzero(counts)
        return np.histogram(present + base, bins, (low, high), weights=counts[present])[0].astype(np.int64)
    return np.histogram(levels, bins, (low, high))[0].astype(np.int64)
