"""What is known of the surface before its triangles are made even: how its faces hang together, and how it bends."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .links import TINY, after, put_normal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]
    Bools = NDArray[np.bool_]


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


@kernel("void(i4[::1], i4[::1], i4[::1], i4[::1], i4[::1], i8, i8)")
def link(corners: Ints, first: Ints, fans: Ints, twins: Ints, valence: Ints, start: int, stop: int) -> None:
    """Pair half edges, and count the edges at each vertex, from the faces around it (see `gather_fans`).

    Of a half edge that leaves a vertex, the twin is that which comes back from the same neighbor.
    """
    for v in range(start, stop):
        valence[v] = first[v + 1] - first[v]
        for n in range(first[v], first[v + 1]):
            half = 3 * fans[n]
            while corners[half] != v:
                half += 1
            neighbor, twins[half] = corners[after(half)], -1
            for other in range(first[v], first[v + 1]):
                back = 3 * fans[other]
                while corners[after(back)] != v:
                    back += 1
                if corners[back] == neighbor:
                    twins[half] = back
            valence[v] += twins[half] < 0


@kernel("void(f8[:,::1], i4[:,::1], f8[:,::1], i8, i8)")
def face_normals(vertices: Floats, faces: Ints, normals: Floats, start: int, stop: int) -> None:
    """Find the unit normals (m, 3) of faces, 0 where a face has no area."""
    for f in range(start, stop):
        put_normal(vertices, faces, f, normals, f)


@kernel("void(f8[:,::1], i4[:,::1], i4[::1], f8[:,::1], i8, i8)")
def normals_of(vertices: Floats, faces: Ints, some: Ints, normals: Floats, start: int, stop: int) -> None:
    """Find the unit normals (n, 3) of some faces (n,); of -1, which is none, that of the last."""
    for n in range(start, stop):
        put_normal(vertices, faces, some[n], normals, n)


@kernel("i8(i4[::1], f8[:,::1], f8, i4[::1])")
def find_sharp(twins: Ints, normals: Floats, least: float, found: Ints) -> int:
    """Find the half edges, one of each pair, between faces whose normals have a smaller cosine; return how many."""
    count = 0
    for half in range(len(twins)):
        f, g = half // 3, twins[half] // 3
        if twins[half] <= half:
            continue
        turn = normals[f, 0] * normals[g, 0] + normals[f, 1] * normals[g, 1] + normals[f, 2] * normals[g, 2]
        if turn < least:
            found[count] = half
            count += 1
    return count


@kernel("void(f8[:,::1])")
def normalize(vectors: Floats) -> None:
    """Bring vectors (n, 3) to length 1."""
    for v in range(len(vectors)):
        length = max(np.sqrt(vectors[v, 0] ** 2 + vectors[v, 1] ** 2 + vectors[v, 2] ** 2), TINY)
        for axis in range(3):
            vectors[v, axis] /= length


@kernel("void(i4[:,::1], f8[:,::1], f8[::1], f8[:,::1])")
def vertex_normals(faces: Ints, normals: Floats, areas: Floats, mean: Floats) -> None:
    """Find the unit normals (n, 3) at vertices from those of faces (m, 3), by their areas (m,)."""
    mean[:] = 0.0
    for f in range(len(faces)):
        for k in range(3):
            for axis in range(3):
                mean[faces[f, k], axis] += areas[f] * normals[f, axis]
    normalize(mean)


@kernel("void(i4[:,::1], f8[:,::1], f8[:,::1])")
def mix_normals(faces: Ints, normals: Floats, mixed: Floats) -> None:
    """Add to each normal (n, 3) those of its neighbors, and bring all to length 1."""
    for v in range(len(normals)):
        for axis in range(3):
            mixed[v, axis] = normals[v, axis]
    for f in range(len(faces)):
        for k in range(3):
            for other in range(1, 3):
                for axis in range(3):
                    mixed[faces[f, k], axis] += 0.5 * normals[faces[f, (k + other) % 3], axis]
    normalize(mixed)


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
