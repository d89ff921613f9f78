"""Positions that are equal, or near each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel("void(i8[:,::1], i8[::1], i4[::1], i4[::1])")
def first_equal(
    rows: NDArray[np.int64], places: NDArray[np.int64], table: NDArray[np.int32], first: NDArray[np.int32]
) -> None:
    """Find the first row that is equal to each.

    Parameters
    ----------
    rows : (n, d) int64 array
    places : (n,) int64 array
        Where in the table to look for a row first; equal rows have equal places.
    table : (t,) int32 array
        -1 on entry; more places than rows. Overwritten.
    first : (n,) int32 array
        Result: number of the first row of the same numbers.

    Notes
    -----
    A row is put into the first free place from its own on (Knuth 1973, vol. 3, 6.4).
    """
    for n in range(len(rows)):
        place = places[n]
        while table[place] >= 0:
            same = True
            for axis in range(rows.shape[1]):
                same &= rows[table[place], axis] == rows[n, axis]
            if same:
                break
            place = (place + 1) % len(table)
        if table[place] < 0:
            table[place] = n
        first[n] = table[place]


@kernel("i8(f8[:,::1], i8[::1], i8, f8, i8[:,::1])")
def list_near(
    points: NDArray[np.float64], cells: NDArray[np.int64], side: int, radius: float, pairs: NDArray[np.int64]
) -> int:
    """List the pairs of points that are at most as far apart as a radius.

    Parameters
    ----------
    points : (n, 3) float array
        In the order of their cells.
    cells : (n,) int64 array
        The number of the cube that holds each, ``(x side + y) side + z``, rising; cubes at least as wide as the radius,
        none of them at a border of the side^3 there are.
    side : int
    radius : float
    pairs : (p, 2) int64 array
        Result; none are written where the array is too short.

    Returns
    -------
    int
        Pairs that there are.
    """
    total = 0
    first = np.zeros(5, np.int64)
    for p in range(len(points)):
        for row in range(5):  # the cube's own, and those of the 26 around it that follow in the order, row by row
            low = cells[p] + (0 if row == 0 else side if row == 1 else side * (side + row - 3)) - 1
            q = first[row]
            while q < len(points) and cells[q] < low:
                q += 1
            first[row] = q
            q = max(q, p + 1)
            while q < len(points) and cells[q] <= low + 2:
                squared = 0.0
                for axis in range(3):
                    squared += (points[p, axis] - points[q, axis]) ** 2
                if squared <= radius * radius:
                    if total < len(pairs):
                        pairs[total, 0], pairs[total, 1] = p, q
                    total += 1
                q += 1
    return total
