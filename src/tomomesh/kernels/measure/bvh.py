"""A tree of boxes over simplices that are ordered along a space-filling curve.

The tree is complete and implicit: node i has the children 2i and 2i + 1, node 1 is the root, and the last half of
the nodes are the leaves. Leaf l of P = 2^depth holds the simplices ``l * m // P`` to ``(l + 1) * m // P``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

BITS, SIZE = 18, 55
"""Bits of the space-filling curve on each axis, and the first of the bits that tell the size of a simplex."""
DIGIT, DIGITS = 11, 6
"""Bits of a digit of keys, and digits: five for the curve, and one for the size."""


@kernel("void(f8[:,::1], i4[:,::1], f8[::1], f8, f8, i8[::1], i8, i8)")
def curve_keys(
    vertices: NDArray[np.float64],
    simplices: NDArray[np.int32],
    low: NDArray[np.float64],
    side: float,
    usual: float,
    keys: NDArray[np.int64],
    start: int,
    stop: int,
) -> None:
    """Assign numbers along a space-filling curve to simplices, the large ones after all others.

    Parameters
    ----------
    vertices : (n, 3) float array
    simplices : (m, k) int32 array
        Numbers of their vertices.
    low : (3,) float array
    side : float
        Corner and edge of a cube that holds most simplices; those beyond it count as in its outermost cells.
    usual : float
        Extent of a usual simplex. Those of extents up to 8, 64, 512, ... times as large are kept apart, or one
        large simplex would widen the boxes of its small neighbors.
    keys : (m,) int64 array
        Result: number of the middle of the simplex's box along the curve of Morton (1966).
    start, stop : int
        Simplices to work on.
    """
    cells = float(1 << BITS)
    for m in range(start, stop):
        extent, key = usual, np.int64(0)
        for axis in range(3):
            least = most = vertices[simplices[m, 0], axis]
            for k in range(1, simplices.shape[1]):
                least = min(least, vertices[simplices[m, k], axis])
                most = max(most, vertices[simplices[m, k], axis])
            extent = max(extent, most - least)
            along = 0.5 * (least - low[axis] + most - low[axis]) / side * cells
            cell = np.int64(min(max(along, 0.0), cells - 1.0))
            cell = (cell | cell << 32) & 0x1F00000000FFFF
            cell = (cell | cell << 16) & 0x1F0000FF0000FF
            cell = (cell | cell << 8) & 0x100F00F00F00F00F
            cell = (cell | cell << 4) & 0x10C30C30C30C30C3
            cell = (cell | cell << 2) & 0x1249249249249249
            key |= cell << axis
        # each size spans a factor of 8; 200 of the 256 numbers that 8 bits above the curve have, so that none overflows
        while extent > 8.0 * usual and key < np.int64(200) << SIZE:
            extent /= 8.0
            key += np.int64(1) << SIZE
        keys[m] = key


@kernel("void(i8[:,::1], i4[:,::1])")
def order_keys(keys: NDArray[np.int64], order: NDArray[np.int32]) -> None:
    """Sort keys, and find their order, equal ones in theirs.

    Parameters
    ----------
    keys : (2, m) int64 array
        Not negative, in the first row. Result: there too, rising; the second is room to work in.
    order : (2, m) int32 array
        Result, in the first row: numbers of the keys from the lowest to the highest; the second is room to work in.

    Notes
    -----
    Sorts by counting, one digit after the other from the lowest; digits that are the same in all keys are left out.
    """
    mask, here, count = (1 << DIGIT) - 1, 0, keys.shape[1]
    begin = np.zeros((DIGITS, mask + 2), np.int32)
    for m in range(count):
        order[0, m] = m
        for digit in range(DIGITS):
            begin[digit, (keys[0, m] >> DIGIT * digit & mask) + 1] += 1
    for digit in range(DIGITS):
        if begin[digit].max() == count:
            continue
        for value in range(mask):
            begin[digit, value + 1] += begin[digit, value]
        there = 1 - here
        for m in range(count):
            value = keys[here, m] >> DIGIT * digit & mask
            place = begin[digit, value]
            order[there, place], keys[there, place] = order[here, m], keys[here, m]
            begin[digit, value] += 1
        here = there
    if here:
        keys[0], order[0] = keys[1], order[1]


@kernel("i8(f8[:,::1])")
def depth_of(boxes: NDArray[np.float64]) -> int:
    """Return the depth of a tree, from its boxes (4 P, 3): to shift by it is quicker than to divide by P."""
    depth = 0
    while 4 << depth < len(boxes):
        depth += 1
    return depth


@kernel("void(f8[:,::1], i4[:,::1], f8[:,::1], i8, i8)")
def enclose_leaves(
    vertices: NDArray[np.float64], simplices: NDArray[np.int32], boxes: NDArray[np.float64], start: int, stop: int
) -> None:
    """Find the boxes of leaves.

    Parameters
    ----------
    vertices : (n, 3) float array
    simplices : (m, k) int32 array
        In their order along the curve.
    boxes : (4 P, 3) float array
        Result: least and greatest coordinates of each node, two rows; leaf l is node P + l.
    start, stop : int
        Leaves to work on.
    """
    depth = depth_of(boxes)
    for leaf in range(start, stop):
        box = 2 * ((1 << depth) + leaf)
        for axis in range(3):
            least, most = np.inf, -np.inf
            for m in range(leaf * len(simplices) >> depth, (leaf + 1) * len(simplices) >> depth):
                for k in range(simplices.shape[1]):
                    least = min(least, vertices[simplices[m, k], axis])
                    most = max(most, vertices[simplices[m, k], axis])
            boxes[box, axis], boxes[box + 1, axis] = least, most


@kernel("void(f8[:,::1])")
def enclose_nodes(boxes: NDArray[np.float64]) -> None:
    """Find the boxes of all nodes, two rows each of (4 P, 3), from those of the leaves."""
    for node in range(len(boxes) // 4 - 1, 0, -1):
        for axis in range(3):
            boxes[2 * node, axis] = min(boxes[4 * node, axis], boxes[4 * node + 2, axis])
            boxes[2 * node + 1, axis] = max(boxes[4 * node + 1, axis], boxes[4 * node + 3, axis])
