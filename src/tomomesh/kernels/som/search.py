"""Matching (eq. 1): the neuron nearest to every input, sought among those that a block of near inputs leaves open."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLOCK = 64
"""Inputs of a block. Measured on slices of a skull: blocks of 32 take 1.3 times as long, of 128 as long."""
LANES = 32
"""Neurons that one turn of a vectorized loop takes; what is left over would be gone through one by one."""
MOST_BITS = 20
"""Most bits of a cell's number: a million cells, whose table has 4 MB."""


@kernel("void(f8[:,::1], f8[:,::1], i4[::1])")
def _sort_by_cell(inputs: NDArray[np.float64], box: NDArray[np.float64], order: NDArray[np.int32]) -> None:
    d, n = inputs.shape
    bits = max(1, min(MOST_BITS, int(np.log2(n))) // d)
    extent = 0.0
    for axis in range(d):
        extent = max(extent, box[1, axis] - box[0, axis])
    scale = ((1 << bits) - 1e-6) / extent if extent > 0.0 else 0.0
    spread = np.zeros(1 << bits, np.int32)
    for place in range(1 << bits):
        for bit in range(bits):
            spread[place] |= np.int32(((place >> bit) & 1) << (bit * d))
    cell = np.zeros(n, np.int32)
    for axis in range(d):
        row, least = inputs[axis], box[0, axis]
        for k in range(n):
            cell[k] |= spread[np.int32((row[k] - least) * scale)] << np.int32(axis)
    starts = np.zeros((1 << (bits * d)) + 1, np.int32)
    for k in range(n):
        starts[cell[k] + 1] += 1
    for c in range(1, len(starts)):
        starts[c] += starts[c - 1]
    for k in range(n):
        at = starts[cell[k]]
        order[at] = k
        starts[cell[k]] = at + 1


@kernel("void(f8[:,::1], f8[:,::1], i4[::1], f8[:,::1], f8[:,:,::1])")
def sort_into_blocks(
    inputs: NDArray[np.float64],
    box: NDArray[np.float64],
    order: NDArray[np.int32],
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
        Result: low and high corner of each block.

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
            boxes[0, axis, block] = least + np.int64(lowest).view(np.float64)
            boxes[1, axis, block] = least + np.int64(highest).view(np.float64)


@kernel("i8(f4[:,::1], f4[::1], f4[:,::1], i4[::1])")
def _candidates(
    codebook: NDArray[np.float32], reach: NDArray[np.float32], bounds: NDArray[np.float32], chosen: NDArray[np.int32]
) -> int:
    """Choose the neurons of which one or the other may be the nearest to some place between 0 and a reach.

    Those whose least distance from that box is at most the least of the farthest distances. Rounding keeps that order:
    no place in the box is computed to be nearer than the first, nor farther than the second.
    """
    x, y, wide, high = codebook[0], codebook[1], reach[0], reach[1]
    nearest, near_rest, far_rest = bounds[0], bounds[1], bounds[2]
    for axis in range(2, len(codebook)):
        row, deep = codebook[axis], reach[axis]
        for i in range(len(row)):
            below, above = -row[i], row[i] - deep
            outside = below if below > above else above
            outside = outside if outside > np.float32(0.0) else np.float32(0.0)
            near_rest[i] = outside * outside if axis == 2 else near_rest[i] + outside * outside
        for i in range(len(row)):
            below, above = row[i], deep - row[i]
            across = below if below > above else above
            far_rest[i] = across * across if axis == 2 else far_rest[i] + across * across
    least = np.int32(2**31 - 1)
    for i in range(len(nearest)):
        below, above, left, right = -y[i], y[i] - high, -x[i], x[i] - wide
        beyond, down = (below, above) if below > above else (above, below)
        beside, across = (left, right) if left > right else (right, left)
        beyond = beyond if beyond > np.float32(0.0) else np.float32(0.0)
        beside = beside if beside > np.float32(0.0) else np.float32(0.0)
        nearest[i] = near_rest[i] + beside * beside + beyond * beyond
        least = min(least, np.float32(far_rest[i] + across * across + down * down).view(np.int32))
    count = 0
    for i in range(len(nearest)):
        chosen[count] = i
        count += np.float32(nearest[i]).view(np.int32) <= least
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
    Two axes at least. Single precision, twice as many lanes as double; relative to each block's corner it loses
    nothing. A block looks only at the neurons that may be the nearest to a place in it: ten of 82, on a skull. In the
    plane four are compared in a pass, which loads and stores the best a quarter as often. Neurons at infinity fill the
    last vector.
    """
    d, u = codebook.shape
    lanes = -(-u // LANES) * LANES
    own, bounds = np.full((d, lanes), np.inf, np.float32), np.zeros((3, lanes), np.float32)
    near, reach, chosen = np.empty((d, BLOCK), np.float32), np.empty(d, np.float32), np.empty(lanes + 1, np.int32)
    squared[:] = np.inf
    for block in range(boxes.shape[2]):
        here = slice(block * BLOCK, (block + 1) * BLOCK)
        for axis in range(d):
            corner, row, place = boxes[0, axis, block], codebook[axis], places[axis, here]
            reach[axis] = np.float32(boxes[1, axis, block] - corner)
            for i in range(u):
                own[axis, i] = np.float32(row[i] - corner)
            for n in range(BLOCK):
                near[axis, n] = np.float32(place[n] - corner)
        count = _candidates(own, reach, bounds, chosen)
        if d == 2:
            _nearest_in_plane(own, chosen[:count], near, squared[here], winners[here])
        else:
            _nearest_in_space(own, chosen[:count], near, squared[here], winners[here])
