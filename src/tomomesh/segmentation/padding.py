"""Padding: voxels that no scanner measured, and that a program gave one gray level."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from .otsu import bulk, two_classes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.volume import Volume

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


def padding(voxels: NDArray[Any]) -> NDArray[np.bool_] | None:
    """Return which voxels of a study are padding; None where none are.

    Padding is one exact level that a corner of the volume has, among levels with noise that are a background and an
    object without it. Either nearly all of it lies in lines of voxels that hold nothing else (outside of a scanner's
    circle, beyond a missing part), and it is no end of the other levels, as clipped air is, or it is far from them all.

    Parameters
    ----------
    voxels : (K, J, I) array
        Gray levels.
    """
    if voxels.ndim != 3:
        return None
    for level in np.unique([voxels[corner] for corner in product((0, -1), repeat=3)]):
        held = np.asarray(voxels == level)
        if LEAST <= held.mean() <= MOST:
            found = _standing_out(float(level), held, voxels[~held])
            if found is not None:
                return found
    return None


def named_padding(volume: Volume) -> NDArray[np.bool_] | None:
    """Return the voxels that a file's header calls padding; None where it names none, or all of them."""
    if volume.padding is None:
        return None
    low, high = volume.padding
    held = np.asarray((volume.voxels >= low) & (volume.voxels <= high))
    return held if held.any() and not held.all() else None


def all_padding(volume: Volume, *, guessed: bool = True) -> NDArray[np.bool_] | None:
    """Return the voxels that are padding by the file's header and, where asked, by their looks; None where none are."""
    named, found = named_padding(volume), padding(volume.voxels) if guessed else None
    return found if named is None else named if found is None else named | found


def _standing_out(level: float, held: NDArray[np.bool_], rest: NDArray[Any]) -> NDArray[np.bool_] | None:
    """Return what of a level is padding by its distance from the rest, its place, and what the rest is without it."""
    low, high = bulk(rest)
    span = high - low
    among = low + APART * span < level < high - APART * span
    gap = max(float(rest.min()) - level, level - float(rest.max()))
    if not (among or gap > APART * span) or span == 0 or _drawn(rest) or not two_classes(rest):
        return None
    lines = _lines(held)
    if np.count_nonzero(lines) < IN_LINES * np.count_nonzero(held) and gap <= FAR * span:
        return None
    return lines if among else held


def _lines(held: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the voxels of a level that lie in lines of it from end to end, along the axis with the most of them."""
    full = [held.all(axis=axis, keepdims=True) for axis in range(3)]
    best = max(range(3), key=lambda axis: int(np.count_nonzero(full[axis])) * held.shape[axis])
    return np.broadcast_to(full[best], held.shape)


def _drawn(rest: NDArray[Any]) -> bool:
    """Tell whether levels have no noise."""
    some = rest[:: max(1, len(rest) // LOOKED_AT)]
    return bool(np.unique(some, return_counts=True)[1].max() > CONSTANT * len(some))
