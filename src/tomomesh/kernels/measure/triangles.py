"""Distance from points to triangles and to points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .bvh import depth_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

TINY = 1e-300
"""Least divisor: below all that places in 64 bits leave, so that it changes no quotient but 0 / 0, which becomes 0."""


@kernel("f8(f8[:,::1], i8, f8[:,::1], i4[:,::1], i8)")
def squared_distance(
    points: NDArray[np.float64], p: int, vertices: NDArray[np.float64], faces: NDArray[np.int32], m: int
) -> float:
    """Return the squared distance from point p of (n, 3) to face m of (m, 3).

    Notes
    -----
    Minimizes |p - a - s (b - a) - t (c - a)|^2: at the projection onto the plane where that lies in the triangle, and
    on one of the three sides otherwise. A side of no length counts by its end.
    """
    bb = bc = cc = bp = cp = 0.0
    for axis in range(3):
        a = vertices[faces[m, 0], axis]
        b, c, d = vertices[faces[m, 1], axis] - a, vertices[faces[m, 2], axis] - a, points[p, axis] - a
        bb += b * b
        bc += b * c
        cc += c * c
        bp += b * d
        cp += c * d
    area = bb * cc - bc * bc
    s, t = cc * bp - bc * cp, bb * cp - bc * bp
    inside = area > 0.0 and s >= 0.0 and t >= 0.0 and s + t <= area
    s, t = (s / area, t / area) if inside else (0.0, 0.0)
    u, v = min(max(bp / max(bb, TINY), 0.0), 1.0), min(max(cp / max(cc, TINY), 0.0), 1.0)
    w = min(max((cp - bp + bb - bc) / max(bb - 2.0 * bc + cc, TINY), 0.0), 1.0)
    inner = one = two = far = 0.0
    for axis in range(3):
        a = vertices[faces[m, 0], axis]
        b, c, d = vertices[faces[m, 1], axis] - a, vertices[faces[m, 2], axis] - a, points[p, axis] - a
        inner += (d - s * b - t * c) ** 2
        one += (d - u * b) ** 2
        two += (d - v * c) ** 2
        far += (d - (1.0 - w) * b - w * c) ** 2
    return min(inner, one, two, far)


@kernel("f8(f8[:,::1], i8, f8[:,::1], i8)")
def squared_to_box(points: NDArray[np.float64], p: int, boxes: NDArray[np.float64], node: int) -> float:
    """Return the squared distance from a point to the box of a node."""
    squared = 0.0
    for axis in range(3):
        below, above = boxes[2 * node, axis] - points[p, axis], points[p, axis] - boxes[2 * node + 1, axis]
        gap = below if below > above else above
        gap = gap if gap > 0.0 else 0.0
        squared += gap * gap
    return squared


@kernel("f8(f8[:,::1], i8, f8[:,::1], i8)")
def squared_between(points: NDArray[np.float64], p: int, vertices: NDArray[np.float64], v: int) -> float:
    """Return the squared distance from a point to a vertex."""
    squared = 0.0
    for axis in range(3):
        squared += (points[p, axis] - vertices[v, axis]) ** 2
    return squared


@kernel("f8(f8[:,::1], i8, f8[:,::1], i4[:,::1], i8)")
def squared_to_box_of(
    points: NDArray[np.float64], p: int, vertices: NDArray[np.float64], faces: NDArray[np.int32], m: int
) -> float:
    """Return the squared distance from a point to the box of a face."""
    squared = 0.0
    for axis in range(3):
        x = points[p, axis]
        a, b, c = vertices[faces[m, 0], axis] - x, vertices[faces[m, 1], axis] - x, vertices[faces[m, 2], axis] - x
        low, high = (a, b) if a < b else (b, a)
        low, high = c if c < low else low, c if c > high else high
        gap = low if low > -high else -high
        gap = gap if gap > 0.0 else 0.0
        squared += gap * gap
    return squared


@kernel("void(f8[:,::1], f8[:,::1], i4[:,::1], f8[:,::1], f8, f8[::1], i4[::1], i8, i8)")
def nearest_simplices(
    points: NDArray[np.float64],
    vertices: NDArray[np.float64],
    simplices: NDArray[np.int32],
    boxes: NDArray[np.float64],
    enough: float,
    squared: NDArray[np.float64],
    nearest: NDArray[np.int32],
    start: int,
    stop: int,
) -> None:
    """Find the triangle, or the vertex, that is nearest to each point, and its squared distance.

    Parameters
    ----------
    points : (p, 3) float array
        Neighbors in the array should be neighbors in space: each starts from the nearest of the one before.
    vertices : (n, 3) float array
    simplices : (m, k) int32 array
        Triangles (k = 3) or vertices (k = 1), in the order of the tree.
    boxes : (4 P, 3) float array
        The tree. See `tomomesh.kernels.measure.bvh`.
    enough : float
        Squared distance at which a nearer one is no longer sought.
    squared : (p,) float array
    nearest : (p,) int32 array
        Results.
    start, stop : int
        Points to work on.
    """
    depth = depth_of(boxes)
    leaves = home = 1 << depth
    found = 0
    stack, gaps = np.empty(64, np.int64), np.empty(64)
    for p in range(start, stop):
        best, climbing = np.inf, home
        stack[0], gaps[0], waiting = home, 0.0, 1
        while (waiting > 0 or climbing > 1) and best > enough:
            if waiting == 0:
                stack[0], gaps[0], waiting = climbing ^ 1, squared_to_box(points, p, boxes, climbing ^ 1), 1
                climbing >>= 1
            waiting -= 1
            node, gap = stack[waiting], gaps[waiting]
            while node < leaves and gap < best:
                near, far = 2 * node, 2 * node + 1
                gap, wider = squared_to_box(points, p, boxes, near), squared_to_box(points, p, boxes, far)
                if wider < gap:
                    near, far, gap, wider = far, near, wider, gap
                if wider < best:
                    stack[waiting], gaps[waiting] = far, wider
                    waiting += 1
                node = near
            if gap >= best:
                continue
            for m in range((node - leaves) * len(simplices) >> depth, (node - leaves + 1) * len(simplices) >> depth):
                here = best
                if simplices.shape[1] == 1:
                    here = squared_between(points, p, vertices, simplices[m, 0])
                elif squared_to_box_of(points, p, vertices, simplices, m) < best:
                    here = squared_distance(points, p, vertices, simplices, m)
                if here < best:
                    best, found, home = here, m, node
        squared[p], nearest[p] = best, found
