"""Loops over sparse cubes, given as rising keys."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..compile import kernel

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
