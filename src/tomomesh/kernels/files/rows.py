"""Where rows begin that differ in length."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..compile import kernel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@kernel("i8(u1[::1], i8, i8[::1], i8[::1], b1[::1], b1, i8[::1])")
def row_starts(
    data: NDArray[np.uint8],
    start: int,
    sizes: NDArray[np.int64],
    items: NDArray[np.int64],
    signed: NDArray[np.bool_],
    big: bool,
    starts: NDArray[np.int64],
) -> int:
    """Step over rows of numbers and lists, as PLY has them.

    Parameters
    ----------
    data : (b,) uint8 array
    start : int
        Where the first row begins.
    sizes, items : (c,) int64 arrays
        Bytes of each number, or of a list's length, at most 8; bytes of an entry of the list, 0 for a number.
    signed : (c,) bool array
        Whether that length has a sign.
    big : bool
        Whether the first byte counts most.
    starts : (n,) int64 array
        Result: where each row begins.

    Returns
    -------
    int
        Where the last row ends; -1 where the data end before, or a list's length is below 0.
    """
    at = start
    for row in range(len(starts)):
        starts[row] = at
        for column in range(len(sizes)):
            size = sizes[column]
            if items[column] > 0:
                if at + size > len(data):
                    return -1
                length = 0
                for n in range(size):
                    length = length * 256 + data[at + n if big else at + size - 1 - n]
                first = data[at if big else at + size - 1]
                if signed[column] and first >= 128:
                    return -1
                if length > len(data):
                    return -1
                at += length * items[column]
            at += size
        if at > len(data):
            return -1
    return at
