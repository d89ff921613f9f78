"""Slices that are drawn or read as they are asked for, of masks and gray levels that are never whole in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from .lazy import in_memory

if TYPE_CHECKING:
    from numpy.typing import NDArray

SOME = 32
"""Slices that are drawn or read together. Only memory and time depend on it: half of it reads chunks of 64 slices
twice as often, twice of it takes 16 MB more of a study of 512 x 512 pixels of a byte."""


class Sliced(Protocol):
    """What has slices (J, I) or (J, I, L): an array, a `RunMask` that draws them, or voxels that are read.

    A number gives the slice as an array; a range gives an array, or what ``read()`` makes one.
    """

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes, that across the slices first."""

    def __getitem__(self, slices: Any, /) -> Any:
        """Return a slice, or those of a range."""


def ranges(start: int, stop: int, step: int | None = None) -> list[tuple[int, int]]:
    """Part slices into ranges that are worked on together: `SOME` slices, or `step`.

    Examples
    --------
    >>> ranges(5, 70)
    [(5, 37), (37, 69), (69, 70)]
    """
    step = max(SOME if step is None else step, 1)
    return [(first, min(first + step, stop)) for first in range(start, stop, step)]


def parts_of(sliced: Sliced) -> list[tuple[int, int]]:
    """Return the ranges of slices that threads share: all of an array, which is there; else `SOME`."""
    count = sliced.shape[0]
    return [(0, count)] if isinstance(sliced, np.ndarray) else ranges(0, count)


def some_of(sliced: Sliced, start: int, stop: int) -> NDArray[Any]:
    """Return the slices of a range; a view of an array."""
    return in_memory(sliced[start:stop])


def areas_of(mask: Sliced) -> NDArray[np.int64]:
    """Count the voxels of a mask on each slice, (K,)."""
    if not isinstance(mask, np.ndarray):
        return np.asarray(mask.areas())  # type: ignore[attr-defined]
    return np.array([np.count_nonzero(plane) for plane in mask], np.int64)
