"""What the loops over a mesh in the making share: its arrays, and shapes of its faces.

A mesh in the making is a few arrays with room for more. Half edge 3 f + k runs from corner k of face f to the next.

`places` (n, 3)
    Positions of the vertices.
`corners` (3 m,)
    The vertex that each half edge starts from; -1 in faces that are no more.
`twins` (3 m,)
    The half edge that runs the other way; -1 at a border.
`outs` (n,)
    A half edge from each vertex; -1 for vertices that are no more.
`valence` (n,)
    Edges at each vertex.
`kinds` (n,)
    `FREE`, `CREASE`, `FIXED` or `KEPT`.
`sharp` (3 m,)
    Whether a half edge lies on a crease.
`sizes` (n,)
    Length that the edges at a vertex should have.
`under` (n,)
    The face of the surface before that lies under each vertex.
`ups` (n, 3)
    The normal of that face.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]

FREE, CREASE, FIXED, KEPT = 0, 1, 2, 3
"""Vertices that go anywhere on the surface, along a crease, or nowhere; and those whose edges to each other stay too,
as at a border."""
LONG, SHORT = 1.4, 4 / 5
"""Shares of its wanted length over and under which an edge is split or collapsed. Botsch & Kobbelt (2004) split from
4/3: then more of the halves are too short at once, and collapse. Chosen: 4/3 lies 3 % farther from the surface before
with as many faces; with 1.45 a ball has 3 % more faces on its one side."""
TINY = 1e-300
"""Least divisor: a face without area has no angle."""
UPRIGHT = 0.5
"""Least squared cosine of the turn of a face, of 45 degrees, as one of its corners moves."""
POOR = 0.18
"""Squared sine of the smallest angle, of 25 degrees: a face may get a worse one only where its neighbors had one. Every
mesh is to have 99 of 100 angles above it."""
SLIVER = 0.003
"""Squared sine of the smallest angle, of 3 degrees, under which the normal of a face says nothing: as such a face
changes, its new normal is compared with those around it."""


@kernel("i8(i8)")
def after(half: int) -> int:
    """Return the next half edge of the same face."""
    return half - 2 if half % 3 == 2 else half + 1


@kernel("i8(i8)")
def before(half: int) -> int:
    """Return the half edge before, in the same face."""
    return half + 2 if half % 3 == 0 else half - 1


@kernel("f8(f8[:,::1], i8, i8)")
def squared_length(places: Floats, a: int, b: int) -> float:
    """Return the squared distance of two vertices."""
    x, y, z = places[a, 0] - places[b, 0], places[a, 1] - places[b, 1], places[a, 2] - places[b, 2]
    return float(x * x + y * y + z * z)


@kernel("b1(f8, f8, f8, f8, f8, f8)")
def upright(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> bool:
    """Tell whether two normals differ by little enough."""
    dot = ax * bx + ay * by + az * bz
    return dot > 0.0 and dot * dot >= UPRIGHT * (ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz)


@kernel("UniTuple(f8, 4)(f8, f8, f8, f8, f8, f8, f8, f8, f8)")
def shape_of(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float, cx: float, cy: float, cz: float
) -> tuple[float, float, float, float]:
    """Return the normal of a triangle, twice its area long, and the squared sine of its smallest angle.

    That angle lies between the two longer sides.
    """
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    wx, wy, wz = cx - bx, cy - by, cz - bz
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    u, v, w = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz
    longer = max(u * v, u * w, v * w)
    return nx, ny, nz, (nx * nx + ny * ny + nz * nz) / max(longer, TINY)


@kernel("UniTuple(f8, 4)(f8[:,::1], i8, i8, i8)")
def face_shape(places: Floats, a: int, b: int, c: int) -> tuple[float, float, float, float]:
    """Return `shape_of` the triangle of three vertices."""
    return shape_of(
        places[a, 0], places[a, 1], places[a, 2], places[b, 0], places[b, 1], places[b, 2],
        places[c, 0], places[c, 1], places[c, 2],
    )  # fmt: skip


@kernel("void(f8[:,::1], i4[:,::1], i8, f8[:,::1], i8)")
def put_normal(vertices: Floats, faces: Ints, f: int, normals: Floats, n: int) -> None:
    """Put the unit normal of face f into row n; 0 where it has no area."""
    x, y, z, _ = face_shape(vertices, faces[f, 0], faces[f, 1], faces[f, 2])
    length = max(np.sqrt(x * x + y * y + z * z), TINY)
    normals[n, 0], normals[n, 1], normals[n, 2] = x / length, y / length, z / length


@kernel("UniTuple(f8, 4)(f8[:,::1], f8, f8, f8, i8, i8)")
def shape_at(places: Floats, x: float, y: float, z: float, b: int, c: int) -> tuple[float, float, float, float]:
    """Return `shape_of` the triangle of a place and two vertices."""
    return shape_of(
        x, y, z, places[b, 0], places[b, 1], places[b, 2], places[c, 0], places[c, 1], places[c, 2],
    )  # fmt: skip


@kernel("b1(f8[:,::1], i8, i8, i8, f8, f8, f8)")
def faces_out(ups: Floats, a: int, b: int, c: int, x: float, y: float, z: float) -> bool:
    """Tell whether the normal of a face agrees with those of the surface before under its corners."""
    total = x * (ups[a, 0] + ups[b, 0] + ups[c, 0])
    total += y * (ups[a, 1] + ups[b, 1] + ups[c, 1])
    total += z * (ups[a, 2] + ups[b, 2] + ups[c, 2])
    return bool(total > 0.0)


@kernel("UniTuple(f8, 2)(f8[:,::1], i4[::1], i4[::1], f8[:,::1], i8, i8, f8, f8, f8)")
def shapes_around(
    places: Floats, corners: Ints, twins: Ints, ups: Floats, first: int, last: int, x: float, y: float, z: float
) -> tuple[float, float]:  # fmt: skip
    """Return the smallest angles, squared sines, of faces around a vertex before and after it goes to a place.

    The faces are those from one half edge that leaves it to another. The second is -1 where one turns over.
    """
    v, turn = corners[first], first
    was = now = 1.0
    mx = my = mz = 0.0
    slivers = False
    while True:
        b, c = corners[after(turn)], corners[before(turn)]
        ox, oy, oz, old = face_shape(places, v, b, c)
        nx, ny, nz, new = shape_at(places, x, y, z, b, c)
        was, now = min(was, old), min(now, new)
        mx, my, mz = mx + ox, my + oy, mz + oz
        if old < SLIVER:
            slivers = True
        elif not upright(ox, oy, oz, nx, ny, nz):
            return was, -1.0
        if not faces_out(ups, v, b, c, nx, ny, nz) and faces_out(ups, v, b, c, ox, oy, oz):
            return was, -1.0
        if turn == last:
            break
        turn = twins[before(turn)]
    turn = first
    while slivers:
        b, c = corners[after(turn)], corners[before(turn)]
        nx, ny, nz, new = shape_at(places, x, y, z, b, c)
        if new >= SLIVER and not upright(mx, my, mz, nx, ny, nz):
            return was, -1.0
        slivers = turn != last
        turn = twins[before(turn)]
    return was, now
