"""Neighborhoods: how strongly a neuron follows an input, by its hops from the winner."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

BUBBLE, GAUSSIAN, LATERAL = 0, 1, 2
"""Shapes: 1 up to the radius; a bell; the paper's lateral coupling."""
BELL = 6.0
"""Radii at which the bell ends: it has fallen to 1.5e-8."""
INHIBITION, INHIBITED = -0.03, 3.0
"""Weight of the inhibitory zone around the bubble, and where it ends in radii.

What inhibition pushes away moves farther the farther it is. Measured on a ring of 80: -0.1 throws the neurons about at
a learning rate of 0.5 and leaves tangles in every run, -0.03 in none, and lies as near to the true line as a bubble.
"""
FAR, FAR_END = 0.0015, 9.0
"""Weight of the weak excitatory zone beyond, and where that ends in radii: the paper gives no numbers. Chosen: half of
the weight changes the distance by -3.5 %, twice by -3.0 %; half of the radii by -6.8 %, twice by +2.3 %."""


@kernel("i8(f8[::1], f8, f8, i8)")
def weigh(weight: NDArray[np.float64], radius: float, scale: float, shape: int) -> int:
    """Fill in the neighborhood of one radius, times a scale.

    Parameters
    ----------
    weight : (h,) float array
        Result: the weight at 0, 1, ... hops, up to the reach that is returned; what lies beyond is not touched.
    radius : float
        Hops.
    scale : float
        The learning rate; 1 in batch.
    shape : {BUBBLE, GAUSSIAN, LATERAL}

    Returns
    -------
    int
        The most hops that have a weight.

    Notes
    -----
    One exponential gives the whole bell: from hop k to k + 1 it falls by q^(2k + 1), q = exp(-1 / 2 radius^2).
    """
    wide = BELL if shape == GAUSSIAN else FAR_END if shape == LATERAL else 1.0
    reach = int(min(wide * radius, len(weight) - 1.0))
    weight[: reach + 1] = scale
    if shape == GAUSSIAN:
        ratio = square = np.exp(-0.5 / max(radius * radius, 1e-12))
        square *= square
        for hop in range(1, reach + 1):
            weight[hop] = weight[hop - 1] * ratio
            ratio *= square
    elif shape == LATERAL:
        for hop in range(1, reach + 1):
            if hop > radius:
                weight[hop] = scale * (INHIBITION if hop <= INHIBITED * radius else FAR)
    return reach
