"""What the gray levels say of how deep the pixels of a slice lie, for what is between the slices."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...kernels.threads import in_blocks, in_order
from ..signal import is_stepped

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from ...isosurface.crossings import Levels
    from ...model.sliced import Sliced
    from .insides import Depths, Insides

    Values = NDArray[np.floating[Any]]

DEEP = 2.0
"""Depth in pixels of a full level. Chosen, on a skull in slabs of 4 mm: half of it changes the distance by -2.1 %
and the turn from face to face by +3.5 %, twice by +2.8 % and -3.5 %; to go by the rings alone, by +10 % and -13 %."""
BEYOND = (1.0, 2.5)
"""Depths in pixels at which levels count as full: past the blur of a border, and near it still."""


@dataclass(frozen=True)
class FullLevels:
    """The gray levels of a study that tell how near the surface is, and what levels are full.

    Attributes
    ----------
    levels : Levels
    full : (float, float)
        How far levels are within the bounds inside of the rings, and beyond them outside, past the blur of a border;
        0 where none tells.
    """

    levels: Levels
    full: tuple[float, float]

    @classmethod
    def of(cls, levels: Levels | None, mask: Sliced, parts: Iterable[Insides], threads: int = 0) -> FullLevels | None:
        """Find what levels are full, over all slices; None where there are no levels, or those of a mask or of layers.

        Parameters
        ----------
        levels : Levels or None
        mask : (K, J, I) bool array or slices of it
            The window.
        parts : iterable of Insides
            All slices with rings, some at a time.
        threads : int
        """
        if levels is None or len(levels.voxels.shape) > 3 or is_stepped(mask, levels):
            return None
        rows = [row for some in map(partial(_full, levels, threads), parts) for row in some]  # keeps none of the parts
        inside, outside = (np.concatenate(each) for each in zip(*rows, strict=True))
        return cls(levels, (_median(inside), _median(outside)))

    def tempered(self, insides: Insides, threads: int = 0) -> Depths:
        """Return the depths of slices, no greater than their gray levels have them, (K, J, I).

        A pixel may lie far from all rings of its slice and yet be half outside, where the surface is nearly level with
        the slice. There its gray level tells how near the surface is, above or below: in shares of what is full.
        """
        seen, most = insides.over(self.levels.voxels, np.nan), np.float32(DEEP * insides.pixel.max())

        found = np.empty_like(insides.depths)

        def temper(start: int, stop: int) -> None:
            for k in range(start, stop):
                depths, within = insides.depths[k], _within(self.levels, seen(k))
                deep = np.full(depths.shape, most)
                for side, full in zip((1, -1), self.full, strict=True):
                    if full > 0:
                        here = side * depths > 0
                        deep[here] *= np.clip(side * within[here] / full, 0, 1)
                np.clip(depths, -deep, deep, out=found[k])

        in_blocks(temper, len(found), block=1, threads=threads)
        return found


def _within(levels: Levels, seen: NDArray[np.float32]) -> Values:
    """Return how far levels are within the bounds; infinitely beyond them where they are not known."""
    return np.asarray(np.nan_to_num(np.minimum(seen - levels.lower, levels.upper - seen), nan=-np.inf))


def _full(levels: Levels, threads: int, insides: Insides) -> list[list[Values]]:
    """Return how far levels are within the bounds inside, past the blur, and beyond them outside: of each slice."""
    low, high = (bound * float(insides.pixel.max()) for bound in BEYOND)
    seen = insides.over(levels.voxels, np.nan)

    def find(k: int) -> list[Values]:
        depths, within = insides.depths[k], _within(levels, seen(k))
        known = np.isfinite(within)
        return [side * within[(side * depths > low) & (side * depths < high) & known] for side in (1, -1)]

    return in_order(find, len(insides.depths), threads=threads)


def _median(values: Values) -> float:
    return float(np.median(values)) if len(values) else 0.0
