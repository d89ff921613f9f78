"""Slices that are drawn or read as they are asked for, of masks and gray levels that are never whole in memory."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from .lazy import in_memory

if TYPE_CHECKING:
    from numpy.typing import NDArray

SOME, TOGETHER = 64, 2**24
"""Slices that are drawn or read together at most, and voxels: 64 MiB of 32-bit depths. Only memory and time depend on
them: a file's chunks are often 64 slices thick, and half as many together have each of them read twice."""


class Sized(Protocol):
    """What tells the sizes of slices."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes, that across the slices first."""


class Sliced(Sized, Protocol):
    """What has slices (J, I) or (J, I, L): an array, a `RunMask` that draws them, or voxels that are read.

    A number gives the slice as an array; a range gives an array, or what ``read()`` makes one.
    """

    def __getitem__(self, slices: Any, /) -> Any:
        """Return a slice, or those of a range."""


def together(sliced: Sized) -> int:
    """Return how many slices are drawn or read together."""
    return max(min(SOME, TOGETHER // max(math.prod(sliced.shape[1:3]), 1)), 1)


def ranges(start: int, stop: int, step: int) -> list[tuple[int, int]]:
    """Part slices into ranges.

    Examples
    --------
    >>> ranges(5, 70, 32)
    [(5, 37), (37, 69), (69, 70)]
    """
    return [(first, min(first + step, stop)) for first in range(start, stop, step)]


def ranges_of(sliced: Sized) -> list[tuple[int, int]]:
    """Return the ranges of all slices that are drawn or read `together`."""
    return ranges(0, sliced.shape[0], together(sliced))


def parts_of(sliced: Sliced) -> list[tuple[int, int]]:
    """Return the ranges of slices that threads share: all of an array, which is there; else as `ranges_of`."""
    return [(0, len(sliced))] if isinstance(sliced, np.ndarray) else ranges_of(sliced)


def some_of(sliced: Sliced, start: int, stop: int) -> NDArray[Any]:
    """Return the slices of a range; a view of an array."""
    return in_memory(sliced[start:stop])


def areas_of(mask: Sliced) -> NDArray[np.int64]:
    """Count the voxels of a mask on each slice, (K,)."""
    if not isinstance(mask, np.ndarray):
        return np.asarray(mask.areas())  # type: ignore[attr-defined]
    return np.array([np.count_nonzero(plane) for plane in mask], np.int64)
