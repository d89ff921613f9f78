"""Percentiles of what is kept of many slabs, exact: the digits of each are counted, the highest first."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]

DIGIT = 16
"""Bits of a digit. Chosen: half a megabyte of counts for each percentile, and four passes."""


def percentiles(counts: Callable[[Ints, int], Ints], total: int, parts: Sequence[float]) -> Floats:
    """Return percentiles of numbers that are nowhere together, as ``numpy.percentile`` does.

    Parameters
    ----------
    counts : callable
        Given digits and a shift, as `digits_after` has them, returns the sum of what that returns for all numbers.
    total : int
        How many numbers there are, one at least.
    parts : sequence of float
        From 0 to 100.
    """
    place = (total - 1) * np.true_divide(np.asarray(parts, np.float64), 100)
    below = np.floor(place).astype(np.int64)
    found = ranked(counts, np.concatenate([below, np.minimum(below + 1, total - 1)]))
    pairs = found.reshape(2, -1).T
    return np.array([np.quantile(pair, share) for pair, share in zip(pairs, place - below, strict=True)])


def ranked(counts: Callable[[Ints, int], Ints], ranks: Ints) -> Floats:
    """Return the numbers that have some ranks (r,), 0 for the lowest; see `percentiles`."""
    digits, left = np.zeros(len(ranks), np.int64), ranks.copy()
    for shift in range(64 - DIGIT, -1, -DIGIT):
        some, which = np.unique(digits, return_inverse=True)
        reached = np.cumsum(counts(some, shift), axis=1)[which]
        digit = (reached <= left[:, None]).sum(axis=1)
        left -= np.where(digit > 0, reached[np.arange(len(digit)), digit - 1], 0)
        digits = (digits << DIGIT) | digit
    return digits.view(np.float64)


def digits_after(numbers: Floats, digits: Ints, shift: int) -> Ints:
    """Count the next digit of numbers (n,), none of them negative, that begin with some digits (d,): (d, 2^16).

    The bits of such numbers are in their order.
    """
    bits = np.ascontiguousarray(numbers, np.float64).view(np.int64) >> shift
    begins = bits >> DIGIT
    return np.array(
        [np.bincount(bits[begins == one] & (2**DIGIT - 1), minlength=2**DIGIT) for one in digits.tolist()], np.int64
    ).reshape(len(digits), 2**DIGIT)
