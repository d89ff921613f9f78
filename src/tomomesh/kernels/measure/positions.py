"""Positions that are equal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..compile import kernel

if TYPE_CHECKING:
    import numpy as np
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
