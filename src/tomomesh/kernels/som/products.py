"""What goes on around the matrix products of networks on inputs of many dimensions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

COLUMNS, ROWS = 80, 4
"""Columns of the totals that are added together: 1,000 rows of them are half a megabyte, and stay in the second cache;
and the neurons that are added to together, while a row of them is at hand. No result depends on them."""
LANES = 8
"""Partial sums of a squared distance, which vectorize."""


@kernel("i4(f4)")
def _as_integer(value: np.float32) -> np.int32:
    """Spell a float by an integer of the same order."""
    bits = np.float32(value).view(np.int32)
    return np.int32(bits ^ ((bits >> np.int32(31)) & np.int32(2**31 - 1)))


@kernel("void(f4[:,::1], f4[::1], i4[::1], i4[::1])")
def highest(
    score: NDArray[np.float32], rounding: NDArray[np.float32], best: NDArray[np.int32], close: NDArray[np.int32]
) -> None:
    """Find the highest of each row, and count what its rounding cannot tell from it.

    Parameters
    ----------
    score : (n, u) float array
        Finite.
    rounding : (n,) float array
        None negative.
    best : (n,) int array
        Result: where the highest is; the first of equals.
    close : (n,) int array
        Result: how many are at most the rounding below it, itself among them.
    """
    for n in range(len(score)):
        row = score[n]
        top = np.int32(-(2**31 - 1))
        for i in range(len(row)):
            top = max(top, _as_integer(row[i]))
        first = 0
        while _as_integer(row[first]) != top:
            first += 1
        bound, count = row[first] - rounding[n], np.int32(0)
        for i in range(len(row)):
            count += np.int32(row[i] >= bound)
        best[n], close[n] = first, count


@kernel("void(f8[:,::1], f8[:,::1], i4[::1], f4[::1])")
def squared_distances(
    codebook: NDArray[np.float64], inputs: NDArray[np.float64], winners: NDArray[np.int32], squared: NDArray[np.float32]
) -> None:
    """Measure how far inputs (n, d) are from their neurons (u, d), squared (n,)."""
    d = inputs.shape[1]
    whole, lanes = d - d % LANES, np.empty(LANES)
    for n in range(len(inputs)):
        x, m = inputs[n], codebook[winners[n]]
        lanes[:] = 0.0
        for start in range(0, whole, LANES):
            for lane in range(LANES):
                lanes[lane] += (x[start + lane] - m[start + lane]) ** 2
        total = lanes.sum()
        for axis in range(whole, d):
            total += (x[axis] - m[axis]) ** 2
        squared[n] = total


@kernel("void(f8[:,::1], f8[::1], i4[::1], f8[:,::1])")
def add_rows(
    inputs: NDArray[np.float64], amounts: NDArray[np.float64], winners: NDArray[np.int32], totals: NDArray[np.float64]
) -> None:
    """Add up what each neuron won: weighted sums of the inputs (n, d) and of 1, in their order, (u, d + 1)."""
    d = inputs.shape[1]
    totals[:] = 0.0
    for n in range(len(inputs)):
        own, row, amount = totals[winners[n]], inputs[n], amounts[n]
        for axis in range(d):
            own[axis] += amount * row[axis]
        own[d] += amount


@kernel("void(f8[:,::1], i4[:,::1], f8[::1], f8[:,::1])")
def add_shares(
    totals: NDArray[np.float64],
    hops: NDArray[np.int32],
    neighborhood: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Add up sum_c h(hops(i, c)) totals_c for each neuron i, for totals of many columns.

    Parameters
    ----------
    totals : (u, k) float array
    hops : (u, u) int array
    neighborhood : (h,) float array
        h by the number of hops.
    sums : (u, k) float array
        Result.

    Notes
    -----
    In the order of c, `COLUMNS` columns at a time, whose totals stay in the second cache, of `ROWS` neurons.
    """
    u, k = totals.shape
    some, own = np.zeros((u, COLUMNS)), np.empty((ROWS, COLUMNS))
    for start in range(0, k, COLUMNS):
        width = min(COLUMNS, k - start)
        for c in range(u):
            for column in range(width):
                some[c, column] = totals[c, start + column]
        for first in range(0, u, ROWS):
            own[:] = 0.0
            i, j, m, n = first, min(first + 1, u - 1), min(first + 2, u - 1), min(first + 3, u - 1)
            for c in range(u):
                a, b = neighborhood[hops[i, c]], neighborhood[hops[j, c]]
                e, f = neighborhood[hops[m, c]], neighborhood[hops[n, c]]
                if a != 0.0 or b != 0.0 or e != 0.0 or f != 0.0:
                    for column in range(COLUMNS):
                        total = some[c, column]
                        own[0, column] += a * total
                        own[1, column] += b * total
                        own[2, column] += e * total
                        own[3, column] += f * total
            for row in range(min(ROWS, u - first)):
                for column in range(width):
                    sums[first + row, start + column] = own[row, column]
