"""Matching and batch training by matrix products, for inputs of many dimensions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels.som.products import add_rows, add_shares, highest, squared_distances

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

WIDE = 8
"""Dimensions over which matrix products are faster than the compiled loops: measured, 58 to 1,600 neurons."""
BLOCK = 2_048
"""Inputs matched together. No result depends on it."""


def best_matching_units(codebook: Floats, inputs: Floats) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Find the neuron (u, d) nearest to every input (n, d), the lowest of equals, and the squared distance to it.

    The nearest has the largest x . m - |m|^2 / 2: one product in single precision, with a column of ones for the
    squares, relative to the middle of the neurons. How a product rounds depends on its threads; so the neurons
    that it cannot tell apart are compared again in double, and no bit of the result depends on it.
    """
    middle = codebook.mean(axis=0)
    off = (codebook - middle).astype(np.float32)
    factors = np.vstack([off.T, -0.5 * np.einsum("ud,ud->u", off, off)])
    longest = float(np.sqrt(2 * np.abs(factors[-1]).max(initial=0)))
    winners, squared = np.empty(len(inputs), np.int32), np.empty(len(inputs), np.float32)
    shown = np.ones((min(BLOCK, len(inputs)), len(factors)), np.float32)
    for start in range(0, len(inputs), BLOCK):
        rows = inputs[start : start + BLOCK]
        block = shown[: len(rows)]
        np.subtract(rows, middle, out=block[:, :-1], casting="same_kind")
        lengths = np.sqrt(np.einsum("nd,nd->n", block[:, :-1], block[:, :-1]))
        rounding = 2 * len(factors) * np.finfo(np.float32).eps * longest * (lengths + longest)
        winners[start : start + BLOCK] = _decided(block @ factors, rounding.astype(np.float32), codebook, rows)
    squared_distances(np.ascontiguousarray(codebook), np.ascontiguousarray(inputs), winners, squared)
    return winners, squared


def _decided(
    score: NDArray[np.float32], rounding: NDArray[np.float32], codebook: Floats, rows: Floats
) -> NDArray[np.int32]:
    """Return the nearest neurons from scores that are off by their rounding."""
    best, close = np.empty(len(rows), np.int32), np.empty(len(rows), np.int32)
    highest(score, rounding, best, close)
    for n in np.flatnonzero(close > 1):
        candidates = np.flatnonzero(score[n] >= score[n, best[n]] - rounding[n])
        off = codebook[candidates] - rows[n]
        best[n] = candidates[np.einsum("cd,cd->c", off, off).argmin()]
    return best


def train_batch(
    codebook: Floats,
    inputs: Floats,
    amounts: Floats,
    hops: NDArray[np.int32],
    neighborhoods: Floats,
    box: Floats,
    tolerance: float,
    settled: int,
    history: Floats,
) -> int:
    """Do what `tomomesh.kernels.som.batch.train_batch` does."""
    rows, totals = np.ascontiguousarray(inputs.T), np.empty((codebook.shape[1], len(codebook) + 1))
    for epoch, neighborhood in enumerate(neighborhoods):
        winners, squared = best_matching_units(codebook.T, rows)
        add_rows(rows, amounts, winners, totals)
        history[epoch, 0] = (np.sqrt(squared) * amounts).sum() / amounts.sum()
        history[epoch, 1] = _move_to_means(codebook, totals, hops, neighborhood, box)
        if history[epoch, 1] <= tolerance and epoch >= settled:
            return epoch + 1
    return len(neighborhoods)


def _move_to_means(
    codebook: Floats, totals: Floats, hops: NDArray[np.int32], neighborhood: Floats, box: Floats
) -> float:
    """Do what `tomomesh.kernels.som.batch.move_to_means` does, for totals (u, d + 1)."""
    sums = np.empty_like(totals)
    add_shares(totals, hops, neighborhood, sums)
    reached = sums[:, -1]
    places = np.clip(sums[:, :-1].T / np.where(reached > 0, reached, 1.0), *box[:, :, None])
    places = np.where(reached > 0, places, codebook)
    farthest = np.sqrt(((places - codebook) ** 2).sum(axis=0).max())
    codebook[:] = places
    return float(farthest)
