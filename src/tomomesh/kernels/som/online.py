"""Self-organising map: presentations one by one, each matched (eq. 1) and followed (eq. 2).

Positions are stored one row an axis, (d, u), so that the loops over neurons vectorize.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .neighborhoods import BUBBLE, LATERAL, weigh

if TYPE_CHECKING:
    from numpy.typing import NDArray

LANES = 32
"""Neurons that one turn of the vectorized search takes; what is left over would be searched one by one."""
INDEX_BITS = 16_383
"""Low bits of a squared distance that carry the neuron's number; as many neurons a network may have."""


@kernel("void(f8[:,::1], f8[:,::1], i4[:,::1], i4[:,::1], i4[:,::1], f8[::1], f8[::1], i8, f8[:,::1])")
def train_online(
    codebook: NDArray[np.float64],
    inputs: NDArray[np.float64],
    hops: NDArray[np.int32],
    nearest_first: NDArray[np.int32],
    within: NDArray[np.int32],
    alpha: NDArray[np.float64],
    radius: NDArray[np.float64],
    shape: int,
    box: NDArray[np.float64],
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
        See `tomomesh.model.graph.Lattice`.
    alpha, radius : (t,) float arrays
        Learning rate and radius of each presentation.
    shape : int
        The neighborhood, see `tomomesh.kernels.som.neighborhoods`.
    box : (2, d) float array
        Lowest and highest input along each axis: inhibition drives no neuron out of it.

    Notes
    -----
    Finite inputs, two axes at least, at most 16,383 neurons. Non-negative floats order as the integers that spell
    them, and a minimum of integers vectorizes: so the number of each neuron rides in the last bits of its
    distance. Of neurons that are equally near (within 4e-12 of the squared distance) the lowest number wins. Neurons
    at infinity fill the last vector. Where a quarter of a bell or more moves all are gone through in their order,
    which vectorizes.
    """
    d, u = codebook.shape
    neurons = np.full((d, -(-u // LANES) * LANES), np.inf)
    neurons[:, :u] = codebook
    farther = np.zeros(neurons.shape[1])
    weight, share = np.empty(within.shape[1]), np.empty(u)
    row, next_row = neurons[0], neurons[1]
    for t in range(len(inputs)):
        for axis in range(2, d):
            z, depth = inputs[t, axis], neurons[axis]
            for i in range(len(farther)):
                off = z - depth[i]
                farther[i] = off * off if axis == 2 else farther[i] + off * off
        x, y = inputs[t, 0], inputs[t, 1]
        winner = np.int64(2**63 - 1)
        for i in range(len(farther)):
            squared = (x - row[i]) * (x - row[i]) + (y - next_row[i]) * (y - next_row[i]) + farther[i]
            bits = np.float64(squared).view(np.int64)
            winner = min(winner, (bits & ~np.int64(INDEX_BITS)) | np.int64(i))
        c = winner & np.int64(INDEX_BITS)
        reach = weigh(weight, radius[t], alpha[t], shape)
        count, apart = within[c, reach], hops[c]
        if shape == BUBBLE:
            for i in nearest_first[c, :count]:
                row[i] += alpha[t] * (x - row[i])
                next_row[i] += alpha[t] * (y - next_row[i])
                for axis in range(2, d):
                    neurons[axis, i] += alpha[t] * (inputs[t, axis] - neurons[axis, i])
        elif 4 * count > u:
            weight[reach + 1 :] = 0.0
            for i in range(u):
                share[i] = weight[apart[i]]
            for axis in range(d):
                z, line = inputs[t, axis], neurons[axis]
                for i in range(u):
                    line[i] += share[i] * (z - line[i])
        else:
            for i in nearest_first[c, :count]:
                follows = weight[apart[i]]
                row[i] += follows * (x - row[i])
                next_row[i] += follows * (y - next_row[i])
                for axis in range(2, d):
                    neurons[axis, i] += follows * (inputs[t, axis] - neurons[axis, i])
        if shape == LATERAL:
            for axis in range(d):
                for i in range(u):
                    neurons[axis, i] = min(max(neurons[axis, i], box[0, axis]), box[1, axis])
    codebook[:] = neurons[:, :u]
