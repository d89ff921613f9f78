"""Vertices of a mesh in the making move along the surface before. See `tomomesh.kernels.remeshing.links`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .links import CREASE, FREE, POOR, TINY, after, before, face_shape, shapes_around

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]
    Bytes = NDArray[np.uint8]
    Bools = NDArray[np.bool_]


@kernel("void(f8[:,::1], i4[::1], i4[::1], i4[::1], u1[::1], b1[::1], f8[::1], f8[:,::1], i8, i8)")
def relax(
    places: Floats, corners: Ints, twins: Ints, outs: Ints, kinds: Bytes, sharp: Bools, sizes: Floats, moved: Floats,
    start: int, stop: int,
) -> None:  # fmt: skip
    """Find where vertices (n, 3) lie evenly among their neighbors, within the surface or along a crease."""
    for v in range(start, stop):
        for axis in range(3):
            moved[v, axis] = places[v, axis]
        if outs[v] < 0 or kinds[v] > CREASE:
            continue
        sx = sy = sz = total = mx = my = mz = 0.0
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
            continue
        dx, dy, dz = sx / total - places[v, 0], sy / total - places[v, 1], sz / total - places[v, 2]
        if kinds[v] == FREE:
            along = (dx * mx + dy * my + dz * mz) / max(mx * mx + my * my + mz * mz, TINY)
            dx, dy, dz = dx - along * mx, dy - along * my, dz - along * mz
        moved[v, 0], moved[v, 1], moved[v, 2] = places[v, 0] + dx, places[v, 1] + dy, places[v, 2] + dz


@kernel("void(f8[:,::1], i4[::1], i4[::1], i4[::1], u1[::1], f8[::1], f8[:,::1], i8, i8)")
def lift(
    places: Floats, corners: Ints, twins: Ints, outs: Ints, kinds: Bytes, sags: Floats, moved: Floats,
    start: int, stop: int,
) -> None:  # fmt: skip
    """Find where vertices (n, 3) go by the mean sag of the faces around each, along their normal."""
    for v in range(start, stop):
        for axis in range(3):
            moved[v, axis] = places[v, axis]
        if outs[v] < 0 or kinds[v] != FREE:
            continue
        mx = my = mz = total = area = 0.0
        first = turn = outs[v]
        while True:
            nx, ny, nz, _ = face_shape(places, v, corners[after(turn)], corners[before(turn)])
            size = np.sqrt(nx * nx + ny * ny + nz * nz)
            mx, my, mz, area = mx + nx, my + ny, mz + nz, area + size
            total += size * sags[turn // 3]
            turn = twins[before(turn)]
            if turn == first:
                break
        along = total / max(area * np.sqrt(mx * mx + my * my + mz * mz), TINY)
        moved[v, 0], moved[v, 1], moved[v, 2] = (
            moved[v, 0] + along * mx,
            moved[v, 1] + along * my,
            moved[v, 2] + along * mz,
        )


@kernel("i8(f8[:,::1], i4[::1], i4[::1], i4[::1], u1[::1], f8[:,::1], i4[::1], f8[:,::1], i8, i8)")
def accept(
    places: Floats, corners: Ints, twins: Ints, outs: Ints, kinds: Bytes, normals: Floats, under: Ints, moved: Floats,
    start: int, stop: int,
) -> int:  # fmt: skip
    """Move vertices, one after the other, where no face turns over or gets a smaller angle than a poor one."""
    refused = 0
    for v in range(start, stop):
        if outs[v] < 0 or kinds[v] > CREASE:
            continue
        x, y, z = moved[v, 0], moved[v, 1], moved[v, 2]
        was, now = shapes_around(places, corners, twins, normals, under, outs[v], after(twins[outs[v]]), x, y, z)
        if now >= min(was, POOR):
            places[v, 0], places[v, 1], places[v, 2] = x, y, z
        else:
            refused += 1
    return refused
