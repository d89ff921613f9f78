"""Which contours lie in one plane: told apart within each column of contours that lie over one another.

Two objects in one file may have slices at other heights each, and the heights of one object may jitter. So planes are
sought among contours whose boxes overlap, seen along the normal, and not over the whole file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

ONE_PLANE = 0.1
"""Contours nearer than this share of the distance of slices lie in one plane: heights jitter by a few percent, and no
stack has slices so uneven. Where two objects that lie over one another do so, each part keeps its own height."""
ROWS = 1024
"""Boxes that are compared with all others at a time: 1024 times 10,000 truth values are 10 MB."""


def columns_of(low: Floats, high: Floats) -> NDArray[np.int64]:
    """Return the column (n,) of each box, from low to high (n, 2): boxes that overlap, or are joined by others that do.

    Columns are numbered by the least corner of each, so that the order of the boxes changes nothing.
    """
    one, other = [], []
    for start in range(0, len(low), ROWS):
        rows = slice(start, start + ROWS)
        apart = (low[rows, None] > high[None]).any(axis=2) | (high[rows, None] < low[None]).any(axis=2)
        a, b = np.nonzero(~apart)
        one.append(a + start)
        other.append(b)
    ends = np.concatenate(one), np.concatenate(other)
    links = coo_array((np.ones(len(ends[0]), np.bool_), ends), shape=(len(low),) * 2)
    count, found = connected_components(links, directed=False)
    corner = np.full((count, 2), np.inf)
    np.minimum.at(corner, found, low)
    rank = np.empty(count, np.int64)
    rank[np.lexsort(corner.T)] = np.arange(count)
    return np.asarray(rank[found])


def typical_gap(heights: Floats) -> float:
    """Return the gap that half of the way from the lowest height to the highest lies in wider ones than; 0 for one.

    Counted by their lengths, gaps that jitter opens do not matter, however many there are.
    """
    gaps = np.sort(np.diff(np.sort(heights)))
    if not len(gaps) or gaps[-1] == 0:
        return 0.0
    passed = np.cumsum(gaps)
    return float(gaps[np.searchsorted(passed, passed[-1] / 2)])


def planes_within(heights: Floats, column: NDArray[np.int64], least: float = 0.0) -> NDArray[np.int64]:
    """Return the plane (n,) of each contour, numbered column by column and rising within each.

    Parameters
    ----------
    heights : (n,) float array
        Of the contours, along the normal.
    column : (n,) int64 array
        As `columns_of` numbers them.
    least : float
        Heights that differ by no more are the same in any case.
    """
    order = np.lexsort((heights, column))
    gaps, onward = np.diff(heights[order]), np.diff(column[order]) != 0
    wide = np.zeros(len(gaps), np.bool_)
    for one in np.unique(column):
        own = np.flatnonzero((column[order][:-1] == one) & ~onward)
        wide[own] = gaps[own] > max(least, ONE_PLANE * typical_gap(heights[column == one]))
    planes = np.empty(len(heights), np.int64)
    planes[order] = np.cumsum(np.concatenate([[False], wide | onward]))
    return planes
