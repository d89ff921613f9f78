"""Rows of vertices or squares that a slab has, and those that it is handed by its neighbors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .cuts import Cuts
    from .keep import Kept, Slabs

    Longs = NDArray[np.int64]
    Arrays = tuple[NDArray[Any], ...]


@dataclass(frozen=True)
class Part:
    """Consecutive rows of arrays that no one has whole.

    Attributes
    ----------
    first : int
        The number of its first row in the whole.
    arrays : tuple of arrays
        Of one length.
    told : array
        What the driver asks of it.
    """

    first: int
    arrays: Arrays
    told: Any = None

    def __len__(self) -> int:
        return len(self.arrays[0])


def strip(first: int, last: int, part: Part) -> Part:
    """Return some rows of a part, by their numbers in the whole."""
    rows = slice(first - part.first, last - part.first)
    return Part(first, tuple(array[rows] for array in part.arrays))


def gathered(parts: Sequence[Part], span: tuple[int, int], which: slice = slice(None)) -> Arrays:
    """Put rows side by side, by their numbers in the whole; those that no part has are 0.

    Parameters
    ----------
    parts : sequence of Part
        Alike.
    span : (int, int)
        The first of these numbers, and the one behind the last.
    which : slice
        Of the arrays of each part.

    Returns
    -------
    tuple of arrays
        Its own: they may be overwritten.
    """
    first, last = span
    found = tuple(np.zeros((last - first, *one.shape[1:]), one.dtype) for one in parts[0].arrays[which])
    for part in parts:
        start, stop = max(first, part.first), min(last, part.first + len(part))
        for whole, rows in zip(found, part.arrays[which], strict=True):
            if start < stop:
                whole[start - first : stop - first] = rows[start - part.first : stop - part.first]
    return found


def told_by(slabs: Slabs, parts: Sequence[Kept]) -> list[Any]:
    """Return what the driver asks of parts."""
    return slabs.fetch(slabs.each(_told, parts))


def _told(part: Part) -> Any:
    return part.told


def exchanged(slabs: Slabs, parts: Sequence[Kept], cuts: Cuts, before: Longs, halo: int) -> list[tuple[Kept, ...]]:
    """Hand every slab its own part, and of its neighbors' the rows that lie in its halo.

    Parameters
    ----------
    slabs : Slabs
    parts : sequence
        What is kept of a `Part` a slab.
    cuts : Cuts
    before : (K + 1,) int64 array
        How many rows lie before each layer, and in all.
    halo : int
        Layers.
    """
    if len(cuts) == 1:
        return [(part,) for part in parts]
    numbers = before.tolist()
    low = [(numbers[start], numbers[min(start + halo, stop)]) for start, stop in cuts.own]
    high = [(numbers[max(stop - halo, start)], numbers[stop]) for start, stop in cuts.own]
    lower, upper = (slabs.each(_strip, spans, parts) for spans in (low, high))
    others = [cuts.beside(slab, halo) for slab in range(len(cuts))]
    return [
        (*(upper[n] for n in near if n < slab), part, *(lower[n] for n in near if n > slab))
        for slab, (near, part) in enumerate(zip(others, parts, strict=True))
    ]


def _strip(span: tuple[int, int], part: Part) -> Part:
    return strip(*span, part)
