"""Which edges of a mesh in the making are too long, or too short. See `tomomesh.kernels.remeshing.links`.

Each is marked at the first of its half edges, and worked on in the order of these.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..compile import kernel
from .links import KEPT, LONG, SHORT, after, squared_length

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]
    Bytes = NDArray[np.uint8]

TOO_LONG, TOO_SHORT = 1, 2
"""Marks of edges; 0 for all others."""


@kernel("u1(f8[:,::1], i4[::1], u1[::1], f8[::1], i8)")
def class_of(places: Floats, corners: Ints, kinds: Bytes, sizes: Floats, half: int) -> int:
    """Tell whether an edge is too long, and may be split, or too short."""
    u, v = corners[half], corners[after(half)]
    size = 0.5 * (sizes[u] + sizes[v])
    squared = squared_length(places, u, v)
    if squared < (SHORT * size) ** 2:
        return TOO_SHORT
    return TOO_LONG if squared > (LONG * size) ** 2 and not kinds[u] == KEPT == kinds[v] else 0


@kernel("void(f8[:,::1], i4[::1], i4[::1], u1[::1], f8[::1], u1[::1], i8, i8)")
def mark_lengths(
    places: Floats, corners: Ints, twins: Ints, kinds: Bytes, sizes: Floats, marks: Bytes, start: int, stop: int
) -> None:
    """Mark the edges that are too long or too short."""
    for half in range(start, stop):
        marks[half] = 0
        if corners[half] >= 0 and twins[half] > half:
            marks[half] = class_of(places, corners, kinds, sizes, half)
