"""How the faces of a mesh hang together.

Half edge 3 f + k runs from corner k of face f to the next corner, so a half edge has the number of the corner that
it starts from.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Ints = NDArray[np.int32]


FEW = 64
"""Half edges of a vertex up to which they are sorted by insertion. Only speed depends on it."""


@kernel("i8(i8)")
def corner_after(corner: int) -> int:
    """Return the next corner of the same face."""
    return corner - 2 if corner % 3 == 2 else corner + 1


@kernel("void(i4[::1], i4[::1], i8, i8)")
def sort_few(keys: Ints, numbers: Ints, start: int, stop: int) -> None:
    """Sort keys and their numbers from `start` to before `stop`, equal ones in their order: few by insertion.

    Where there are many, by halves that are merged: a vertex may have all edges of a mesh.
    """
    if stop - start <= FEW:
        for n in range(start + 1, stop):
            key, number, m = keys[n], numbers[n], n
            while m > start and keys[m - 1] > key:
                keys[m], numbers[m] = keys[m - 1], numbers[m - 1]
                m -= 1
            keys[m], numbers[m] = key, number
        return
    ranked = np.argsort(keys[start:stop], kind="mergesort")
    keys[start:stop], numbers[start:stop] = keys[start:stop][ranked], numbers[start:stop][ranked]


@kernel("i8(i4[:,::1], i8, i4[::1], i4[::1], i4[::1])")
def order_half_edges(faces: Ints, count: int, order: Ints, first: Ints, highs: Ints) -> int:
    """Put the half edges of one undirected edge beside each other.

    Parameters
    ----------
    faces : (m, 3) int32 array
        Vertex numbers below `count`.
    count : int
        Number of vertices.
    order : (3 m,) int32 array
        Result: half edges by their lower, then by their higher end, then by their number.
    first : (3 m + 1,) int32 array
        Result: the half edges of edge e are ``order[first[e]:first[e + 1]]``.
    highs : (3 m,) int32 array
        Room to work in.

    Returns
    -------
    int
        Number of edges.

    Notes
    -----
    Sorts by counting by the lower ends, and then the few of each by insertion, so the cost is linear.
    """
    begin = np.zeros(count + 1, np.int32)
    for face in range(len(faces)):
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        begin[min(a, b) + 1] += 1
        begin[min(b, c) + 1] += 1
        begin[min(c, a) + 1] += 1
    for v in range(count):
        begin[v + 1] += begin[v]
    for face in range(len(faces)):
        for k in range(3):
            a, b = faces[face, k], faces[face, (k + 1) % 3]
            low, high = min(a, b), max(a, b)
            place = begin[low]
            order[place], highs[place] = 3 * face + k, high
            begin[low] += 1
    edges, start = 0, 0
    for v in range(count):
        stop = begin[v]
        sort_few(highs, order, start, stop)
        for n in range(start, stop):
            if n == start or highs[n] != highs[n - 1]:
                first[edges] = n
                edges += 1
        start = stop
    first[edges] = len(order)
    return edges


@kernel("i8(i4[:,::1], i4[::1], i4[::1])")
def count_misoriented(faces: Ints, order: Ints, first: Ints) -> int:
    """Count the edges that have two faces, and both run through it in one direction. See `order_half_edges`."""
    vertex, count = faces.reshape(-1), 0
    for edge in range(len(first) - 1):
        if first[edge + 1] - first[edge] == 2:
            count += vertex[order[first[edge]]] == vertex[order[first[edge] + 1]]
    return count


@kernel("void(i4[::1], i8, i8)")
def join(roots: Ints, a: int, b: int) -> None:
    """Join the sets of a and b; each points to a lower member, the lowest to itself (Rem, in Dijkstra 1976)."""
    while roots[a] != roots[b]:
        if roots[a] < roots[b]:
            a, b = b, a
        above = roots[a]
        roots[a] = roots[b]
        if above == a:
            break
        a = above


@kernel("i8(i4[::1])")
def find_roots(roots: Ints) -> int:
    """Let every number point to the lowest of its set; return the number of sets."""
    sets = 0
    for n in range(len(roots)):
        roots[n] = roots[roots[n]]
        sets += roots[n] == n
    return sets


@kernel("i8(i8[::1], i8[::1], i4[::1])")
def join_pairs(one: NDArray[np.int64], other: NDArray[np.int64], roots: Ints) -> int:
    """Join the sets of pairs (p,), and let every number point to the lowest of its set; return the number of sets."""
    for n in range(len(one)):
        join(roots, one[n], other[n])
    return int(find_roots(roots))


@kernel("void(i4[:,::1], i4[::1])")
def join_vertices(faces: Ints, roots: Ints) -> None:
    """Join the vertices of every face.

    Parameters
    ----------
    faces : (m, 3) int32 array
    roots : (n,) int32 array
        Its own numbers on entry. Result: the lowest vertex that is connected to each.
    """
    for face in range(len(faces)):
        join(roots, faces[face, 0], faces[face, 1])
        join(roots, faces[face, 0], faces[face, 2])
    find_roots(roots)


@kernel("i8(i4[:,::1], i4[::1], i4[::1], i4[::1])")
def join_corners(faces: Ints, order: Ints, first: Ints, roots: Ints) -> int:
    """Join the corners at one vertex across the edges between their faces.

    Parameters
    ----------
    faces : (m, 3) int32 array
    order : (3 m,) int32 array
    first : (e + 1,) int32 array
        See `order_half_edges`.
    roots : (3 m,) int32 array
        Its own numbers on entry. Result: the lowest corner of the fan that each belongs to.

    Returns
    -------
    int
        Number of fans.
    """
    vertex = faces.reshape(-1)
    for edge in range(len(first) - 1):
        one, one_end = order[first[edge]], corner_after(order[first[edge]])
        for n in range(first[edge] + 1, first[edge + 1]):
            other, other_end = order[n], corner_after(order[n])
            if vertex[other] != vertex[one]:
                other, other_end = other_end, other
            join(roots, one, other)
            join(roots, one_end, other_end)
    return find_roots(roots)


@kernel("void(i4[::1], i4[::1])")
def join_borders(borders: Ints, roots: Ints) -> None:
    """Join the fans at the two ends of half edges.

    Parameters
    ----------
    borders : (b,) int32 array
        Half edges without another beside them.
    roots : (3 m,) int32 array
        See `join_corners`. Result: half edges of one loop have one root.
    """
    for half in borders:
        join(roots, half, corner_after(half))
    find_roots(roots)
