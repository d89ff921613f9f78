"""Triangles that pass through each other.

Everything follows from the signs of volumes, so sharing a vertex or an edge needs no rule of its own: a point of a
shared side is on the border of both triangles, and only a point that is inside of one of them counts.

Triangle n has seven rows of three numbers: its corners from row 7 n on, the least and greatest coordinates of its
box from row 7 n + BOX on, and its normal with the sizes of the normal's terms from row 7 n + PLANE on. The last are
found where two triangles are to be compared, for nearly all pairs need not be (see `beside`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .beside import only_touch
from .bvh import depth_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Rows = NDArray[np.float64]

BOX, PLANE, ROWS = 3, 5, 7
"""Columns, or rows, of a face's prepared numbers: where its box and its plane begin, after three corners, and all."""
APART, COPLANAR, THROUGH = 0, 1, 2
"""What two faces are to each other."""
ROUNDING = 8e-16
"""Largest error of a computed 3 x 3 determinant of differences, over the sum of its terms' sizes (Shewchuk 1997)."""


@kernel("void(f8[:,::1], i8, i8, i8, i8)")
def take_plane(rows: Rows, i: int, j: int, k: int, plane: int) -> None:
    """Put the normal of the triangle of corners i, j, k into row `plane`, the sizes of its terms into the next."""
    for axis in range(3):
        after, last = (axis + 1) % 3, (axis + 2) % 3
        one = (rows[j, after] - rows[i, after]) * (rows[k, last] - rows[i, last])
        two = (rows[j, last] - rows[i, last]) * (rows[k, after] - rows[i, after])
        rows[plane, axis], rows[plane + 1, axis] = one - two, abs(one) + abs(two)


@kernel("i8(f8[:,::1], i8, i8, i8)")
def side_of(rows: Rows, plane: int, apex: int, corner: int) -> int:
    """Return on which side of the plane through corner `apex` a corner is: 1, -1, or 0 within rounding."""
    volume = size = 0.0
    for axis in range(3):
        height = rows[corner, axis] - rows[apex, axis]
        volume += height * rows[plane, axis]
        size += abs(height) * rows[plane + 1, axis]
    return int(volume > ROUNDING * size) - int(volume < -ROUNDING * size)


@kernel("i8(f8[:,::1], i8, i8, i8, i8)")
def turn_of(rows: Rows, i: int, j: int, k: int, axis: int) -> int:
    """Return how the path of corners i, j, k turns seen along an axis: 1, -1, or 0 within rounding."""
    after, last = (axis + 1) % 3, (axis + 2) % 3
    one = (rows[j, after] - rows[i, after]) * (rows[k, last] - rows[i, last])
    two = (rows[j, last] - rows[i, last]) * (rows[k, after] - rows[i, after])
    size = abs(one) + abs(two)
    return int(one - two > ROUNDING * size) - int(one - two < -ROUNDING * size)


@kernel("b1(f8[:,::1], i8, f8[:,::1], i8)")
def boxes_meet(rows: Rows, i: int, others: Rows, j: int) -> bool:
    """Tell whether the boxes of rows i and j have a point in common."""
    meet = True
    for axis in range(3):
        meet &= (rows[i, axis] <= others[j + 1, axis]) & (others[j, axis] <= rows[i + 1, axis])
    return meet


@kernel("void(f8[:,::1], i4[:,::1], i8, f8[:,::1], i8)")
def take_face(vertices: NDArray[np.float64], faces: NDArray[np.int32], face: int, rows: Rows, i: int) -> None:
    """Put a face's corners and box into the rows from i on."""
    for axis in range(3):
        a, b, c = vertices[faces[face, 0], axis], vertices[faces[face, 1], axis], vertices[faces[face, 2], axis]
        rows[i, axis], rows[i + 1, axis], rows[i + 2, axis] = a, b, c
        least, most = (a, b) if a < b else (b, a)
        rows[i + BOX, axis] = c if c < least else least
        rows[i + BOX + 1, axis] = c if c > most else most


@kernel("i8(f8[:,::1], i8, i8, i8[::1])")
def meeting_of(rows: Rows, one: int, other: int, sides: NDArray[np.int64]) -> int:
    """Find on which side of the other's plane the corners of two triangles are, and tell how they may meet.

    The sides go into (6,): first those of the one. The result is `APART` where one lies on one side of the other's
    plane or both stop at it, `COPLANAR` where one lies in the other's plane, and `THROUGH` else.
    """
    take_plane(rows, one, one + 1, one + 2, one + PLANE)
    take_plane(rows, other, other + 1, other + 2, other + PLANE)
    for k in range(3):
        sides[k] = side_of(rows, other + PLANE, other, one + k)
        sides[3 + k] = side_of(rows, one + PLANE, one, other + k)
    low, high = min(sides[0], sides[1], sides[2]), max(sides[0], sides[1], sides[2])
    below, above = min(sides[3], sides[4], sides[5]), max(sides[3], sides[4], sides[5])
    reach = (low <= 0) & (high >= 0) & (below <= 0) & (above >= 0)
    flat = (low == high) | (below == above)
    through = ((low < 0) & (high > 0)) | ((below < 0) & (above > 0))
    return COPLANAR if reach & flat else THROUGH if reach & through else APART


@kernel("i8(i8[::1], i8)")
def lone_corner(sides: NDArray[np.int64], i: int) -> int:
    """Return which of three corners, with sides i to i + 2 that are not all 0, is alone on its side of a plane.

    A corner in the plane is alone where the others are on one side, else it goes with one of them.
    """
    for k in range(3):
        if sides[i + (k + 1) % 3] * sides[i + (k + 2) % 3] > 0:
            return k
    for k in range(3):
        if sides[i + k] != 0:
            return k
    return -1


@kernel("i8(i8[::1], i8, i8)")
def step_around(sides: NDArray[np.int64], i: int, lone: int) -> int:
    """Return 1 if the lone corner is above the other two, seen from the plane, and 2 if it is below."""
    side, next_side = sides[i + lone], sides[i + (lone + 1) % 3]
    return 2 if side < 0 or (side == 0 and next_side > 0) else 1


@kernel("b1(f8[:,::1], i8, i8, i8[::1])")
def overlap_flat(rows: Rows, one: int, other: int, sides: NDArray[np.int64]) -> bool:
    """Tell whether two triangles in one plane overlap: no side of one has the other beyond it.

    They are seen along the axis that is steepest to the plane; one without area overlaps nothing.
    """
    plane = (other if sides[0] == sides[1] == sides[2] else one) + PLANE
    axis = 0
    for k in range(1, 3):
        if abs(rows[plane, k]) > abs(rows[plane, axis]):
            axis = k
    overlap = True
    for _ in range(2):
        turn = turn_of(rows, one, one + 1, one + 2, axis)
        for k in range(3):
            inner = False
            for m in range(3):
                inner |= turn * turn_of(rows, one + k, one + (k + 1) % 3, other + m, axis) > 0
            overlap &= inner
        one, other = other, one
    return overlap


@kernel("b1(f8[:,::1], i8, i8, i8[::1], i8)")
def overlap_through(rows: Rows, one: int, other: int, sides: NDArray[np.int64], spare: int) -> bool:
    """Tell whether two triangles of which one goes through the other's plane overlap on the line of their planes.

    Parameters
    ----------
    rows : (r, 3) float array
    one, other : int
        First rows of the triangles.
    sides : (6,) int64 array
        See `meeting_of`.
    spare : int
        Two rows that may be overwritten.

    Notes
    -----
    Each cuts an interval out of the line, from its side p-q to its side p-r where p is the corner that is alone on
    its side of the other's plane; and the order of the ends follows from the signs of two volumes (Guigue &
    Devillers 2003). Ends that are equal within rounding do not overlap.
    """
    p, x = lone_corner(sides, 0), lone_corner(sides, 3)
    turn, flip = step_around(sides, 3, x), step_around(sides, 0, p)
    q, r, y, z = one + (p + turn) % 3, one + (p - turn) % 3, other + (x + flip) % 3, other + (x - flip) % 3
    take_plane(rows, one + p, q, other + x, spare)
    ahead = side_of(rows, spare, one + p, y)
    take_plane(rows, one + p, r, z, spare)
    return (ahead < 0) & (side_of(rows, spare, one + p, other + x) < 0)


@kernel("i8(i8[::1], i8)")
def push_later(stack: NDArray[np.int64], leaf: int) -> int:
    """Put the node of a leaf, and the nodes that together hold all leaves after it, on the stack; return how many."""
    stack[0], count = leaf, 1
    while leaf > 1:
        if leaf & 1 == 0:
            stack[count] = leaf + 1
            count += 1
        leaf >>= 1
    return count


@kernel("i8(f8[:,::1], i4[:,::1], f8[:,::1], b1[::1], b1[::1], i8[:,::1], i8, i8)")
def mark_intersections(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    boxes: Rows,
    asked: NDArray[np.bool_],
    marked: NDArray[np.bool_],
    pairs: NDArray[np.int64],
    start: int,
    stop: int,
) -> int:
    """Find the faces that cross others, and the pairs.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int32 array
        In the order of the tree.
    boxes : (4 P, 3) float array
        The tree. See `tomomesh.kernels.measure.bvh`.
    asked : (2 P,) bool array
        Nodes that hold faces which are to be compared; two nodes without any are not.
    marked : (m,) bool array
        False on entry. Result: whether a face crosses another.
    pairs : (p, 2) int64 array
        Result: the first p pairs that were found; without room for any, faces that are marked already are not
        compared again.
    start, stop : int
        Leaves to work on. Each is compared with itself and those after it, so faces of later leaves are marked
        too: several threads may set the same mark, which makes no difference.

    Returns
    -------
    int
        Number of pairs found.
    """
    depth, count = depth_of(boxes), 0
    leaves, base, end = 1 << depth, start * len(faces) >> depth, stop * len(faces) >> depth
    rows = np.empty((ROWS * (end - base + 1) + 2, 3))
    beyond, spare = ROWS * (end - base), ROWS * (end - base + 1)
    stack, sides = np.empty(64, np.int64), np.empty(6, np.int64)
    for face in range(base, end):
        take_face(vertices, faces, face, rows, ROWS * (face - base))
    for leaf in range(start, stop):
        leaf_box, waiting = 2 * (leaves + leaf), push_later(stack, leaves + leaf)
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            wanted = asked[leaves + leaf] or asked[node]
            if not (wanted and boxes_meet(boxes, leaf_box, boxes, 2 * node)):
                continue
            if node < leaves:
                stack[waiting], stack[waiting + 1] = 2 * node, 2 * node + 1
                waiting += 2
                continue
            for other in range((node - leaves) * len(faces) >> depth, (node - leaves + 1) * len(faces) >> depth):
                there = min(ROWS * (other - base), beyond)
                if there == beyond:
                    take_face(vertices, faces, other, rows, beyond)
                if not boxes_meet(rows, there + BOX, boxes, leaf_box):
                    continue
                for one in range(leaf * len(faces) >> depth, min((leaf + 1) * len(faces) >> depth, other)):
                    here = ROWS * (one - base)
                    if not boxes_meet(rows, there + BOX, rows, here + BOX):
                        continue
                    if len(pairs) == 0 and marked[one] and marked[other]:
                        continue
                    if only_touch(faces, one, other, rows, here, there):
                        continue
                    meeting = meeting_of(rows, here, there, sides)
                    if meeting == APART:
                        continue
                    if meeting == THROUGH:
                        cross = overlap_through(rows, here, there, sides, spare)
                    else:
                        cross = overlap_flat(rows, here, there, sides)
                    if cross:
                        marked[one] = marked[other] = True
                        if count < len(pairs):
                            pairs[count, 0], pairs[count, 1] = one, other
                        count += 1
    return count
