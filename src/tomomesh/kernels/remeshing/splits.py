"""Edges of a mesh in the making that are too long are split. See `tomomesh.kernels.remeshing.links`.

Edges are marked at the first of their half edges, and split in the order of these.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..compile import kernel
from .links import CREASE, FREE, KEPT, LONG, after, before, squared_length

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]
    Bytes = NDArray[np.uint8]
    Bools = NDArray[np.bool_]


@kernel("b1(f8[:,::1], i4[::1], u1[::1], f8[::1], i8)")
def is_long(places: Floats, corners: Ints, kinds: Bytes, sizes: Floats, half: int) -> bool:
    """Tell whether an edge is too long, and may be split."""
    u, v = corners[half], corners[after(half)]
    most = LONG * 0.5 * (sizes[u] + sizes[v])
    return bool(squared_length(places, u, v) > most * most and not kinds[u] == KEPT == kinds[v])


@kernel("void(f8[:,::1], i4[::1], i4[::1], u1[::1], f8[::1], b1[::1], i8, i8)")
def mark_long(
    places: Floats, corners: Ints, twins: Ints, kinds: Bytes, sizes: Floats, marks: Bools, start: int, stop: int
) -> None:
    """Mark the edges that are too long, each at the first of its half edges."""
    for half in range(start, stop):
        marks[half] = corners[half] >= 0 and twins[half] > half and is_long(places, corners, kinds, sizes, half)


@kernel("b1(f8[:,::1], i4[::1], i8)")
def is_longest(places: Floats, corners: Ints, half: int) -> bool:
    """Tell whether no side of its face is longer than a half edge: else flat faces would be split for ever."""
    u, v, w = corners[half], corners[after(half)], corners[before(half)]
    longest = max(squared_length(places, u, w), squared_length(places, v, w))
    return bool(squared_length(places, u, v) >= longest)


@kernel("void(i4[::1], i4[::1], i4[::1], b1[::1], i8, i8, i8)")
def split_face(corners: Ints, twins: Ints, outs: Ints, sharp: Bools, half: int, m: int, g: int) -> None:
    """Part the face (u, v, w) of a half edge u -> v into (u, m, w) and a new one, (m, v, w)."""
    follow = after(half)
    v, w, beyond = corners[follow], corners[before(half)], twins[follow]
    one = 3 * g
    corners[one], corners[one + 1], corners[one + 2] = m, v, w
    sharp[one], sharp[one + 1], sharp[one + 2] = sharp[half], sharp[follow], False
    twins[one + 1] = beyond
    if beyond >= 0:
        twins[beyond] = one + 1
    corners[follow], sharp[follow] = m, False
    twins[follow], twins[one + 2] = one + 2, follow
    outs[v] = one + 1


@kernel(
    "void(f8[:,::1], i4[::1], i4[::1], i4[::1], i4[::1], u1[::1], b1[::1], f8[::1], i4[::1], i8[::1], b1[::1], "
    "i8[::1], i8, i8)"
)
def split_edges(
    places: Floats, corners: Ints, twins: Ints, outs: Ints, valence: Ints, kinds: Bytes, sharp: Bools, sizes: Floats,
    under: Ints, counts: NDArray[np.int64], marks: Bools, long: NDArray[np.int64], start: int, stop: int,
) -> None:  # fmt: skip
    """Split edges that were marked as too `long`, for which there is room, and mark those that are too long then."""
    for n in range(start, stop):
        half = long[n]
        other = twins[half]
        if not (marks[half] and is_longest(places, corners, half) and is_longest(places, corners, other)):
            continue
        u, v, m, g = corners[half], corners[after(half)], counts[0], counts[1]
        for axis in range(3):
            places[m, axis] = 0.5 * (places[u, axis] + places[v, axis])
        sizes[m] = 0.5 * (sizes[u] + sizes[v])
        under[m] = under[u]
        kinds[m] = CREASE if sharp[half] else FREE
        valence[m] = 4
        split_face(corners, twins, outs, sharp, half, m, g)
        split_face(corners, twins, outs, sharp, other, m, g + 1)
        valence[corners[before(half)]] += 1
        valence[corners[before(other)]] += 1
        # half: u -> m, and its partner in the other face's new half: m -> u
        one, two = 3 * g, 3 * (g + 1)
        twins[half], twins[two] = two, half
        twins[other], twins[one] = one, other
        outs[m] = one
        counts[0], counts[1] = m + 1, g + 2
        for face in (half // 3, other // 3, g, g + 1):
            for side in range(3 * face, 3 * face + 3):
                if twins[side] >= 0:
                    marks[min(side, twins[side])] = is_long(places, corners, kinds, sizes, side)
