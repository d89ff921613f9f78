"""The surface before, over which the vertices of a mesh in the making move."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .links import TINY

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]
    Bytes = NDArray[np.uint8]
    Bools = NDArray[np.bool_]

WALK = 64
"""Most faces that are gone over at once: a vertex moves by less than an edge, over faces about as large. No mesh of the
benchmarks takes more than a few."""


@kernel("f8(f8, f8, f8, f8[:,::1], i8, i8, f8[::1])")
def place_on_side(x: float, y: float, z: float, places: Floats, a: int, b: int, place: Floats) -> float:
    """Find the place on a line between two vertices that is nearest to another; return the squared distance."""
    ux, uy, uz = places[b, 0] - places[a, 0], places[b, 1] - places[a, 1], places[b, 2] - places[a, 2]
    dx, dy, dz = x - places[a, 0], y - places[a, 1], z - places[a, 2]
    t = (ux * dx + uy * dy + uz * dz) / max(ux * ux + uy * uy + uz * uz, TINY)
    t = min(max(t, 0.0), 1.0)
    place[0], place[1], place[2] = places[a, 0] + t * ux, places[a, 1] + t * uy, places[a, 2] + t * uz
    dx, dy, dz = dx - t * ux, dy - t * uy, dz - t * uz
    return float(dx * dx + dy * dy + dz * dz)


@kernel("Tuple((f8, i8))(f8, f8, f8, f8[:,::1], i4[:,::1], i8, f8[::1])")
def place_on_face(
    x: float, y: float, z: float, places: Floats, faces: Ints, f: int, place: Floats
) -> tuple[float, int]:
    """Find the place in a face that is nearest to another; return the squared distance, and what the place is at.

    That is a corner, 0 to 2, or a side, 3 to 5, or -1: inside. By the corner or the side that the other place lies
    beyond (Ericson 2005).
    """
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    ux, uy, uz = places[b, 0] - places[a, 0], places[b, 1] - places[a, 1], places[b, 2] - places[a, 2]
    vx, vy, vz = places[c, 0] - places[a, 0], places[c, 1] - places[a, 1], places[c, 2] - places[a, 2]
    dx, dy, dz = x - places[a, 0], y - places[a, 1], z - places[a, 2]
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    ud, vd = ux * dx + uy * dy + uz * dz, vx * dx + vy * dy + vz * dz
    # u and v times the way from b and from c, and the shares of the corners
    ub, vb, uc, vc = ud - uu, vd - uv, ud - uv, vd - vv
    at_a, at_b, at_c = ub * vc - uc * vb, uc * vd - ud * vc, ud * vb - ub * vd
    at, s, t = -1, 0.0, 0.0
    if ud <= 0.0 and vd <= 0.0:
        at = 0
    elif ub >= 0.0 and vb <= ub:
        at, s = 1, 1.0
    elif vc >= 0.0 and uc <= vc:
        at, t = 2, 1.0
    elif at_c <= 0.0 and ud >= 0.0 and ub <= 0.0:
        at, s = 3, ud / max(uu, TINY)
    elif at_b <= 0.0 and vd >= 0.0 and vc <= 0.0:
        at, t = 5, vd / max(vv, TINY)
    elif at_a <= 0.0:
        t = (vb - ub) / max(vb - ub + uc - vc, TINY)
        at, s = 4, 1.0 - t
    else:
        whole = max(at_a + at_b + at_c, TINY)
        s, t = at_b / whole, at_c / whole
    dx, dy, dz = dx - s * ux - t * vx, dy - s * uy - t * vy, dz - s * uz - t * vz
    place[0], place[1], place[2] = x - dx, y - dy, z - dz
    return dx * dx + dy * dy + dz * dz, at


@kernel("f8(f8, f8, f8, f8[:,::1], i4[:,::1], b1[:,::1], i8, f8[::1])")
def place_on_crease(
    x: float, y: float, z: float, places: Floats, faces: Ints, creases: Bools, f: int, place: Floats
) -> float:
    """Find the place on the creases of a face that is nearest to another; return the squared distance, or infinity."""
    best, fx, fy, fz = np.inf, 0.0, 0.0, 0.0
    for k in range(3):
        if creases[f, k]:
            here = place_on_side(x, y, z, places, faces[f, k], faces[f, (k + 1) % 3], place)
            if here < best:
                best, fx, fy, fz = here, place[0], place[1], place[2]
    place[0], place[1], place[2] = fx, fy, fz
    return best


@kernel("i8(f8, f8, f8, f8[:,::1], i4[:,::1], i4[::1], i4[::1], i4[::1], i8, f8[::1], f8[::1])")
def walk(
    x: float, y: float, z: float, surface: Floats, faces: Ints, twins: Ints, fans: Ints, first: Ints, face: int,
    spare: Floats, place: Floats,
) -> int:  # fmt: skip
    """Find the place on a surface that is nearest to another, from face to face; return its face.

    It goes on, over sides and around corners, as long as it gets nearer. So none is taken through a thin plate to its
    other side.
    """
    best, at = place_on_face(x, y, z, surface, faces, face, place)
    for _ in range(WALK):
        here, start, stop = face, 0, 0
        if 0 <= at < 3:
            start, stop = first[faces[here, at]], first[faces[here, at] + 1]
        elif at >= 3:
            start, stop = at - 3, at - 2
        side = at >= 3
        for n in range(start, stop):
            other = twins[3 * here + n] // 3 if side else fans[n]
            if other < 0 or other == here:
                continue
            squared, beside = place_on_face(x, y, z, surface, faces, other, spare)
            if squared < best:
                best, face, at = squared, other, beside
                place[0], place[1], place[2] = spare[0], spare[1], spare[2]
        if face == here:
            break
    return face


@kernel("i8(f8, f8, f8, f8[:,::1], i4[:,::1], b1[:,::1], i4[::1], i4[::1], i8, f8[::1], f8[::1])")
def walk_along(
    x: float, y: float, z: float, surface: Floats, faces: Ints, creases: Bools, fans: Ints, first: Ints, face: int,
    spare: Floats, place: Floats,
) -> int:  # fmt: skip
    """Find the place on the creases of a surface that is nearest to another, like `walk`; -1 where there is none."""
    best = place_on_crease(x, y, z, surface, faces, creases, face, place)
    for _ in range(WALK):
        here = face
        for k in range(3):
            corner = faces[here, k]
            for n in range(first[corner], first[corner + 1]):
                squared = place_on_crease(x, y, z, surface, faces, creases, fans[n], spare)
                if squared < best:
                    best, face = squared, fans[n]
                    place[0], place[1], place[2] = spare[0], spare[1], spare[2]
        if face == here:
            break
    return face if best < np.inf else -1


@kernel("void(f8[:,::1], i4[:,::1], i4[::1], i4[::1], i4[::1], f8[:,::1], i4[::1], i4[::1], f8[:,::1], i8, i8)")
def find_goals(
    surface: Floats, faces: Ints, twins: Ints, fans: Ints, first: Ints, places: Floats, corners: Ints, under: Ints,
    goals: Floats, start: int, stop: int,
) -> None:  # fmt: skip
    """Find where the plane of each face (m,) should go through, so that it lies on both sides of the surface before.

    Three quarters of the way from the middle of the face, whose corners lie on the surface, to the surface: so
    much of it lies above as beneath, exactly where the surface is quadratic.
    """
    spare, place = np.empty(3), np.empty(3)
    for f in range(start, stop):
        a, b, c = corners[3 * f], corners[3 * f + 1], corners[3 * f + 2]
        if a < 0:
            continue
        for axis in range(3):
            goals[f, axis] = (places[a, axis] + places[b, axis] + places[c, axis]) / 3.0
        walk(goals[f, 0], goals[f, 1], goals[f, 2], surface, faces, twins, fans, first, under[a], spare, place)
        for axis in range(3):
            goals[f, axis] += 0.75 * (place[axis] - goals[f, axis])
