"""Edges of a mesh in the making are flipped. See `tomomesh.kernels.remeshing.links`.

Every loop goes over half edges from `start` to `stop`, one of each pair, in their order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .links import KEPT, LONG, after, before, face_shape, faces_out, squared_length, upright

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]
    Bytes = NDArray[np.uint8]
    Bools = NDArray[np.bool_]

BETTER = 1.02
"""How much larger a flip must make the smallest squared sine: above rounding, so that none is flipped for ever."""
RISE = 0.2
"""Most that a flip may move the surface, in edges."""


@kernel("b1(i4[::1], i4[::1], i4[::1], u1[::1], i8, i8)")
def adjacent(corners: Ints, twins: Ints, outs: Ints, kinds: Bytes, c: int, d: int) -> bool:
    """Tell whether two vertices, one of which is not on a border, share an edge."""
    if kinds[c] == KEPT:
        c, d = d, c
    first = turn = outs[c]
    while True:
        if corners[after(turn)] == d:
            return True
        turn = twins[before(turn)]
        if turn == first:
            return False


@kernel("void(i4[::1], i4[::1], i4[::1], i4[::1], b1[::1], i8)")
def flip(corners: Ints, twins: Ints, outs: Ints, valence: Ints, sharp: Bools, half: int) -> None:
    """Turn the edge between the faces (a, b, c) and (b, a, d) into one from d to c: faces (d, c, a) and (c, d, b)."""
    other = twins[half]
    bc, ca, ad, db = after(half), before(half), after(other), before(other)
    a, b, c, d = corners[half], corners[other], corners[ca], corners[db]
    across = twins[bc], twins[ca], twins[ad], twins[db]
    keen = sharp[bc], sharp[ca], sharp[ad], sharp[db]
    # face of half: d -> c -> a; face of other: c -> d -> b
    corners[half], corners[bc], corners[ca] = d, c, a
    corners[other], corners[ad], corners[db] = c, d, b
    sides = bc, ca, ad, db
    # sides c -> a and a -> d, d -> b and b -> c
    for n in range(4):
        side = sides[n]
        twins[side], sharp[side] = across[(n + 1) % 4], keen[(n + 1) % 4]
        if twins[side] >= 0:
            twins[twins[side]] = side
    outs[c], outs[a], outs[d], outs[b] = bc, ca, ad, db
    valence[a] -= 1
    valence[b] -= 1
    valence[c] += 1
    valence[d] += 1


@kernel("i8(f8[:,::1], i4[::1], i4[::1], i4[::1], i4[::1], u1[::1], b1[::1], f8[::1], f8[:,::1], i8, i8)")
def flip_edges(
    places: Floats, corners: Ints, twins: Ints, outs: Ints, valence: Ints, kinds: Bytes, sharp: Bools, sizes: Floats,
    ups: Floats, start: int, stop: int,
) -> int:  # fmt: skip
    """Flip edges where that makes the smallest angle of the two faces beside it larger."""
    made = 0
    for half in range(start, stop):
        other = twins[half]
        if corners[half] < 0 or other < half or sharp[half]:
            continue
        a, b = corners[half], corners[other]
        if kinds[a] == KEPT == kinds[b]:
            continue
        c, d = corners[before(half)], corners[before(other)]
        if valence[a] <= 3 or valence[b] <= 3 or kinds[c] == KEPT == kinds[d]:
            continue
        most = LONG * 0.5 * (sizes[c] + sizes[d])
        if squared_length(places, c, d) > max(most * most, squared_length(places, a, b)):
            continue
        px, py, pz, one = face_shape(places, a, b, c)
        qx, qy, qz, two = face_shape(places, b, a, d)
        rx, ry, rz, three = face_shape(places, c, a, d)
        sx, sy, sz, four = face_shape(places, d, b, c)
        if min(three, four) <= BETTER * min(one, two):
            continue
        ox, oy, oz = px + qx, py + qy, pz + qz
        if not (upright(ox, oy, oz, rx, ry, rz) and upright(ox, oy, oz, sx, sy, sz)):
            continue
        if not (faces_out(ups, c, a, d, rx, ry, rz) and faces_out(ups, d, b, c, sx, sy, sz)):
            continue
        size = np.sqrt(ox * ox + oy * oy + oz * oz)
        # twice the area of the four corners' shadow, times the distance of the two diagonals
        rise = abs(
            (places[d, 0] - places[a, 0]) * px + (places[d, 1] - places[a, 1]) * py + (places[d, 2] - places[a, 2]) * pz
        )
        if rise > RISE * 0.25 * (sizes[a] + sizes[b] + sizes[c] + sizes[d]) * size:
            continue
        if adjacent(corners, twins, outs, kinds, c, d):
            continue
        flip(corners, twins, outs, valence, sharp, half)
        made += 1
    return made
