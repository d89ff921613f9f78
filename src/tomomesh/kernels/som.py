"""Self-organising map: matching (eq. 1) and updating (eq. 2).

Positions are stored one row an axis, (d, u) and (d, n), so that the loops over neurons and pixels vectorize.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLOCK = 512
"""Pixels matched together: their distances stay in the first cache."""


INDEX_BITS = 16_383
"""Low bits of a squared distance that carry the neuron's number; as many neurons a network may have."""


@kernel("void(f8[:,::1], f8[:,::1], i4[:,::1], i4[:,::1], i4[:,::1], f8[::1], f8[::1], b1)")
def train_online(
    codebook: NDArray[np.float64],
    inputs: NDArray[np.float64],
    hops: NDArray[np.int32],
    nearest_first: NDArray[np.int32],
    within: NDArray[np.int32],
    alpha: NDArray[np.float64],
    radius: NDArray[np.float64],
    gaussian: bool,
) -> None:
    """Present inputs one by one: m_i += alpha h(hops(c, i)) (x - m_i) (Kohonen 1988; eq. 1, 2).

    Parameters
    ----------
    codebook : (d, u) float array
        Changed in place.
    inputs : (t, d) float array
        One input a presentation, in the order of presentation.
    hops, nearest_first : (u, u) int arrays
    within : (u, h) int array
        See `tomomesh.model.lattice.Lattice`.
    alpha, radius : (t,) float arrays
        Learning rate and radius of each presentation.
    gaussian : bool
        h = exp(-hops^2 / 2 radius^2) up to six radii; else h = 1 up to `radius` hops. Beyond, h = 0.

    Notes
    -----
    Finite inputs, at most 16,383 neurons. Non-negative floats order as the integers that spell them, and a
    minimum of integers vectorizes: so the number of each neuron rides in the last bits of its distance. Of
    neurons that are equally near (within 4e-12 of the squared distance) the lowest number wins. Two axes at
    least; the first two in one pass save the loads and stores of a second. One exponential a presentation gives
    the Gaussian: from hop k to k + 1 it falls by q^(2k + 1), q = exp(-1 / 2 radius^2).
    """
    d, u = codebook.shape
    farthest = within.shape[1] - 1
    squared = np.empty(u)
    bits = squared.view(np.int64)
    weight = np.empty(farthest + 1)
    for t in range(len(inputs)):
        x, y = inputs[t, 0], inputs[t, 1]
        row, next_row = codebook[0], codebook[1]
        for i in range(u):
            squared[i] = (x - row[i]) * (x - row[i]) + (y - next_row[i]) * (y - next_row[i])
        for axis in range(2, d):
            x, row = inputs[t, axis], codebook[axis]
            for i in range(u):
                squared[i] += (x - row[i]) * (x - row[i])
        winner = np.int64(2**63 - 1)
        for i in range(u):
            winner = min(winner, (bits[i] & ~np.int64(INDEX_BITS)) | np.int64(i))
        c = winner & np.int64(INDEX_BITS)
        reach = min(int(6.0 * radius[t] if gaussian else radius[t]), farthest)
        weight[: reach + 1] = alpha[t]
        if gaussian:
            ratio = square = np.exp(-0.5 / max(radius[t] * radius[t], 1e-12))
            square *= square
            for hop in range(1, reach + 1):
                weight[hop] = weight[hop - 1] * ratio
                ratio *= square
        near = nearest_first[c, : within[c, reach]]
        apart = hops[c]
        for axis in range(d):
            x = inputs[t, axis]
            row = codebook[axis]
            for i in near:
                row[i] += weight[apart[i]] * (x - row[i])


@kernel("void(f4[:,::1], f4[:,::1], i4[::1], f4[::1])")
def best_matching_units(
    codebook: NDArray[np.float32],
    inputs: NDArray[np.float32],
    winners: NDArray[np.int32],
    squared: NDArray[np.float32],
) -> None:
    """Find the neuron nearest to every input (eq. 1).

    Parameters
    ----------
    codebook : (d, u) float array
    inputs : (d, n) float array
    winners : (n,) int array
        Result: number of the nearest neuron, the lowest where several are equally near.
    squared : (n,) float array
        Result: squared distance to it.

    Notes
    -----
    Two axes at least: the first two are compared in the pass that adds them. Single precision, twice as many
    lanes as double: give positions relative to one of them, so that none is lost.
    """
    d, u = codebook.shape
    distance = np.empty(BLOCK, np.float32)
    for start in range(0, inputs.shape[1], BLOCK):
        stop = min(start + BLOCK, inputs.shape[1])
        best, unit = squared[start:stop], winners[start:stop]
        best[:] = np.inf
        for i in range(u):
            distance[:] = np.float32(0.0)
            for axis in range(2, d):
                m = codebook[axis, i]
                x = inputs[axis, start:stop]
                for n in range(len(x)):
                    distance[n] += (x[n] - m) * (x[n] - m)
            a, b = codebook[0, i], codebook[1, i]
            x, y = inputs[0, start:stop], inputs[1, start:stop]
            for n in range(len(best)):
                total = distance[n] + (x[n] - a) * (x[n] - a) + (y[n] - b) * (y[n] - b)
                nearer = total < best[n]
                best[n] = total if nearer else best[n]
                unit[n] = np.int32(i) if nearer else unit[n]


@kernel("void(f8[:,::1], f8[:,::1], i4[:,::1], f8[:,::1])")
def train_batch(
    codebook: NDArray[np.float64],
    inputs: NDArray[np.float64],
    hops: NDArray[np.int32],
    weights: NDArray[np.float64],
) -> None:
    """Move each neuron to the neighborhood-weighted mean of the inputs, again and again (Kohonen 1991).

    Parameters
    ----------
    codebook : (d, u) float array
        Changed in place; a neuron that no input reaches stays.
    inputs : (d, n) float array
    hops : (u, u) int array
    weights : (epochs, h) float array
        Neighborhood of each epoch by the number of hops, 0 to h - 1.

    Notes
    -----
    Sums run over the inputs in their order, then over the winners in theirs. Winners are sought in single
    precision, relative to the first input.
    """
    d, u = codebook.shape
    winners = np.empty(inputs.shape[1], np.int32)
    squared = np.empty(inputs.shape[1], np.float32)
    total = np.empty((d + 1, u))
    near_inputs = np.empty(inputs.shape, np.float32)
    near_codebook = np.empty((d, u), np.float32)
    for axis in range(d):
        near_inputs[axis] = inputs[axis] - inputs[axis, 0]
    for epoch in range(len(weights)):
        for axis in range(d):
            near_codebook[axis] = codebook[axis] - inputs[axis, 0]
        best_matching_units(near_codebook, near_inputs, winners, squared)
        total[:] = 0.0
        for n in range(len(winners)):
            total[d, winners[n]] += 1.0
        for axis in range(d):
            for n in range(len(winners)):
                total[axis, winners[n]] += inputs[axis, n]
        for i in range(u):
            reached = 0.0
            for c in range(u):
                reached += weights[epoch, hops[i, c]] * total[d, c]
            if reached > 0.0:
                for axis in range(d):
                    moved = 0.0
                    for c in range(u):
                        moved += weights[epoch, hops[i, c]] * total[axis, c]
                    codebook[axis, i] = moved / reached
