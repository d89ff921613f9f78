"""Balls that touch a surface from one side, and grow until they meet what faces them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .bvh import depth_of
from .triangles import TINY, squared_distance, squared_to_box

if TYPE_CHECKING:
    from numpy.typing import NDArray

FACING = 0.5
"""Cosine of 60 degrees: two places face each other where their normals are opposite but for so much. Chosen: of a wall
of 8 mm, half of it changes the width between by -1.9 %, with twice of it no places face."""
FREE = 0.5
"""Radius of the ball that must be free of all faces, over that of the ball that those which face the place leave: one
with less looks past an edge. Chosen: half of it changes the error of a wall's thickness by -22 %, and with twice of it
hardly a ball is free."""
CLOSE = 0.005
"""Share of its diameter by which a ball may be too large: a node that would change less is not looked at, or a ball in
a ball would touch every face. Chosen: half of it changes the error of a wall's thickness by 0.0 %, twice by +0.1 %."""
ROUNDS = 12
"""Most times that a ball is made smaller at one face; each leaves a fraction of the error of the one before. Chosen:
half and twice of it change no case of benchmarks/constants.py."""


@kernel("f8(f8[::1], f8[:,::1], i4[:,::1], i8, f8[::1])")
def take_nearest(
    place: NDArray[np.float64],
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    m: int,
    nearest: NDArray[np.float64],
) -> float:
    """Put the place of face m that is nearest to another place into `nearest`; return their squared distance.

    Notes
    -----
    On the plane where that lies in the triangle, else the nearest on its three sides.
    """
    bb = bc = cc = bp = cp = 0.0
    for axis in range(3):
        a = vertices[faces[m, 0], axis]
        b, c, d = vertices[faces[m, 1], axis] - a, vertices[faces[m, 2], axis] - a, place[axis] - a
        bb += b * b
        bc += b * c
        cc += c * c
        bp += b * d
        cp += c * d
    area = bb * cc - bc * bc
    s, t = cc * bp - bc * cp, bb * cp - bc * bp
    if area > 0.0 and s >= 0.0 and t >= 0.0 and s + t <= area:
        s, t = s / area, t / area
    else:
        u, v = min(max(bp / max(bb, TINY), 0.0), 1.0), min(max(cp / max(cc, TINY), 0.0), 1.0)
        w = min(max((cp - bp + bb - bc) / max(bb - 2.0 * bc + cc, TINY), 0.0), 1.0)
        # squared distances to the three sides, but for the same |d|^2
        one, two = u * u * bb - 2.0 * u * bp, v * v * cc - 2.0 * v * cp
        far = (1.0 - w) * (1.0 - w) * bb + 2.0 * (1.0 - w) * w * bc + w * w * cc
        far -= 2.0 * (1.0 - w) * bp + 2.0 * w * cp
        if one <= two and one <= far:
            s, t = u, 0.0
        elif two <= far:
            s, t = 0.0, v
        else:
            s, t = 1.0 - w, w
    squared = 0.0
    for axis in range(3):
        a = vertices[faces[m, 0], axis]
        nearest[axis] = a + s * (vertices[faces[m, 1], axis] - a) + t * (vertices[faces[m, 2], axis] - a)
        squared += (place[axis] - nearest[axis]) ** 2
    return squared


@kernel("void(f8[:,::1], i4[:,::1], i8, f8[::1])")
def take_normal(vertices: NDArray[np.float64], faces: NDArray[np.int32], m: int, normal: NDArray[np.float64]) -> None:
    """Put the unit normal of face m into `normal`; 0 where it has no area."""
    size = 0.0
    for axis in range(3):
        after, last = (axis + 1) % 3, (axis + 2) % 3
        a, b, c = faces[m, 0], faces[m, 1], faces[m, 2]
        one = (vertices[b, after] - vertices[a, after]) * (vertices[c, last] - vertices[a, last])
        two = (vertices[b, last] - vertices[a, last]) * (vertices[c, after] - vertices[a, after])
        normal[axis] = one - two
        size += (one - two) ** 2
    for axis in range(3):
        normal[axis] /= np.sqrt(max(size, TINY))


@kernel("b1(f8[:,::1], i4[:,::1], i8, f8[:,::1], i8, f8[::1])")
def faces_against(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    m: int,
    into: NDArray[np.float64],
    p: int,
    normal: NDArray[np.float64],
) -> bool:
    """Tell whether the normal of face m, which goes into `normal`, is within 60 degrees of a direction."""
    take_normal(vertices, faces, m, normal)
    return bool(normal[0] * into[p, 0] + normal[1] * into[p, 1] + normal[2] * into[p, 2] >= FACING)


@kernel("void(f8[:,::1], i4[:,::1], f8[:,::1], i8, i8)")
def enclose_slabs(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], slabs: NDArray[np.float64], start: int, stop: int
) -> None:
    """Find a slab around the faces of nodes, across their mean normal, and a cone around their normals.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int32 array
        In the order of the tree.
    slabs : (2 P, 6) float array
        Result: the unit mean normal or 0; least and greatest height along it; and the least cosine between it and a
        direction that any of the normals may be within 60 degrees of.
    start, stop : int
        Nodes to work on, from 1 on.
    """
    mean, normal = np.empty(3), np.empty(3)
    for node in range(start, stop):
        level = 0
        while node >> level > 1:
            level += 1
        at = node - (1 << level)
        low, high = at * len(faces) >> level, (at + 1) * len(faces) >> level
        mean[:] = 0.0
        for m in range(low, high):
            take_normal(vertices, faces, m, normal)
            mean += normal
        size = np.sqrt((mean * mean).sum())
        mean /= size if size > 1e-9 else np.inf
        least, most, spread = np.inf, -np.inf, 1.0
        for m in range(low, high):
            take_normal(vertices, faces, m, normal)
            spread = min(spread, (normal * mean).sum())
            for corner in range(3):
                height = 0.0
                for axis in range(3):
                    height += vertices[faces[m, corner], axis] * mean[axis]
                least, most = min(least, height), max(most, height)
        wide = np.arccos(max(spread, -1.0)) + np.arccos(FACING) + 1e-9
        slabs[node, :3], slabs[node, 3], slabs[node, 4] = mean, least, most
        slabs[node, 5] = np.cos(wide) if wide < np.pi else -2.0


@kernel("b1(f8[:,::1], i8, f8[:,::1], i8, f8[:,::1], f8)")
def may_stop(
    slabs: NDArray[np.float64],
    node: int,
    into: NDArray[np.float64],
    p: int,
    center: NDArray[np.float64],
    squared: float,
) -> bool:
    """Tell whether a node may hold a face against a direction that comes into a ball, by its slab and its cone."""
    height = along = 0.0
    for axis in range(3):
        height += slabs[node, axis] * center[0, axis]
        along += slabs[node, axis] * into[p, axis]
    gap = max(slabs[node, 3] - height, height - slabs[node, 4], 0.0)
    return bool(along >= slabs[node, 5] and gap * gap < squared)


@kernel("f8(f8[:,::1], f8[:,::1], i8, f8, f8[:,::1])")
def take_center(
    points: NDArray[np.float64], into: NDArray[np.float64], p: int, diameter: float, center: NDArray[np.float64]
) -> float:
    """Put the center of the ball that touches the surface at point p into row 0; return its squared radius."""
    for axis in range(3):
        center[0, axis] = points[p, axis] + 0.5 * diameter * into[p, axis]
    return 0.25 * diameter * diameter


@kernel("f8(f8[:,::1], f8[:,::1], i8, f8[:,::1], i4[:,::1], i8, f8, f8[:,::1])")
def shrunk_at(
    points: NDArray[np.float64],
    into: NDArray[np.float64],
    p: int,
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    m: int,
    diameter: float,
    rows: NDArray[np.float64],
) -> float:
    """Return the diameter of the largest ball, up to a diameter, that touches at point p and holds nothing of face m.

    Notes
    -----
    A ball that holds a place of the face is replaced by the one through the place nearest to its center, |q - p|^2
    over the depth of q (the shrinking ball of Ma, Bae & Choi 2012). Two rows may be overwritten.
    """
    for _ in range(ROUNDS):
        squared = take_center(points, into, p, diameter, rows)
        if take_nearest(rows[0], vertices, faces, m, rows[1]) >= squared * (1.0 - 1e-12):
            break
        length = depth = 0.0
        for axis in range(3):
            step = rows[1, axis] - points[p, axis]
            length += step * step
            depth += step * into[p, axis]
        diameter = min(diameter, length / max(depth, TINY))
    return diameter


@kernel("b1(f8[:,::1], f8, f8[:,::1], i4[:,::1], f8[:,::1], i8[::1])")
def is_free(
    center: NDArray[np.float64],
    squared: float,
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    boxes: NDArray[np.float64],
    stack: NDArray[np.int64],
) -> bool:
    """Tell whether no face comes nearer to row 0 than a squared distance."""
    depth = depth_of(boxes)
    leaves = 1 << depth
    stack[0], waiting = 1, 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if squared_to_box(center, 0, boxes, node) >= squared:
            continue
        if node < leaves:
            stack[waiting], stack[waiting + 1] = 2 * node, 2 * node + 1
            waiting += 2
            continue
        for m in range((node - leaves) * len(faces) >> depth, (node - leaves + 1) * len(faces) >> depth):
            if squared_distance(center, 0, vertices, faces, m) < squared:
                return False
    return True


@kernel("void(f8[:,::1], f8[:,::1], f8[:,::1], i4[:,::1], f8[:,::1], f8[:,::1], f8[::1], i8, i8)")
def grow_balls(
    points: NDArray[np.float64],
    into: NDArray[np.float64],
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    boxes: NDArray[np.float64],
    slabs: NDArray[np.float64],
    diameters: NDArray[np.float64],
    start: int,
    stop: int,
) -> None:
    """Find the largest ball that touches a surface at a point and holds nothing of the faces that face the point.

    Parameters
    ----------
    points : (p, 3) float array
        Neighbors in the array should be neighbors in space: each starts at the face that stopped the one before.
    into : (p, 3) float array
        The unit direction into what is measured at each.
    vertices : (n, 3) float array
    faces : (m, 3) int32 array
        In the order of the tree, their normals out of what is measured.
    boxes : (4 P, 3) float array
        The tree. See `tomomesh.kernels.measure.bvh`.
    slabs : (2 P, 6) float array
        See `enclose_slabs`.
    diameters : (p,) float array
        On entry the widest that is looked for. Result, too large by the share `CLOSE` at most; infinite where
        nothing is met, and where the ball looks past an edge.
    start, stop : int
        Points to work on.
    """
    depth = depth_of(boxes)
    leaves, met = 1 << depth, -1
    stack, rows = np.empty(64, np.int64), np.empty((2, 3))
    for p in range(start, stop):
        best = diameters[p]
        if met >= 0 and faces_against(vertices, faces, met, into, p, rows[1]):
            best = shrunk_at(points, into, p, vertices, faces, met, best, rows)
        stack[0], waiting = 1, 1
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            squared = take_center(points, into, p, best * (1.0 - CLOSE), rows)
            if squared_to_box(rows, 0, boxes, node) >= squared or not may_stop(slabs, node, into, p, rows, squared):
                continue
            if node < leaves:
                near = squared_to_box(points, p, boxes, 2 * node) <= squared_to_box(points, p, boxes, 2 * node + 1)
                stack[waiting], stack[waiting + 1] = 2 * node + near, 2 * node + 1 - near
                waiting += 2
                continue
            for m in range((node - leaves) * len(faces) >> depth, (node - leaves + 1) * len(faces) >> depth):
                if faces_against(vertices, faces, m, into, p, rows[1]):
                    here = shrunk_at(points, into, p, vertices, faces, m, best, rows)
                    if here < best:
                        best, met = here, m
        squared = FREE * FREE * take_center(points, into, p, best, rows)
        met_any = best < diameters[p]
        diameters[p] = best if met_any and is_free(rows, squared, vertices, faces, boxes, stack) else np.inf
