"""Label maps of thick slices: their voxels divided, and each part given to the label that has most of it.

Each label by itself tells how much of each part it has, as `tomomesh.isosurface.thick_slices` does for a mask; the
background has what is left.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..content import SPREAD
from ..crossings import Levels
from ..parts import BESIDE
from ..thick_slices import Columns, parts_of, thinned

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Labels = NDArray[np.uint16]
    Shares = NDArray[np.float16]
    Box = tuple[slice, ...]

MARGIN = BESIDE + 1
"""Voxels around a label that are looked at. Derived: a part is told of by so many slices on each side, and a label has
parts up to one voxel outside of its own."""


def divided(labels: Labels, affine: NDArray[np.float64], threads: int = 0) -> tuple[Labels, Shares]:
    """Divide the voxels of thick slices, and give each part to a label.

    Parameters
    ----------
    labels : (K, J, I) uint16 array
        With `MARGIN` voxels of the map around all labels, where it has them.
    affine : (4, 4) float array
    threads : int

    Returns
    -------
    labels : (K, J, I) uint16 array
        Of the thin voxels.
    shares : (K, J, I) float16 array
        How much of each its label has; 1 where that is not in question.
    """
    along, times = parts_of(affine)
    axis = 2 - along
    fine, own = np.repeat(labels, times, axis=axis), labels == 0
    best, claimed = np.zeros(fine.shape, np.float16), np.full(fine.shape, -1, np.float16)
    for index, box in _boxes(labels):
        mask = labels[box] == index
        thin = thinned(Levels(mask.view(np.uint8), 0.5, np.inf), mask, affine, threads)
        if thin is None:  # it fills the map
            continue
        assert isinstance(thin.levels.voxels, Columns)
        own[box] |= mask & np.moveaxis(thin.levels.voxels.index >= 0, 0, axis)
        part = _finer(box, axis, times)
        _claim(index, thin.levels.voxels, thin.mask, fine[part], best[part], claimed[part])
    claimed[np.repeat(~own, times, axis=axis)] = -1
    _leave(fine, best, claimed, np.repeat(labels, times, axis=axis))
    return fine, best


def _finer(box: Box, axis: int, times: int) -> Box:
    """Return a box in parts of voxels."""
    side = slice(box[axis].start * times, box[axis].stop * times)
    return (*box[:axis], side, *box[axis + 1 :])


def _boxes(labels: Labels) -> list[tuple[int, Box]]:
    """Return each label, and the box that it lies in with a margin around it."""
    found = scipy.ndimage.find_objects(labels)
    return [
        (index, tuple(slice(max(side.start - MARGIN, 0), min(side.stop + MARGIN, size))
                      for side, size in zip(box, labels.shape, strict=True)))
        for index, box in enumerate(found, 1) if box is not None
    ]  # fmt: skip


def _claim(index: int, columns: Columns, kept: NDArray[np.bool_], fine: Labels, best: Shares, claimed: Shares) -> None:
    """Let a label have the parts of which it has more than those before it; one that keeps a part goes first.

    What it does not keep by itself, for all its share, it does not ask for.

    Parameters
    ----------
    index : int
    columns : Columns
        How much of each part the label has.
    kept : (K, J, I) bool array
        The parts that it would have by itself.
    fine, best, claimed : (K, J, I) array
        The labels, shares and sums of shares so far, all of which are written; a share of one that keeps its part is
        more by 1.
    """
    found = np.argwhere(columns.index >= 0)
    times = columns.parts.shape[1]
    across = (found[:, :1] * times + np.arange(times)).ravel()
    places = [across, *np.repeat(found[:, 1:], times, axis=0).T]
    places.insert(columns.axis, places.pop(0))
    place = tuple(places)
    share = columns.parts[columns.index[tuple(found.T)]].ravel().astype(np.float16)
    mine = np.where(kept[place], share + 1, np.where(share < 0.5 - SPREAD, share, 0)).astype(np.float16)
    more = mine > best[place]
    won = tuple(axis[more] for axis in place)
    fine[won], best[won] = index, mine[more]
    claimed[place] = np.maximum(claimed[place], 0) + share


def _leave(fine: Labels, best: Shares, claimed: Shares, before: Labels) -> None:
    """Leave to the background what no label keeps and of which it has most, and to labels what is not in question.

    All arrays are (K, J, I), `before` the labels of the voxels and `claimed` -1 where their own label does not say what
    it has of their parts. Shares become what they are.
    """
    open_, left = claimed >= 0, 1 - claimed
    none = open_ & (best < 1) & (best + 2 * SPREAD < left)
    fine[none], fine[~open_] = 0, before[~open_]
    best[best >= 1] -= 1
    best[none], best[~open_] = left[none], 1
