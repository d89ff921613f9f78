"""Loops over sparse cubes, given as rising keys."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .compile import kernel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@kernel("void(i8[::1], i8[::1], i4[:,::1])")
def find_neighbors(keys: NDArray[np.int64], steps: NDArray[np.int64], table: NDArray[np.int32]) -> None:
    """Find the neighbors of every cube.

    Parameters
    ----------
    keys : (c,) int64 array
    steps : (s,) int64 array
        What each direction adds to a key.
    table : (c, s) int32 array
        Result: number of the neighbor in that direction, -1 where there is none.

    Notes
    -----
    Keys rise strictly. The neighbors in one direction rise with the cubes, so a finger that only moves forward
    finds them all in one pass.
    """
    for s in range(len(steps)):
        finger = 0
        for c in range(len(keys)):
            wanted = keys[c] + steps[s]
            while finger < len(keys) and keys[finger] < wanted:
                finger += 1
            table[c, s] = finger if finger < len(keys) and keys[finger] == wanted else -1


@kernel("i8(i4[:,::1], b1[::1], i4[::1])")
def label_components(table: NDArray[np.int32], member: NDArray[np.bool_], labels: NDArray[np.int32]) -> int:
    """Label the connected components of some of the cubes.

    Parameters
    ----------
    table : (c, s) int32 array
        Neighbors, -1 where there is none.
    member : (c,) bool array
        Cubes that take part.
    labels : (c,) int32 array
        -1 on entry. Result: number of the component, in the order of its first cube.

    Returns
    -------
    int
        Number of components.
    """
    queue = labels.copy()
    count = 0
    for seed in range(len(member)):
        if not member[seed] or labels[seed] >= 0:
            continue
        labels[seed] = count
        queue[0] = seed
        head, tail = 0, 1
        while head < tail:
            here = queue[head]
            head += 1
            for s in range(table.shape[1]):
                there = table[here, s]
                if there >= 0 and member[there] and labels[there] < 0:
                    labels[there] = count
                    queue[tail] = there
                    tail += 1
        count += 1
    return count


@kernel("void(i4[:,::1], b1[::1], i4[::1], i8)")
def spread(table: NDArray[np.int32], open_: NDArray[np.bool_], depth: NDArray[np.int32], limit: int) -> None:
    """Walk from the cubes of depth 0 through the open ones, breadth first.

    Parameters
    ----------
    table : (c, s) int32 array
        Neighbors, -1 where there is none.
    open_ : (c,) bool array
        Cubes that may be entered.
    depth : (c,) int32 array
        0 at the start, -1 elsewhere. Result: fewest steps from the start, -1 where not reached within `limit`.
    limit : int
        Most steps.
    """
    queue = depth.copy()
    tail = 0
    for c in range(len(depth)):
        if depth[c] == 0:
            queue[tail] = c
            tail += 1
    head = 0
    while head < tail:
        here = queue[head]
        head += 1
        if depth[here] == limit:
            continue
        for s in range(table.shape[1]):
            there = table[here, s]
            if there >= 0 and open_[there] and depth[there] < 0:
                depth[there] = depth[here] + 1
                queue[tail] = there
                tail += 1


@kernel("i8(i4[:,::1], i4[:,::1], i4[:,::1])")
def track_surfaces(table: NDArray[np.int32], turns: NDArray[np.int32], labels: NDArray[np.int32]) -> int:
    """Track the surfaces of a cube set from face to face (Gordon & Udupa 1989).

    Parameters
    ----------
    table : (c, 27) int32 array
        Neighbors in the order of `tomomesh.surface.neighbors.OFFSETS`, -1 where there is none.
    turns : (24, 5) int32 array
        For each of the 6 directions and each of the 4 sides of a face: the column of the neighbor ahead and
        outward, the column of the neighbor ahead, the direction that faces back, the direction ahead, and the
        column of the neighbor outward.
    labels : (c, 6) int32 array
        -1 on entry. Result: number of the surface that a face belongs to, in the order of its first face; -1
        where a cube has no face.

    Returns
    -------
    int
        Number of surfaces.

    Notes
    -----
    In a well-composed set every side of a face has one continuation. Cost is proportional to the faces, for
    the shell of cubes is as large as its surface.
    """
    faces = labels.reshape(-1)
    queue = faces.copy()
    count = 0
    for seed in range(len(faces)):
        cube, direction = seed // 6, seed % 6
        if faces[seed] >= 0 or table[cube, turns[4 * direction, 4]] >= 0:
            continue
        faces[seed] = count
        queue[0] = seed
        head, tail = 0, 1
        while head < tail:
            cube, direction = queue[head] // 6, queue[head] % 6
            head += 1
            for side in range(4 * direction, 4 * direction + 4):
                outward, ahead = table[cube, turns[side, 0]], table[cube, turns[side, 1]]
                if outward >= 0:
                    there = 6 * outward + turns[side, 2]
                elif ahead >= 0:
                    there = 6 * ahead + direction
                else:
                    there = 6 * cube + turns[side, 3]
                if faces[there] < 0:
                    faces[there] = count
                    queue[tail] = there
                    tail += 1
        count += 1
    return count


@kernel("void(f8[:,::1], f8[:,::1], i4[:,::1], i8[::1], i8[::1], i4[::1], i4[::1], i8, i8)")
def nearest_points(
    vertices: NDArray[np.float64],
    points: NDArray[np.float64],
    table: NDArray[np.int32],
    order: NDArray[np.int64],
    start: NDArray[np.int64],
    cube: NDArray[np.int32],
    nearest: NDArray[np.int32],
    begin: int,
    end: int,
) -> None:
    """Find the point nearest to each vertex in one cube and its 26 neighbors (the paper's correspondence).

    Parameters
    ----------
    vertices : (n, 3) float array
    points : (p, 3) float array
    table : (c, 27) int32 array
        Neighbors of each cube, itself among them.
    order, start : int64 arrays
        The points of cube q are ``order[start[q]:start[q + 1]]``.
    cube : (n,) int32 array
        Where to look.
    nearest : (n,) int32 array
        Result: number of the point, -1 where the 27 cubes hold none. The point that comes first in `order`
        wins a tie.
    begin, end : int
        Vertices to work on.
    """
    for v in range(begin, end):
        best = 1e300
        nearest[v] = -1
        for s in range(table.shape[1]):
            q = table[cube[v], s]
            if q < 0:
                continue
            for n in range(start[q], start[q + 1]):
                p = order[n]
                squared = 0.0
                for axis in range(3):
                    squared += (points[p, axis] - vertices[v, axis]) ** 2
                if squared < best:
                    best = squared
                    nearest[v] = p
