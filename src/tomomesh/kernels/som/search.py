"""Matching (eq. 1): the neuron nearest to every input, sought among those that a block of near inputs leaves open."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .online import INDEX_BITS, LANES

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLOCK = 64
"""Inputs of a block. Measured on slices of a skull: blocks of 32 take 1.3 times as long, of 128 as long."""
ROUNDING = np.float32(1e-5)
"""Share of squared distances by which a neuron must be farther to be left out: 80 times the rounding of one."""
MOST_BITS = 20
"""Most bits of a cell's number: a million cells, whose table has 4 MB."""


@kernel("void(f8[:,::1], f8[:,::1], u4[::1])")
def _sort_by_cell(inputs: NDArray[np.float64], box: NDArray[np.float64], order: NDArray[np.uint32]) -> None:
    """Sort inputs by the cells that they lie in. Unsigned numbers index faster: none counts from the end."""
    d, n = inputs.shape
    bits = max(1, min(MOST_BITS, int(np.log2(n))) // d)
    extent = 0.0
    for axis in range(d):
        extent = max(extent, box[1, axis] - box[0, axis])
    scale = ((1 << bits) - 1e-6) / extent if extent > 0.0 else 0.0
    spread = np.zeros(1 << bits, np.uint32)
    for place in range(1 << bits):
        for bit in range(bits):
            spread[place] |= np.uint32(((place >> bit) & 1) << (bit * d))
    cell = np.zeros(n, np.uint32)
    for axis in range(d):
        row, least = inputs[axis], box[0, axis]
        for k in range(n):
            cell[k] |= spread[np.uint32((row[k] - least) * scale)] << np.uint32(axis)
    starts = np.zeros((1 << (bits * d)) + 1, np.uint32)
    for k in range(n):
        starts[cell[k] + np.uint32(1)] += np.uint32(1)
    for c in range(1, len(starts)):
        starts[c] += starts[c - 1]
    for k in range(n):
        at = starts[cell[k]]
        order[at] = k
        starts[cell[k]] = at + np.uint32(1)


@kernel("void(f8[:,::1], f8[:,::1], u4[::1], f8[:,::1], f8[:,:,::1])")
def sort_into_blocks(
    inputs: NDArray[np.float64],
    box: NDArray[np.float64],
    order: NDArray[np.uint32],
    places: NDArray[np.float64],
    boxes: NDArray[np.float64],
) -> None:
    """Bring inputs together that lie near each other.

    In the Z-order (Morton 1966) of the cells of a grid over them, about as many as there are inputs.

    Parameters
    ----------
    inputs : (d, n) float array
        Finite, one at least.
    box : (2, d) float array
        Lowest and highest input along each axis.
    order : (b * BLOCK,) int array
        Result: the inputs, the near ones together. The last is repeated to fill the last block.
    places : (d, b * BLOCK) float array
        Result: where they are.
    boxes : (2, d, b) float array
        Result: middle and half the size of each block.

    Notes
    -----
    Non-negative floats order as the integers that spell them, whose minimum vectorizes.
    """
    count = inputs.shape[1]
    _sort_by_cell(inputs, box, order)
    order[count:] = order[count - 1]
    for axis in range(len(inputs)):
        row, place, least = inputs[axis], places[axis], box[0, axis]
        for block in range(boxes.shape[2]):
            lowest, highest = np.int64(2**63 - 1), np.int64(0)
            for n in range(block * BLOCK, (block + 1) * BLOCK):
                place[n] = row[order[n]]
                bits = np.float64(place[n] - least).view(np.int64)
                lowest, highest = min(lowest, bits), max(highest, bits)
            low, high = np.int64(lowest).view(np.float64), np.int64(highest).view(np.float64)
            boxes[0, axis, block], boxes[1, axis, block] = least + (low + high) / 2, (high - low) / 2


@kernel("i8(f4[:,::1], f4[::1], f4[:,::1], i4[::1])")
def _candidates(
    codebook: NDArray[np.float32], half: NDArray[np.float32], bounds: NDArray[np.float32], chosen: NDArray[np.int32]
) -> int:
    """Choose the neurons of which one or the other may be the nearest to some place in a box around 0.

    A neuron i is out where a neuron j is nearer to all of the box: by how much it is nearer is linear in the place,
    |x - i|^2 - |x - j|^2, and least in a corner, where it is |i|^2 - |j|^2 - 2 half . |i - j|. For j any would do;
    one of the nearest to the middle is taken.
    """
    x, y, wide, high = codebook[0], codebook[1], half[0], half[1]
    squared, rest, nearer = bounds[0], bounds[1], bounds[2]
    size = wide * wide + high * high
    for axis in range(2, len(codebook)):
        row = codebook[axis]
        size += half[axis] * half[axis]
        for i in range(len(row)):
            rest[i] = row[i] * row[i] if axis == 2 else rest[i] + row[i] * row[i]
    nearest = np.int32(2**31 - 1)
    for i in range(len(squared)):
        squared[i] = rest[i] + x[i] * x[i] + y[i] * y[i]
        nearest = min(nearest, (np.float32(squared[i]).view(np.int32) & np.int32(~INDEX_BITS)) | np.int32(i))
    j = nearest & np.int32(INDEX_BITS)
    for axis in range(2, len(codebook)):
        row, deep, place = codebook[axis], half[axis], codebook[axis, j]
        for i in range(len(row)):
            across = deep * np.abs(row[i] - place)
            rest[i] = across if axis == 2 else rest[i] + across
    least, x_j, y_j = squared[j], x[j], y[j]
    for i in range(len(nearer)):
        across = rest[i] + wide * np.abs(x[i] - x_j) + high * np.abs(y[i] - y_j)
        nearer[i] = squared[i] - least - across - across - ROUNDING * (squared[i] + size)
    count = 0
    for i in range(len(nearer)):
        chosen[count] = i
        count += nearer[i] <= np.float32(0.0)
    return count


@kernel("void(f4[:,::1], i4[:], f4[:,::1], f4[::1], i4[::1])")
def _nearest_in_plane(
    codebook: NDArray[np.float32], chosen: NDArray[np.int32], near: NDArray[np.float32], best: NDArray[np.float32],
    unit: NDArray[np.int32],
) -> None:  # fmt: skip
    across, down, last = codebook[0], codebook[1], len(chosen) - 1
    x, y = near[0], near[1]
    for c in range(0, last + 1, 4):
        i, j, k, m = chosen[c], chosen[min(c + 1, last)], chosen[min(c + 2, last)], chosen[min(c + 3, last)]
        xi, xj, xk, xm = across[i], across[j], across[k], across[m]
        yi, yj, yk, ym = down[i], down[j], down[k], down[m]
        for n in range(BLOCK):
            squared, number = best[n], unit[n]
            total = (x[n] - xi) ** 2 + (y[n] - yi) ** 2
            squared, number = (total, i) if total < squared else (squared, number)
            total = (x[n] - xj) ** 2 + (y[n] - yj) ** 2
            squared, number = (total, j) if total < squared else (squared, number)
            total = (x[n] - xk) ** 2 + (y[n] - yk) ** 2
            squared, number = (total, k) if total < squared else (squared, number)
            total = (x[n] - xm) ** 2 + (y[n] - ym) ** 2
            squared, number = (total, m) if total < squared else (squared, number)
            best[n], unit[n] = squared, number


@kernel("void(f4[:,::1], i4[:], f4[:,::1], f4[::1], i4[::1])")
def _nearest_in_space(
    codebook: NDArray[np.float32], chosen: NDArray[np.int32], near: NDArray[np.float32], best: NDArray[np.float32],
    unit: NDArray[np.int32],
) -> None:  # fmt: skip
    rest, x, y = np.empty(BLOCK, np.float32), near[0], near[1]
    for i in chosen:
        for axis in range(2, len(codebook)):
            row, place = near[axis], codebook[axis, i]
            for n in range(BLOCK):
                off = (row[n] - place) ** 2
                rest[n] = off if axis == 2 else rest[n] + off
        xi, yi = codebook[0, i], codebook[1, i]
        for n in range(BLOCK):
            total = rest[n] + (x[n] - xi) ** 2 + (y[n] - yi) ** 2
            nearer = total < best[n]
            best[n] = total if nearer else best[n]
            unit[n] = i if nearer else unit[n]


@kernel("void(f8[:,::1], f8[:,::1], f8[:,:,::1], i4[::1], f4[::1])")
def best_matching_units(
    codebook: NDArray[np.float64],
    places: NDArray[np.float64],
    boxes: NDArray[np.float64],
    winners: NDArray[np.int32],
    squared: NDArray[np.float32],
) -> None:
    """Find the neuron nearest to every input (eq. 1).

    Parameters
    ----------
    codebook : (d, u) float array
    places, boxes : arrays
        The inputs, see `sort_into_blocks`.
    winners : (b * BLOCK,) int array
        Result: number of the nearest neuron, the lowest where several are equally near.
    squared : (b * BLOCK,) float array
        Result: squared distance to it.

    Notes
    -----
    Two axes at least. Single precision, twice as many lanes as double; relative to each block's middle it loses
    nothing. A block looks only at the neurons that may be the nearest to a place in it: ten of 82, on a skull. In the
    plane four are compared in a pass, which loads and stores the best a quarter as often. The last neuron again and
    again fills the last vector: the lowest of equals is taken.
    """
    d, u = codebook.shape
    lanes = -(-u // LANES) * LANES
    own, bounds = np.empty((d, lanes), np.float32), np.zeros((3, lanes), np.float32)
    near, half, chosen = np.empty((d, BLOCK), np.float32), np.empty(d, np.float32), np.empty(lanes + 1, np.int32)
    winners[:], squared[:] = 0, np.inf
    for block in range(boxes.shape[2]):
        here = slice(block * BLOCK, (block + 1) * BLOCK)
        for axis in range(d):
            middle, row, place = boxes[0, axis, block], codebook[axis], places[axis, here]
            half[axis] = np.float32(boxes[1, axis, block])
            for i in range(lanes):
                own[axis, i] = np.float32(row[min(i, u - 1)] - middle)
            for n in range(BLOCK):
                near[axis, n] = np.float32(place[n] - middle)
        count = _candidates(own, half, bounds, chosen)
        if d == 2:
            _nearest_in_plane(own, chosen[:count], near, squared[here], winners[here])
        else:
            _nearest_in_space(own, chosen[:count], near, squared[here], winners[here])
