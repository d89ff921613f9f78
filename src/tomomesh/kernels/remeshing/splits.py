"""Edges of a mesh in the making that are too long are split. See `tomomesh.kernels.remeshing.links`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..compile import kernel
from .lengths import TOO_LONG, class_of
from .links import CREASE, FREE, after, before, squared_length

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]
    Bytes = NDArray[np.uint8]
    Bools = NDArray[np.bool_]


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
    "void(f8[:,::1], i4[::1], i4[::1], i4[::1], i4[::1], u1[::1], b1[::1], f8[::1], i4[::1], f8[:,::1], i8[::1], "
    "u1[::1], i8[::1], i8, i8)"
)
def split_edges(
    places: Floats, corners: Ints, twins: Ints, outs: Ints, valence: Ints, kinds: Bytes, sharp: Bools, sizes: Floats,
    under: Ints, ups: Floats, counts: NDArray[np.int64], marks: Bytes, long: NDArray[np.int64], start: int, stop: int,
) -> None:  # fmt: skip
    """Split edges that were marked as too `long`, for which there is room, and mark the edges around anew."""
    for n in range(start, stop):
        half = long[n]
        other = twins[half]
        if not (marks[half] == TOO_LONG and is_longest(places, corners, half) and is_longest(places, corners, other)):
            continue
        u, v, m, g = corners[half], corners[after(half)], counts[0], counts[1]
        for axis in range(3):
            places[m, axis] = 0.5 * (places[u, axis] + places[v, axis])
            ups[m, axis] = ups[u, axis]
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
                    marks[min(side, twins[side])] = class_of(places, corners, kinds, sizes, side)
