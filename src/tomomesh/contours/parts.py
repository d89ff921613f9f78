"""The connected parts of a slice's inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..measure.polygon import side_lengths
from .curves import mask_of, moments_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .curves import Moments

    Floats = NDArray[np.float64]

COARSE = 48
"""Pixels across two parts on which overlaps are counted, at most. Chosen: half and twice of it change no case of
benchmarks/constants.py."""


@dataclass(frozen=True)
class Part:
    """A connected part of a slice's inside.

    Attributes
    ----------
    curves : sequence of (u, 2) float arrays
        Its outer curve and its holes, the inside on the left.
    moments : Moments
    low, high : (2,) float arrays
        Its box.
    height : float
        Its own, which need not be quite that of its plane.
    plane : int
    """

    curves: Sequence[Floats]
    moments: Moments
    low: Floats
    high: Floats
    height: float = 0.0
    plane: int = 0

    @classmethod
    def within(cls, curves: Sequence[Floats], height: float = 0.0, plane: int = 0) -> Part:
        """Measure the part within curves."""
        every = np.concatenate(list(curves))
        return cls(curves, moments_of(curves), every.min(axis=0), every.max(axis=0), height, plane)

    @property
    def place(self) -> Floats:
        """Its center and its height, (3,)."""
        return np.append(self.moments.center, self.height)

    @property
    def thickness(self) -> float:
        """The radius of a disk, and the width of a ring: twice the area over the length of the curves."""
        return 2 * self.moments.area / sum(float(side_lengths(curve).sum()) for curve in self.curves)


def width_of(parts: Sequence[Part]) -> float:
    """Return the extent of the widest part."""
    return max(float((part.high - part.low).max()) for part in parts)


def shared_area(one: Part, other: Part, shift: Floats, pixel: float) -> float:
    """Return the area that a shifted part has in common with another, to about a pixel of the outlines."""
    low, high = np.minimum(one.low + shift, other.low), np.maximum(one.high + shift, other.high)
    if ((one.low + shift > other.high) | (other.low > one.high + shift)).any():
        return 0.0
    size = max(pixel, float((high - low).max()) / COARSE)
    box = np.floor(low / size).astype(np.int64) - 1, np.ceil(high / size).astype(np.int64) + 2
    still = np.zeros(2)
    both = mask_of(one.curves, size, *box, shift) & mask_of(other.curves, size, *box, still)
    return float(np.count_nonzero(both)) * size**2
