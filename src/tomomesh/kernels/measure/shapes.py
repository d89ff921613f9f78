"""Sizes and angles of triangles, and of the edges between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]


@kernel("void(f8[:,::1], i4[:,::1], i8, f8[:,::1], f8[::1])")
def take_sides(vertices: Floats, faces: Ints, face: int, sides: Floats, normal: Floats) -> None:
    """Find the sides a-b, b-c and c-a of a face, rows of (3, 3), and its normal of twice its area, (3,)."""
    for axis in range(3):
        a, b, c = vertices[faces[face, 0], axis], vertices[faces[face, 1], axis], vertices[faces[face, 2], axis]
        sides[0, axis], sides[1, axis], sides[2, axis] = b - a, c - b, a - c
    for axis in range(3):
        after, last = (axis + 1) % 3, (axis + 2) % 3
        normal[axis] = sides[2, after] * sides[0, last] - sides[2, last] * sides[0, after]


@kernel("void(f8[:,::1], i4[:,::1], f8[::1], f8[::1], f8[::1], i8, i8)")
def face_sizes(
    vertices: Floats, faces: Ints, center: Floats, areas: Floats, volumes: Floats, start: int, stop: int
) -> None:
    """Find the area of each face, and the signed volume between it and a point.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int32 array
    center : (3,) float array
        The point.
    areas, volumes : (m,) float arrays
        Results.
    start, stop : int
        Faces to work on.
    """
    sides, normal = np.empty((3, 3)), np.empty(3)
    for face in range(start, stop):
        take_sides(vertices, faces, face, sides, normal)
        squared = height = 0.0
        for axis in range(3):
            squared += normal[axis] * normal[axis]
            height += normal[axis] * (vertices[faces[face, 0], axis] - center[axis])
        areas[face], volumes[face] = 0.5 * np.sqrt(squared), height / 6.0


@kernel("void(f8[:,::1], i4[:,::1], f8[::1], f8[::1], f8[::1], i8, i8)")
def face_shapes(
    vertices: Floats, faces: Ints, smallest: Floats, largest: Floats, aspect: Floats, start: int, stop: int
) -> None:
    """Find the smallest and the largest angle of each face, and its aspect.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int32 array
    smallest, largest : (m,) float arrays
        Results in radians; 0 for a face that is a point.
    aspect : (m,) float array
        Result: 4 sqrt(3) area over the sum of the squared sides.
    start, stop : int
        Faces to work on.
    """
    sides, normal = np.empty((3, 3)), np.empty(3)
    for face in range(start, stop):
        take_sides(vertices, faces, face, sides, normal)
        squared = lengths = ab = bc = ca = 0.0
        for axis in range(3):
            a, b, c = sides[0, axis], sides[1, axis], sides[2, axis]
            squared += normal[axis] * normal[axis]
            lengths += a * a + b * b + c * c
            ab -= a * b
            bc -= b * c
            ca -= c * a
        double_area = np.sqrt(squared)
        smallest[face] = np.arctan2(double_area, max(ab, bc, ca))
        largest[face] = np.arctan2(double_area, min(ab, bc, ca))
        aspect[face] = 2.0 * np.sqrt(3.0) * double_area / max(lengths, 1e-300)


@kernel("void(f8[:,::1], i4[:,::1], i4[::1], i4[::1], f8[::1], f8[::1], i8, i8)")
def edge_shapes(
    vertices: Floats, faces: Ints, order: Ints, edges: Ints, lengths: Floats, turns: Floats, start: int, stop: int
) -> None:
    """Find the length of each edge, and by how much the surface turns there.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int32 array
    order : (3 m,) int32 array
    edges : (e + 1,) int32 array
        See `tomomesh.kernels.measure.edges.order_half_edges`.
    lengths : (e,) float array
        Result.
    turns : (e,) float array
        Result: angle between the normals of the two faces in radians, the one turned over if both run along the
        edge in one direction; 0 where there are not two faces.
    start, stop : int
        Edges to work on.
    """
    sides, one, other = np.empty((3, 3)), np.empty(3), np.empty(3)
    for edge in range(start, stop):
        half = order[edges[edge]]
        take_sides(vertices, faces, half // 3, sides, one)
        squared = 0.0
        for axis in range(3):
            squared += sides[half % 3, axis] * sides[half % 3, axis]
        lengths[edge], turns[edge] = np.sqrt(squared), 0.0
        if edges[edge + 1] - edges[edge] == 2:
            twin = order[edges[edge] + 1]
            take_sides(vertices, faces, twin // 3, sides, other)
            along = across = 0.0
            for axis in range(3):
                after, last = (axis + 1) % 3, (axis + 2) % 3
                along += one[axis] * other[axis]
                across += (one[after] * other[last] - one[last] * other[after]) ** 2
            if faces[half // 3, half % 3] == faces[twin // 3, twin % 3]:
                along = -along
            turns[edge] = np.arctan2(np.sqrt(across), along)
