"""How far apart points lie around each of them, and whether there are any; blocks, start and frame as in `samples`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .samples import MOST, gather

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]


@kernel("void(f8[:,::1], i8[::1], i4[::1], f8[::1], f8, f8[::1], i8, i8)")
def local_spacing(
    points: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    radius: float,
    spacing: Floats,
    begin: int,
    end: int,
) -> None:
    """Estimate how far apart the points lie around each of them, from how many there are within a radius.

    Parameters
    ----------
    points : (p, 4) float array
        Position and mass.
    blocks, start, frame : arrays
    radius : float
        Where to begin; it is doubled, to 16 times at most, while it holds fewer than 8 points, and halved while it
        holds over 64.
    spacing : (p,) float array
        Result: sqrt(pi radius^2 / points).
    begin, end : int
        Points to work on.
    """
    found = np.empty(MOST, np.int64)
    for p in range(begin, end):
        sight = radius
        count = gather(points, blocks, start, frame, points[p], sight, found)
        while count < 8 and sight < 16 * radius:
            sight *= 2
            count = gather(points, blocks, start, frame, points[p], sight, found)
        while count > 64 and sight > radius / 16:
            sight /= 2
            count = gather(points, blocks, start, frame, points[p], sight, found)
        spacing[p] = sight * np.sqrt(np.pi / max(count, 1))


@kernel("void(f8[:,::1], i8[::1], i4[::1], f8[::1], f8[:,::1], f8[::1], i8, b1[::1], i8, i8)")
def find_lonely(
    points: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    places: Floats,
    reach: Floats,
    few: int,
    lonely: NDArray[np.bool_],
    begin: int,
    end: int,
) -> None:
    """Find the points that have moved to places where there are no others.

    Parameters
    ----------
    points : (p, 4) float array
        Position and mass.
    blocks, start, frame : arrays
    places : (p, c) float array
        Where each point has moved, its first three columns.
    reach : (p,) float array
        How far around its place others are looked for; 0 where that is not asked.
    few : int
        Others that must be there.
    lonely : (p,) bool array
        Result.
    begin, end : int
        Points to work on.
    """
    found = np.empty(MOST, np.int64)
    for p in range(begin, end):
        lonely[p] = False
        if reach[p] > 0.0:
            count = gather(points, blocks, start, frame, places[p, :3], reach[p], found)
            for n in range(count):
                if found[n] == p:
                    count -= 1
            lonely[p] = count < few


@kernel("void(f8[::1], i8[::1], i8[::1], i8, f8, f8[::1], i8, i8)")
def region_medians(
    values: Floats,
    order: Integers,
    start: Integers,
    few: int,
    usual: float,
    medians: Floats,
    begin: int,
    end: int,
) -> None:
    """Find the median of the values in each region.

    Parameters
    ----------
    values : (p,) float array
    order, start : arrays
        The points of region q are ``order[start[q]:start[q + 1]]``.
    few : int
        Points under which a region has no median of its own.
    usual : float
        What such a region is given.
    medians : (p,) float array
        Result: the median of the region of each point.
    begin, end : int
        Regions to work on.
    """
    for q in range(begin, end):
        mine = order[start[q] : start[q + 1]]
        median = usual
        if len(mine) >= few:
            median = np.sort(values[mine])[len(mine) // 2]
        for p in mine:
            medians[p] = median
