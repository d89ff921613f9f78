"""Kohonen's batch rule: every neuron to the neighborhood-weighted mean of the inputs (Kohonen 1991)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .search import best_matching_units

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel("void(f8[:,::1], f8[::1], i4[::1], f4[::1], f8[:,::1])")
def sum_by_winner(
    inputs: NDArray[np.float64],
    amounts: NDArray[np.float64],
    winners: NDArray[np.int32],
    squared: NDArray[np.float32],
    totals: NDArray[np.float64],
) -> None:
    """Add up what each neuron won.

    Parameters
    ----------
    inputs : (d, n) float array
    amounts : (n,) float array
        Weight of each input.
    winners : (n,) int array
    squared : (n,) float array
        Squared distance of each input to its winner.
    totals : (u, d + 2) float array
        Result: the weighted sums of the inputs, of 1, and of the distances, each in the order of the inputs.
    """
    d = len(inputs)
    x, y = inputs[0], inputs[1]
    totals[:] = 0.0
    for n in range(len(winners)):
        c, amount = np.uint32(winners[n]), amounts[n]
        totals[c, 0] += amount * x[n]
        totals[c, 1] += amount * y[n]
        for axis in range(2, d):
            totals[c, axis] += amount * inputs[axis, n]
        totals[c, d] += amount
        totals[c, d + 1] += amount * np.sqrt(squared[n])


@kernel("f8(f8[:,::1], f8[:,::1], i4[:,::1], f8[::1], f8[:,::1])")
def move_to_means(
    codebook: NDArray[np.float64],
    totals: NDArray[np.float64],
    hops: NDArray[np.int32],
    neighborhood: NDArray[np.float64],
    box: NDArray[np.float64],
) -> float:
    """Move each neuron to sum_c h(hops(c, i)) S_c / sum_c h(hops(c, i)) n_c, and no farther than the box.

    Parameters
    ----------
    codebook : (d, u) float array
        Changed in place; a neuron that no input reaches stays.
    totals : (u, d + 2) float array
        S_c and n_c of each neuron, see `sum_by_winner`.
    hops : (u, u) int array
        Symmetric.
    neighborhood : (h,) float array
        h by the number of hops.
    box : (2, d) float array
        Lowest and highest input along each axis.

    Returns
    -------
    float
        The largest distance that a neuron moved.

    Notes
    -----
    Sums run over the winners in their order.
    """
    d, u = codebook.shape
    reached, share, moved = np.zeros(u), np.empty(u), np.zeros(u)
    sums = np.zeros((d, u))
    for c in range(u):
        won = totals[c, d]
        if won > 0.0:
            for i in range(u):
                share[i] = neighborhood[np.uint32(hops[c, i])]
                reached[i] += share[i] * won
            for axis in range(d):
                total, row = totals[c, axis], sums[axis]
                for i in range(u):
                    row[i] += share[i] * total
    for axis in range(d):
        for i in range(u):
            if reached[i] > 0.0:
                place = min(max(sums[axis, i] / reached[i], box[0, axis]), box[1, axis])
                moved[i] += (place - codebook[axis, i]) ** 2
                codebook[axis, i] = place
    return float(np.sqrt(moved.max()))


@kernel("i8(f8[:,::1], f8[:,::1], f8[:,:,::1], f8[::1], i4[:,::1], f8[:,::1], f8[:,::1], f8, i8, f8[:,::1])")
def train_batch(
    codebook: NDArray[np.float64],
    places: NDArray[np.float64],
    boxes: NDArray[np.float64],
    amounts: NDArray[np.float64],
    hops: NDArray[np.int32],
    neighborhoods: NDArray[np.float64],
    box: NDArray[np.float64],
    tolerance: float,
    settled: int,
    history: NDArray[np.float64],
) -> int:
    """Match and move, again and again.

    Parameters
    ----------
    codebook : (d, u) float array
        Changed in place.
    places, boxes : arrays
        The inputs (d, n), see `tomomesh.kernels.som.search.sort_into_blocks`.
    amounts : (n,) float array
        Weight of each input, none negative; 0 of those that fill the last block.
    hops : (u, u) int array
    neighborhoods : (epochs, h) float array
        Neighborhood of each epoch by the number of hops.
    box : (2, d) float array
        Lowest and highest input along each axis.
    tolerance : float
        No more epochs after one in which no neuron moved farther than this,
    settled : int
        counted from this epoch on.
    history : (epochs, 2) float array
        Result: quantization error before, and largest move in, each epoch that was run.

    Returns
    -------
    int
        Epochs that were run.

    Notes
    -----
    Two axes at least. Winners are sought in single precision; everything else is double.
    """
    winners, squared = np.empty(places.shape[1], np.int32), np.empty(places.shape[1], np.float32)
    totals = np.empty((codebook.shape[1], len(codebook) + 2))
    amount = amounts.sum()
    for epoch in range(len(neighborhoods)):
        best_matching_units(codebook, places, boxes, winners, squared)
        sum_by_winner(places, amounts, winners, squared, totals)
        error = 0.0
        for c in range(len(totals)):
            error += totals[c, -1]
        history[epoch, 0] = error / amount
        history[epoch, 1] = move_to_means(codebook, totals, hops, neighborhoods[epoch], box)
        if history[epoch, 1] <= tolerance and epoch >= settled:
            return epoch + 1
    return len(neighborhoods)
