"""Which contours lie in one plane: told apart within each column of contours that lie over one another.

Two objects in one file may have slices at other heights each, and the heights of one object may jitter. So planes are
sought among contours whose boxes overlap, seen along the normal, and not over the whole file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

ONE_PLANE = 0.1
"""Contours nearer than this share of the distance of slices lie in one plane: heights jitter by a few percent, and no
stack has slices so uneven. Where two objects that lie over one another do so, each part keeps its own height."""
FAR = 4.0
"""Extents of the widest contour that slices are apart at most. Chosen: with half of it thin vessels on slices far apart
would be taken to jitter, with twice of it small nodules far apart for one jittering plane each."""
SAME_HEIGHT = 0.05
"""Heights nearer than this share of the slices' distance count as one where slices are counted."""
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
    links = scipy.sparse.coo_array((np.ones(len(ends[0])), ends), shape=(len(low),) * 2)
    count, found = scipy.sparse.csgraph.connected_components(links, directed=False)
    corner = np.full((count, 2), np.inf)
    np.minimum.at(corner, found, low)
    rank = np.empty(count, np.int64)
    rank[np.lexsort(corner.T)] = np.arange(count)
    return np.asarray(rank[found])


def tolerance(heights: Floats, width: float) -> float:
    """Return how far heights of one plane may differ: `ONE_PLANE` of the widest gap for which that parts them cleanly.

    Parameters
    ----------
    heights : (n,) float array
        Rising.
    width : float
        Extent of the widest contour: gaps of more than `FAR` times it are no distance of slices.

    Notes
    -----
    Joined by the tolerance of a gap that is too wide, slices make planes that are thicker than it.
    """
    gaps = np.diff(heights)
    for gap in np.unique(gaps[gaps <= FAR * width])[::-1]:
        starts = np.flatnonzero(np.concatenate([[True], gaps > ONE_PLANE * gap]))
        ends = np.append(starts[1:], len(heights)) - 1
        if (heights[ends] - heights[starts]).max() <= ONE_PLANE * gap:
            return float(ONE_PLANE * gap)
    return 0.0


def typical_gap(heights: Floats, width: float) -> float:
    """Return the median distance of the planes that heights (n,) of contours of a width are on; 0 for one."""
    rising = np.sort(heights)
    gaps = np.diff(rising)
    wide = gaps[gaps > tolerance(rising, width)]
    return float(np.median(wide)) if len(wide) else 0.0


def planes_within(heights: Floats, column: NDArray[np.int64], width: Floats, least: float = 0.0) -> NDArray[np.int64]:
    """Return the plane (n,) of each contour, numbered column by column and rising within each.

    Parameters
    ----------
    heights : (n,) float array
        Of the contours, along the normal.
    column : (n,) int64 array
        As `columns_of` numbers them.
    width : (n,) float array
        Extent of each contour.
    least : float
        Heights that differ by no more are the same in any case.
    """
    order = np.lexsort((heights, column))
    first = np.flatnonzero(np.diff(column[order], prepend=-1))
    parted = np.zeros(len(order), np.bool_)
    for own in np.split(order, first[1:]):
        rising = heights[own]
        parted[own] = np.diff(rising, prepend=-np.inf) > max(least, tolerance(rising, float(width[own].max())))
    planes = np.empty(len(order), np.int64)
    planes[order] = np.cumsum(parted[order]) - 1
    return planes


def slices_at(heights: Floats, width: float) -> int:
    """Count the slices that planes of several columns, and contours of a width, are on."""
    return 1 + int((np.diff(np.sort(heights)) > SAME_HEIGHT * typical_gap(heights, width)).sum())
