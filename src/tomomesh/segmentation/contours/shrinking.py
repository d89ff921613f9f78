"""Take back what a ring lost on its bends by the averaging of its training."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...kernels.contours.shrinking import unshrink
from ...kernels.som.neighborhoods import GAUSSIAN, weigh
from ...model.columns import for_kernels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

STRIDE = 2
"""Neurons from each to those by which its curvature is measured: over twice the way, a neuron's own noise counts a
quarter. Measured on a band and on a bean, .0486 and .060 px off at 1, .0418 and .060 at 2, .0401 and .062 at 4."""


def unshrunk(ring: Floats, gaps: NDArray[np.bool_], radius: float, half_width: float = 0.0) -> Floats:
    """Put the neurons of a ring back onto the middle line of the band that it was trained on.

    In batch a neuron is the mean of the inputs that it and its neighbors win. On a line of curvature c, with neurons s
    apart, that mean lies inside of the line: by s^2 c / 24 for its own stretch of the line, and by v s^2 c / 2 for its
    neighbors', whose hops have the variance v under the bell. In a band of half width h the outer side is the longer
    one, which takes the mean outward by h^2 c / 3. What is left is undone: c is the second difference of the neurons
    over s^2.

    Parameters
    ----------
    ring : (u, 2) float array
    gaps : (u,) bool array
        Sides that cross a gap in the inputs: where they are near, a neuron stays.
    radius : float
        The last of the training's bell, hops.
    half_width : float
        h; 0 on a line.

    Returns
    -------
    (u, 2) float array
    """
    put = np.empty((len(ring), 2))
    averaged = 1 / 24 + bell_variance(radius, len(ring)) / 2
    unshrink(for_kernels(ring, np.float64), for_kernels(gaps, np.bool_), averaged, half_width, STRIDE, put)
    return put


def bell_variance(radius: float, count: int) -> float:
    """Return the variance of the hops under a bell on a ring of so many neurons."""
    weight = np.zeros(count // 2 + 1)
    weigh(weight, radius, 1.0, GAUSSIAN)
    weight[1:] *= 2
    return float((weight * np.arange(len(weight)) ** 2).sum() / weight.sum())
