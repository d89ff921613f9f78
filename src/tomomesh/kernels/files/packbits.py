"""Runs of equal bytes, as PackBits keeps them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..compile import kernel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@kernel("i8(u1[::1], i8, i8, u1[::1], i8, i8)")
def unpack_bits(
    packed: NDArray[np.uint8], start: int, stop: int, unpacked: NDArray[np.uint8], first: int, step: int
) -> int:
    """Unpack a stretch of bytes into every `step`-th place from `first` on, until one of the two is at its end.

    A byte n below 128 stands before n + 1 bytes as they are, one above it before a byte that is repeated 257 - n times
    (PS3.5, G.3.1).

    Parameters
    ----------
    packed : (b,) uint8 array
    start, stop : int
        The stretch, which may end behind the bytes.
    unpacked : (c,) uint8 array
        Result.
    first, step : int
        At least 0 and 1.

    Returns
    -------
    int
        How many places were filled.
    """
    at, to, end = start, first, min(stop, len(packed))
    while at + 1 < end and to < len(unpacked):
        mark = int(packed[at])
        at += 1
        if mark < 128:
            for n in range(at, min(at + mark + 1, end)):
                if to < len(unpacked):
                    unpacked[to] = packed[n]
                    to += step
            at += mark + 1
        elif mark > 128:
            for _ in range(257 - mark):
                if to < len(unpacked):
                    unpacked[to] = packed[at]
                    to += step
            at += 1
    return (to - first) // step
