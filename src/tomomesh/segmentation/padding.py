"""Padding: voxels that no scanner measured, and that a program gave one gray level."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np

from .otsu import two_classes
from .slabwise.cut import HERE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.boxes import Box
    from ..model.volume import Volume
    from .slabwise.cut import Cut
    from .slabwise.levels import Levels

    Mask = NDArray[np.bool_]

LEAST, MOST = 0.01, 0.9
"""Shares of the voxels that padding takes. Below the first the range of Otsu's histogram leaves it out by itself; above
the second too little is left to tell an object from its background."""
IN_LINES = 0.95
"""Share of the padding that lies in lines of voxels, along one axis, that hold nothing else. All of what lies outside
of a scanner's circle or beyond a missing part does, and 0.3 to 0.85 of the background of heads. Below 1, for where
padding is 0 HU some tissue is too."""
APART, FAR = 0.1, 3.0
"""How far padding is from all other levels, in parts of what their bulk spans: where it lies in such lines, and where
it lies anywhere. Background set to 0 is next to other levels: under 0.01 in the studies at hand, over 0.2 for -1500 HU
in CT. A body whose surroundings were cut away lies up to 1.5 from them, and no-data values as -9999 over 4."""
CONSTANT = 0.25
"""Share of the other voxels from which their most frequent level says that a program drew them all. Chosen: scanners'
noise gives it 0.001 to 0.1 in the studies at hand, pictures without noise over 0.3; half and twice change none."""
LOOKED_AT = 20_000
"""Voxels that are looked at for that share, at least."""


@dataclass(frozen=True)
class Padding:
    """Which voxels of a study are padding: it tells so of each part of it alone.

    Attributes
    ----------
    named : (lowest, highest) or None
        Levels that a file's header calls padding.
    level : float or None
        A level that is padding by its looks.
    axis : int or None
        Of (K, J, I), where such a voxel is padding only in lines that it fills along it.
    lines : bool array
        Which these are: of the other two axes, with one entry along that one.
    """

    named: tuple[float, float] | None = None
    level: float | None = None
    axis: int | None = None
    lines: Mask | None = None

    def within(self, levels: NDArray[Any], box: Box) -> Mask:
        """Return which levels (k, j, i[, L]) of a box of the study are padding."""
        named = None if self.named is None else (levels >= self.named[0]) & (levels <= self.named[1])
        found = self._guessed(levels, box)
        return np.asarray(found if named is None else named if found is None else named | found)

    def _guessed(self, levels: NDArray[Any], box: Box) -> Mask | None:
        if self.lines is None:
            return None if self.level is None else np.asarray(levels == self.level)
        places = tuple(slice(None) if axis == self.axis else side for axis, side in enumerate(box))
        return np.broadcast_to(self.lines[places], levels.shape)


def padding(voxels: NDArray[Any]) -> Mask | None:
    """Return which voxels of a study (K, J, I) in memory are padding by their looks; None where none are."""
    return _whole(guessed_padding(HERE.of(voxels)), voxels)


def all_padding(volume: Volume) -> Mask | None:
    """Return the voxels of a study in memory that are padding by the file's header or by their looks; None for none."""
    return _whole(padding_in(HERE.of(volume.voxels), volume.padding, guessed=True), volume.voxels)


def _whole(found: Padding | None, voxels: NDArray[Any]) -> Mask | None:
    return None if found is None else found.within(voxels, (slice(None),) * 3)


def padding_in(cut: Cut, named: tuple[float, float] | None, *, guessed: bool) -> Padding | None:
    """Find the padding of a study that its header names and, where asked, that by its looks; None where none is.

    Parameters
    ----------
    cut : Cut
        The study's voxels.
    named : (lowest, highest) or None
        Levels that its header names: they are padding where some voxels have them, and not all.
    guessed : bool
    """
    found = guessed_padding(cut) if guessed else None
    if named is None:
        return found
    held = cut.sum(partial(_counted, Padding(named)))
    return replace(found or Padding(), named=named) if 0 < held < np.prod(cut.voxels.shape) else found


def _counted(padding: Padding, levels: NDArray[Any], box: Box) -> int:
    return int(np.count_nonzero(padding.within(levels, box)))


def guessed_padding(cut: Cut) -> Padding | None:
    """Find the padding of a study by its looks; None where there is none.

    Padding is one exact level that a corner of the volume has, among levels with noise that are a background and an
    object without it. Either nearly all of it lies in lines of voxels that hold nothing else (outside of a scanner's
    circle, beyond a missing part), and it is no end of the other levels, as clipped air is, or it is far from them all.

    Parameters
    ----------
    cut : Cut
        Gray levels (K, J, I); a study in color has none.
    """
    if cut.voxels.ndim != 3:
        return None
    corners = [cut.voxels[end][:: max(1, cut.shape[1] - 1), :: max(1, cut.shape[2] - 1)] for end in (0, -1)]
    levels = cut.levels
    held = np.unique(corners).tolist()
    for level, count in zip(held, levels.count(held), strict=True):
        if LEAST <= count / levels.size <= MOST:
            found = _standing_out(level, count, levels, cut)
            if found is not None:
                return found
    return None


def _standing_out(level: float, count: int, levels: Levels, cut: Cut) -> Padding | None:
    """Return what of a level is padding by its distance from the rest, its place, and what the rest is without it."""
    rest = levels.without(level)
    (low, high), (lowest, highest) = rest.bulk(), rest.ends
    span = high - low
    among = low + APART * span < level < high - APART * span
    gap = max(lowest - level, level - highest)
    if not (among or gap > APART * span) or span == 0 or _drawn(level, rest.size, cut) or not two_classes(rest):
        return None
    axis, lines = _lines(level, cut)
    filled = int(np.count_nonzero(lines)) * cut.shape[axis]
    if filled < IN_LINES * count and gap <= FAR * span:
        return None
    return Padding(level=level, axis=axis, lines=lines) if among else Padding(level=level)


def _lines(level: float, cut: Cut) -> tuple[int, Mask]:
    """Return the axis with the most lines of a level from end to end, in voxels, and these (K, J, I; 1 along it)."""
    across, *along = zip(*cut.each(partial(_full, level=level)), strict=True)
    full = [np.logical_and.reduce(across), *map(np.concatenate, along)]
    best = max(range(3), key=lambda axis: int(np.count_nonzero(full[axis])) * cut.shape[axis])
    return best, full[best]


def _full(levels: NDArray[Any], box: Box, *, level: float) -> list[Mask]:
    held = np.asarray(levels == level)
    return [np.asarray(held.all(axis=axis, keepdims=True)) for axis in range(3)]


def _drawn(level: float, size: int, cut: Cut) -> bool:
    """Tell whether the levels beside one, so many, have no noise; few of them are looked at, in even steps."""
    some = beside(level, max(1, size // LOOKED_AT), cut)
    return bool(np.unique(some, return_counts=True)[1].max() > CONSTANT * len(some))


def beside(level: float, every: int, cut: Cut) -> NDArray[Any]:
    """Return every n-th of the levels of a study that are not a given one, in their order."""
    before = accumulate(cut.each(partial(_others, level=level)), initial=0)
    return np.concatenate(list(cut.each(partial(_some, level=level, every=every), list(before)[:-1])))


def _others(levels: NDArray[Any], box: Box, *, level: float) -> int:
    return int(np.count_nonzero(levels != level))


def _some(levels: NDArray[Any], box: Box, before: int, *, level: float, every: int) -> NDArray[Any]:
    return np.array(levels[levels != level][-before % every :: every])


def as_background(cut: Cut, padding: Padding) -> tuple[Cut, int, int]:
    """Give padding the lowest of the other levels.

    Returns
    -------
    Cut
        The changed study.
    changed, named : int
        How many voxels had another level; those of them that the file's header calls padding.
    """
    lows, highs = zip(*cut.each(partial(_lowest, padding)), strict=True)
    lowest = np.minimum.reduce([low for low in lows if low is not None] + [np.maximum.reduce(highs)])
    changed, named = map(int, cut.sum(partial(_changed, padding, lowest)))
    return cut.made(partial(_replaced, padding, lowest), lowest.dtype), changed, named


def _lowest(padding: Padding, levels: NDArray[Any], box: Box) -> tuple[Any, Any]:
    others = levels[~padding.within(levels, box)]
    return others.min() if others.size else None, levels.max()


def _changed(padding: Padding, lowest: Any, levels: NDArray[Any], box: Box) -> NDArray[np.int64]:
    changed = padding.within(levels, box) & (levels != lowest)
    named = np.asarray(False) if padding.named is None else Padding(padding.named).within(levels, box)
    return np.array([np.count_nonzero(changed), np.count_nonzero(changed & named)])


def _replaced(padding: Padding, lowest: Any, levels: NDArray[Any], box: Box) -> NDArray[Any]:
    return np.where(padding.within(levels, box), lowest, levels)
