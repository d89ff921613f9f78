"""Edges of a mesh in the making that are too long are split. See `tomomesh.kernels.remeshing.links`.

Every loop goes over half edges from `start` to `stop`, one of each pair, in their order.
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


@kernel("i8(f8[:,::1], i4[::1], i4[::1], u1[::1], f8[::1], i8, i8)")
def count_long(places: Floats, corners: Ints, twins: Ints, kinds: Bytes, sizes: Floats, start: int, stop: int) -> int:
    """Count the edges that are too long."""
    count = 0
    for half in range(start, stop):
        if corners[half] < 0 or twins[half] < half:
            continue
        u, v = corners[half], corners[after(half)]
        most = LONG * 0.5 * (sizes[u] + sizes[v])
        count += squared_length(places, u, v) > most * most and not kinds[u] == KEPT == kinds[v]
    return count


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


@kernel("i8(f8[:,::1], i4[::1], i4[::1], i4[::1], i4[::1], u1[::1], b1[::1], f8[::1], i4[::1], i8[::1], i8, i8)")
def split_edges(
    places: Floats, corners: Ints, twins: Ints, outs: Ints, valence: Ints, kinds: Bytes, sharp: Bools, sizes: Floats,
    under: Ints, counts: NDArray[np.int64], start: int, stop: int,
) -> int:  # fmt: skip
    """Split edges that are too long, as far as there is room."""
    made = 0
    for half in range(start, stop):
        other = twins[half]
        if corners[half] < 0 or other < half:
            continue
        u, v = corners[half], corners[after(half)]
        most = LONG * 0.5 * (sizes[u] + sizes[v])
        if squared_length(places, u, v) <= most * most or kinds[u] == KEPT == kinds[v]:
            continue
        if not (is_longest(places, corners, half) and is_longest(places, corners, other)):
            continue
        m, g = counts[0], counts[1]
        if m + 1 > len(outs) or 3 * (g + 2) > len(corners):
            break
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
        made += 1
    return made
