"""Numbers in the order of integers without a sign, and counts of the digits of these: of 16 bits each.

The bits of a number are those of an integer, whose order follows from the first of them: the sign. Keys are such
integers in the order of the numbers; NaN lies beyond what is infinite.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Ints = NDArray[np.int64]

DIGIT = 16
"""Bits that are looked at in one pass: counts of all of them take 512 KiB, and stay in the cache of a core."""


def plain(levels: NDArray[Any]) -> NDArray[Any]:
    """Take truths for numbers, and longer floats than of 64 bits for those."""
    levels = levels.view(np.uint8) if levels.dtype.kind == "b" else levels
    return levels.astype(np.float64) if levels.dtype.itemsize > 8 else levels


def digit_counts(levels: NDArray[Any], begun: Sequence[int], depth: int) -> Ints:
    """Count levels whose keys begin with some digits by their next digit, (b, 65536); of 8 bits there are 256."""
    levels = plain(levels)
    kind, width = levels.dtype, 8 * levels.dtype.itemsize
    bits, digit = levels.view(f"{kind.byteorder}u{kind.itemsize}"), min(width, DIGIT)
    below = width - digit * (depth + 1)
    heads = bits >> (below + digit) if depth else bits
    counts = np.empty((len(begun), 1 << digit), np.int64)
    for n, first in enumerate(begun):
        held = bits[heads == bits_of(first, digit * depth, kind)] if depth else bits
        held = (held >> below) & ((1 << digit) - 1) if width > digit else held
        found = np.bincount(held.ravel().astype(np.int64), minlength=1 << digit)
        counts[n] = _in_order(found, first >> (digit * depth - 1) if depth else None, kind)
    return counts


def bits_of(key: int, width: int, kind: np.dtype[Any]) -> int:
    """Return the first bits of levels, so many, whose keys begin with others."""
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


def key_of(level: float, kind: np.dtype[Any]) -> int:
    """Return the key of a level."""
    bits = int(np.array([level], f"{kind.kind}{kind.itemsize}").view(f"u{kind.itemsize}")[0])
    first = 1 << (8 * kind.itemsize - 1)
    if kind.kind == "u":
        return bits
    return bits ^ (2 * first - 1) if kind.kind == "f" and bits & first else bits ^ first


def level_of(key: int, kind: np.dtype[Any]) -> float:
    """Return the level of a key."""
    bits = np.array([bits_of(key, 8 * kind.itemsize, kind)], f"u{kind.itemsize}")
    return float(bits.view(f"{kind.kind}{kind.itemsize}")[0])


def count_bits(levels: NDArray[Any], *, sought: Sequence[int]) -> Ints:
    """Count levels by their bits."""
    levels = plain(levels)
    bits = levels.view(f"{levels.dtype.byteorder}u{levels.dtype.itemsize}")
    return np.array([np.count_nonzero(bits == one) for one in sought])
