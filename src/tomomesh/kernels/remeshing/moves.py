"""Vertices of a mesh in the making move along the surface before. See `tomomesh.kernels.remeshing.links`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .ground import walk, walk_along
from .links import CREASE, FREE, POOR, TINY, UPRIGHT, after, before, face_shape, put_normal, shapes_around

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]
    Bytes = NDArray[np.uint8]
    Bools = NDArray[np.bool_]

OVER = 1.5
"""How far a vertex is lifted over what its own faces ask for: its neighbors' lifts come on top (successive
over-relaxation). Chosen: with 1 it takes a round more to as small an error of the volume, with 2 some swing."""


@kernel("void(f8[:,::1], i4[::1], i4[::1], i4[::1], u1[::1], b1[::1], f8[::1], i8, f8[::1])")
def relax(
    places: Floats, corners: Ints, twins: Ints, outs: Ints, kinds: Bytes, sharp: Bools, sizes: Floats, v: int,
    place: Floats,
) -> None:  # fmt: skip
    """Find where a vertex lies evenly among its neighbors, within the surface or along a crease."""
    sx = sy = sz = total = mx = my = mz = 0.0
    place[0], place[1], place[2] = places[v, 0], places[v, 1], places[v, 2]
    first = turn = outs[v]
    while True:
        b, c = corners[after(turn)], corners[before(turn)]
        if kinds[v] == FREE:
            nx, ny, nz, _ = face_shape(places, v, b, c)
            mx, my, mz = mx + nx, my + ny, mz + nz
            size = sizes[v] + sizes[b] + sizes[c]
            weight = np.sqrt(nx * nx + ny * ny + nz * nz) / (size * size)
            sx += weight * (places[b, 0] + places[c, 0] + places[v, 0]) / 3.0
            sy += weight * (places[b, 1] + places[c, 1] + places[v, 1]) / 3.0
            sz += weight * (places[b, 2] + places[c, 2] + places[v, 2]) / 3.0
            total += weight
        elif sharp[turn]:
            sx, sy, sz = sx + places[b, 0], sy + places[b, 1], sz + places[b, 2]
            total += 1.0
        turn = twins[before(turn)]
        if turn == first:
            break
    if total <= TINY:
        return
    dx, dy, dz = sx / total - places[v, 0], sy / total - places[v, 1], sz / total - places[v, 2]
    if kinds[v] == FREE:
        along = (dx * mx + dy * my + dz * mz) / max(mx * mx + my * my + mz * mz, TINY)
        dx, dy, dz = dx - along * mx, dy - along * my, dz - along * mz
    place[0], place[1], place[2] = places[v, 0] + dx, places[v, 1] + dy, places[v, 2] + dz


@kernel("b1(f8[:,::1], i4[::1], i4[::1], i8, f8, f8, f8, f8, f8, f8)")
def all_good(
    places: Floats, corners: Ints, twins: Ints, first: int, x: float, y: float, z: float, ux: float, uy: float,
    uz: float,
) -> bool:  # fmt: skip
    """Tell whether all faces around a vertex have no poor angle, and turn little from a normal, if it is at a place."""
    turn = first
    b = corners[after(turn)]
    bx, by, bz = places[b, 0] - x, places[b, 1] - y, places[b, 2] - z
    bb = bx * bx + by * by + bz * bz
    while True:
        side = before(turn)
        c = corners[side]
        cx, cy, cz = places[c, 0] - x, places[c, 1] - y, places[c, 2] - z
        cc = cx * cx + cy * cy + cz * cz
        bc = bx * cx + by * cy + bz * cz
        nn = bb * cc - bc * bc
        aa = bb + cc - 2.0 * bc
        nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        up = nx * ux + ny * uy + nz * uz
        if not (up > 0.0 and up * up >= UPRIGHT * nn and nn >= POOR * max(bb * cc, bb * aa, cc * aa)):
            return False
        turn = twins[side]
        if turn == first:
            return True
        bx, by, bz, bb = cx, cy, cz, cc


@kernel("b1(f8[:,::1], i4[::1], i4[::1], i4[::1], f8[:,::1], i8, f8[::1])")
def may_move(places: Floats, corners: Ints, twins: Ints, outs: Ints, ups: Floats, v: int, place: Floats) -> bool:
    """Tell whether no face turns over, or gets a smaller angle than a poor one, as a vertex goes to a place."""
    first = outs[v]
    if all_good(
        places, corners, twins, first, place[0], place[1], place[2], ups[v, 0], ups[v, 1], ups[v, 2]
    ):  # fmt: skip
        return True
    was, now = shapes_around(places, corners, twins, ups, first, after(twins[first]), place[0], place[1], place[2])
    return bool(now >= min(was, POOR))


@kernel(
    "void(f8[:,::1], i4[::1], i4[::1], i4[::1], u1[::1], b1[::1], f8[::1], i4[::1], f8[:,::1], f8[:,::1], i4[:,::1], "
    "b1[:,::1], i4[::1], i4[::1], i4[::1], f8[::1], i8, i8)"
)
def move_vertices(
    places: Floats, corners: Ints, twins: Ints, outs: Ints, kinds: Bytes, sharp: Bools, sizes: Floats, under: Ints,
    ups: Floats, surface: Floats, faces: Ints, creases: Bools, across: Ints, fans: Ints, first: Ints, wanted: Floats,
    start: int, stop: int,
) -> None:  # fmt: skip
    """Move vertices, one after the other, evenly among their neighbors and along the surface before."""
    spare, place, aim = np.empty(3), np.empty(3), np.empty(3)
    for v in range(start, stop):
        if outs[v] < 0 or kinds[v] > CREASE:
            continue
        relax(places, corners, twins, outs, kinds, sharp, sizes, v, aim)
        if kinds[v] == CREASE:
            face = walk_along(aim[0], aim[1], aim[2], surface, faces, creases, fans, first, under[v], spare, place)
        else:
            face = walk(aim[0], aim[1], aim[2], surface, faces, across, fans, first, under[v], spare, place)
        if face < 0 or not may_move(places, corners, twins, outs, ups, v, place):
            continue
        under[v] = face
        sizes[v] = (wanted[faces[face, 0]] + wanted[faces[face, 1]] + wanted[faces[face, 2]]) / 3.0
        places[v, 0], places[v, 1], places[v, 2] = place[0], place[1], place[2]
        put_normal(surface, faces, face, ups, v)


@kernel("void(f8[:,::1], i4[::1], i4[::1], i4[::1], u1[::1], f8[:,::1], f8[:,::1], i8, i8)")
def lift_vertices(
    places: Floats, corners: Ints, twins: Ints, outs: Ints, kinds: Bytes, ups: Floats, goals: Floats,
    start: int, stop: int,
) -> None:  # fmt: skip
    """Move vertices, one after the other, along their normal until the faces around each pass by their goals (m, 3)."""
    place = np.empty(3)
    for v in range(start, stop):
        if outs[v] < 0 or kinds[v] != FREE:
            continue
        mx = my = mz = total = area = 0.0
        x, y, z = places[v, 0], places[v, 1], places[v, 2]
        first = turn = outs[v]
        while True:
            nx, ny, nz, _ = face_shape(places, v, corners[after(turn)], corners[before(turn)])
            mx, my, mz, area = mx + nx, my + ny, mz + nz, area + np.sqrt(nx * nx + ny * ny + nz * nz)
            f = turn // 3
            total += nx * (goals[f, 0] - x) + ny * (goals[f, 1] - y) + nz * (goals[f, 2] - z)
            turn = twins[before(turn)]
            if turn == first:
                break
        along = OVER * total / max(area * np.sqrt(mx * mx + my * my + mz * mz), TINY)
        place[0], place[1], place[2] = places[v, 0] + along * mx, places[v, 1] + along * my, places[v, 2] + along * mz
        if may_move(places, corners, twins, outs, ups, v, place):
            places[v, 0], places[v, 1], places[v, 2] = place[0], place[1], place[2]
