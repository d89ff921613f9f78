"""Edges of a mesh in the making that are too short collapse. See `tomomesh.kernels.remeshing.links`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .lengths import TOO_SHORT, class_of
from .links import CREASE, FIXED, KEPT, LONG, POOR, after, before, face_shape, shapes_around

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]
    Bytes = NDArray[np.uint8]
    Bools = NDArray[np.bool_]


@kernel("b1(i4[::1], i4[::1], i4[::1], i4[::1], u1[::1], b1[::1], i4[::1], i8)")
def may_collapse(
    corners: Ints, twins: Ints, outs: Ints, valence: Ints, kinds: Bytes, sharp: Bools, stamps: Ints, half: int
) -> bool:
    """Tell whether the start of a half edge may go to its end: the surface stays a manifold of the same kind.

    No vertex but the two across may be a neighbor of both (the link condition; Dey et al. 1999).
    """
    other = twins[half]
    u, v = corners[half], corners[other]
    if kinds[u] >= FIXED or kinds[v] == KEPT or (kinds[u] == CREASE and not sharp[half]):
        return False
    if valence[corners[before(half)]] <= 3 or valence[corners[before(other)]] <= 3:
        return False
    turn = half
    while True:
        stamps[corners[after(turn)]] = half
        turn = twins[before(turn)]
        if turn == half:
            break
    common, turn = 0, other
    while True:
        common += stamps[corners[after(turn)]] == half
        turn = twins[before(turn)]
        if turn == other:
            break
    turn = half
    while True:
        stamps[corners[after(turn)]] = -1
        turn = twins[before(turn)]
        if turn == half:
            break
    return bool(common == 2)


@kernel("b1(f8[:,::1], i4[::1], i4[::1], f8[:,::1], i8, f8[::1], f8)")
def keeps_shape(
    places: Floats, corners: Ints, twins: Ints, ups: Floats, half: int, target: Floats, size: float
) -> bool:
    """Tell whether the faces around the start of a half edge stay as good, but for the two beside it, as it moves."""
    x, y, z, most = target[0], target[1], target[2], LONG * size
    first, last = twins[before(half)], after(twins[after(twins[half])])
    turn = first
    while True:
        b = corners[after(turn)]
        dx, dy, dz = places[b, 0] - x, places[b, 1] - y, places[b, 2] - z
        if dx * dx + dy * dy + dz * dz > most * most:
            return False
        if turn == last:
            break
        turn = twins[before(turn)]
    u, v = corners[half], corners[twins[half]]
    _, _, _, one = face_shape(places, u, v, corners[before(half)])
    _, _, _, two = face_shape(places, v, u, corners[before(twins[half])])
    was, now = shapes_around(places, corners, twins, ups, first, last, x, y, z)
    return bool(now >= min(was, one, two, POOR))


@kernel("void(i4[::1], i4[::1], i4[::1], i4[::1], b1[::1], i8, i8)")
def close_face(corners: Ints, twins: Ints, outs: Ints, valence: Ints, sharp: Bools, half: int, v: int) -> None:
    """Take out the face of a half edge whose two ends are vertex v now, and join the edges on its other sides."""
    one, two, w = twins[after(half)], twins[before(half)], corners[before(half)]
    valence[w] -= 1
    sharp[one] = sharp[two] = sharp[one] or sharp[two]
    twins[one], twins[two] = two, one
    outs[v], outs[w] = two, one
    first = half - half % 3
    corners[first], corners[first + 1], corners[first + 2] = -1, -1, -1


@kernel("void(i4[::1], i4[::1], i4[::1], i4[::1], b1[::1], i8)")
def collapse(corners: Ints, twins: Ints, outs: Ints, valence: Ints, sharp: Bools, half: int) -> None:
    """Let the end of a half edge take the place of its start, and close up the two faces beside it."""
    other = twins[half]
    u, v = corners[half], corners[other]
    turn = half
    while True:
        corners[turn] = v
        turn = twins[before(turn)]
        if turn == half:
            break
    valence[v] += valence[u] - 4
    close_face(corners, twins, outs, valence, sharp, half, v)
    close_face(corners, twins, outs, valence, sharp, other, v)
    outs[u] = -1


@kernel(
    "i8(f8[:,::1], i4[::1], i4[::1], i4[::1], i4[::1], u1[::1], b1[::1], f8[::1], f8[:,::1], i4[::1], i8[::1], i8, i8)"
)
def collapse_edges(
    places: Floats, corners: Ints, twins: Ints, outs: Ints, valence: Ints, kinds: Bytes, sharp: Bools, sizes: Floats,
    ups: Floats, stamps: Ints, short: NDArray[np.int64], start: int, stop: int,
) -> int:  # fmt: skip
    """Collapse edges that are too `short`, where the surface stays what it is and no face gets worse than it may."""
    made = 0
    target = np.empty(3)
    for n in range(start, stop):
        half = short[n]
        other = twins[half]
        if corners[half] < 0 or class_of(places, corners, kinds, sizes, half) != TOO_SHORT:
            continue
        u, v = corners[half], corners[other]
        if kinds[u] > kinds[v]:
            half, other, u, v = other, half, v, u
        if not may_collapse(corners, twins, outs, valence, kinds, sharp, stamps, half):
            continue
        share = 0.5 if kinds[u] == kinds[v] else 1.0
        for axis in range(3):
            target[axis] = places[u, axis] + share * (places[v, axis] - places[u, axis])
        size = sizes[v] if share == 1.0 else 0.5 * (sizes[u] + sizes[v])
        if not keeps_shape(places, corners, twins, ups, half, target, size):
            continue
        if share < 1.0 and not keeps_shape(places, corners, twins, ups, other, target, size):
            continue
        for axis in range(3):
            places[v, axis] = target[axis]
        sizes[v] = size
        collapse(corners, twins, outs, valence, sharp, half)
        made += 1
    return made
