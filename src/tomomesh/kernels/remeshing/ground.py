"""The surface before, over which the vertices of a mesh in the making move."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .links import CREASE, FREE, TINY, after, face_shape

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
    """Find the place in a face that is nearest to another; return the squared distance, and the corner it is at or -1.

    By the corner or the side that the other place lies beyond (Ericson 2005).
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
    corner, s, t = -1, 0.0, 0.0
    if ud <= 0.0 and vd <= 0.0:
        corner = 0
    elif ub >= 0.0 and vb <= ub:
        corner, s = 1, 1.0
    elif vc >= 0.0 and uc <= vc:
        corner, t = 2, 1.0
    elif at_c <= 0.0 and ud >= 0.0 and ub <= 0.0:
        s = ud / max(uu, TINY)
    elif at_b <= 0.0 and vd >= 0.0 and vc <= 0.0:
        t = vd / max(vv, TINY)
    elif at_a <= 0.0:
        t = (vb - ub) / max(vb - ub + uc - vc, TINY)
        s = 1.0 - t
    else:
        whole = max(at_a + at_b + at_c, TINY)
        s, t = at_b / whole, at_c / whole
    dx, dy, dz = dx - s * ux - t * vx, dy - s * uy - t * vy, dz - s * uz - t * vz
    place[0], place[1], place[2] = x - dx, y - dy, z - dz
    return dx * dx + dy * dy + dz * dz, corner


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
    best, corner = place_on_face(x, y, z, surface, faces, face, place)
    for _ in range(WALK):
        here, at = face, corner
        start, stop = (first[faces[here, at]], first[faces[here, at] + 1]) if at >= 0 else (0, 3)
        for n in range(start, stop):
            other = fans[n] if at >= 0 else twins[3 * here + n] // 3
            if other < 0 or other == here:
                continue
            squared, beside = place_on_face(x, y, z, surface, faces, other, spare)
            if squared < best:
                best, face, corner = squared, other, beside
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


@kernel(
    "void(f8[:,::1], i4[:,::1], b1[:,::1], i4[::1], i4[::1], i4[::1], f8[::1], i4[::1], u1[::1], f8[:,::1], i4[::1], "
    "f8[::1], i8, i8)"
)
def project(
    surface: Floats, faces: Ints, creases: Bools, twins: Ints, fans: Ints, first: Ints, wanted: Floats, outs: Ints,
    kinds: Bytes, moved: Floats, under: Ints, sizes: Floats, start: int, stop: int,
) -> None:  # fmt: skip
    """Take places (n, 3) to the surface before, from the face that was last below each; find the sizes there."""
    spare, place = np.empty(3), np.empty(3)
    for v in range(start, stop):
        if outs[v] < 0 or kinds[v] > CREASE:
            continue
        x, y, z = moved[v, 0], moved[v, 1], moved[v, 2]
        if kinds[v] == CREASE:
            face = walk_along(x, y, z, surface, faces, creases, fans, first, under[v], spare, place)
        else:
            face = walk(x, y, z, surface, faces, twins, fans, first, under[v], spare, place)
        if face >= 0:
            moved[v, 0], moved[v, 1], moved[v, 2] = place[0], place[1], place[2]
            under[v] = face
        face = under[v]
        sizes[v] = (wanted[faces[face, 0]] + wanted[faces[face, 1]] + wanted[faces[face, 2]]) / 3.0


@kernel(
    "void(f8[:,::1], i4[:,::1], i4[::1], i4[::1], i4[::1], f8[:,::1], f8[:,::1], i4[::1], u1[::1], i4[::1], f8[::1], "
    "i8, i8)"
)
def find_sags(
    surface: Floats, faces: Ints, twins: Ints, fans: Ints, first: Ints, begun: Floats, places: Floats, corners: Ints,
    kinds: Bytes, below: Ints, sags: Floats, start: int, stop: int,
) -> None:  # fmt: skip
    """Find how far the surface before lies above each face on average, (m,), where `begun` (n, 3) lie on it.

    Three quarters of what is found in the middle and a twelfth at each corner: exact where the surface is quadratic.
    The face `below` (m,) each middle is where it is looked for first, and what is found.
    """
    spare, place, center = np.empty(3), np.empty(3), np.empty(3)
    for f in range(start, stop):
        a, b, c = corners[3 * f], corners[3 * f + 1], corners[3 * f + 2]
        if a < 0 or (kinds[a] != FREE and kinds[b] != FREE and kinds[c] != FREE):
            continue
        for axis in range(3):
            center[axis] = (places[a, axis] + places[b, axis] + places[c, axis]) / 3.0
        x, y, z, _ = face_shape(places, a, b, c)
        below[f] = walk(center[0], center[1], center[2], surface, faces, twins, fans, first, below[f], spare, place)
        for axis in range(3):
            low = begun[a, axis] + begun[b, axis] + begun[c, axis] - 3.0 * center[axis]
            place[axis] = 0.75 * (place[axis] - center[axis]) + low / 12.0
        sags[f] = (place[0] * x + place[1] * y + place[2] * z) / max(np.sqrt(x * x + y * y + z * z), TINY)


@kernel("void(i4[::1], i4[::1], i4[::1], i4[::1], i4[::1], i4[::1])")
def link(corners: Ints, order: Ints, first: Ints, twins: Ints, outs: Ints, valence: Ints) -> None:
    """Pair half edges from the list of edges, find a half edge from each vertex, and count edges."""
    for half in range(len(corners)):
        outs[corners[half]] = half
    for edge in range(len(first) - 1):
        one, other = order[first[edge]], order[first[edge + 1] - 1]
        if one == other:
            twins[one] = -1
        else:
            twins[one], twins[other] = other, one
        valence[corners[one]] += 1
        valence[corners[after(one)]] += 1


@kernel("void(i4[:,::1], i4[::1], i4[::1])")
def gather_fans(faces: Ints, first: Ints, fans: Ints) -> None:
    """Put the faces around each vertex beside each other.

    Parameters
    ----------
    faces : (m, 3) int32 array
    first : (n + 1,) int32 array
        Zeros. Result: the faces around vertex v are ``fans[first[v]:first[v + 1]]``.
    fans : (3 m,) int32 array
        Result.
    """
    for f in range(len(faces)):
        for k in range(3):
            first[faces[f, k] + 1] += 1
    for v in range(len(first) - 1):
        first[v + 1] += first[v]
    place = first.copy()
    for f in range(len(faces)):
        for k in range(3):
            v = faces[f, k]
            fans[place[v]] = f
            place[v] += 1


@kernel("void(i4[:,::1], f8[:,::1], f8[:,::1])")
def mix_normals(faces: Ints, normals: Floats, mixed: Floats) -> None:
    """Add to each normal (n, 3) those of its neighbors, and bring all to length 1."""
    mixed[:] = normals
    for f in range(len(faces)):
        for k in range(3):
            for other in range(1, 3):
                for axis in range(3):
                    mixed[faces[f, k], axis] += 0.5 * normals[faces[f, (k + other) % 3], axis]
    for v in range(len(mixed)):
        length = np.sqrt(mixed[v, 0] ** 2 + mixed[v, 1] ** 2 + mixed[v, 2] ** 2)
        for axis in range(3):
            mixed[v, axis] /= max(length, TINY)


@kernel("void(f8[:,::1], i4[:,::1], f8[:,::1], f8[::1])")
def find_bends(vertices: Floats, faces: Ints, normals: Floats, bends: Floats) -> None:
    """Find the largest normal curvature (n,) along the edges at each vertex, from normals (n, 3)."""
    bends[:] = 0.0
    for f in range(len(faces)):
        for k in range(3):
            a, b = faces[f, k], faces[f, (k + 1) % 3]
            turn = squared = 0.0
            for axis in range(3):
                along = vertices[b, axis] - vertices[a, axis]
                turn += (normals[b, axis] - normals[a, axis]) * along
                squared += along * along
            bend = abs(turn) / max(squared, TINY)
            bends[a], bends[b] = max(bends[a], bend), max(bends[b], bend)


@kernel("void(f8[:,::1], i4[:,::1], f8[::1], f8)")
def grade_sizes(vertices: Floats, faces: Ints, sizes: Floats, slope: float) -> None:
    """Keep sizes (n,) from growing faster along edges than by a slope: forward once and backward once."""
    for pass_ in range(2):
        for n in range(len(faces)):
            f = n if pass_ == 0 else len(faces) - 1 - n
            for k in range(3):
                a, b = faces[f, k], faces[f, (k + 1) % 3]
                squared = 0.0
                for axis in range(3):
                    squared += (vertices[b, axis] - vertices[a, axis]) ** 2
                more = slope * np.sqrt(squared)
                sizes[a], sizes[b] = min(sizes[a], sizes[b] + more), min(sizes[b], sizes[a] + more)
