"""The history of a fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Trace:
    """What the dynamic mesh did, one entry a step (t,).

    Attributes
    ----------
    speed, acceleration : float arrays
        Largest over the vertices, cube edges per unit time (1/omega) and its square.
    kinetic, potential : float arrays
        Energy per unit k_d, mm^2; springs and attraction together.
    distance_mm : float array
        Mean distance of the attracted vertices to their points.
    clamped : int array
        Vertices whose motion was limited to one cube edge.
    unattracted : int array
        Vertices without a point among their 27 cubes (k_d = 0).
    converged : bool
        Whether speed and acceleration fell below the tolerance.
    """

    speed: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    kinetic: NDArray[np.float64]
    potential: NDArray[np.float64]
    distance_mm: NDArray[np.float64]
    clamped: NDArray[np.int64]
    unattracted: NDArray[np.int64]
    converged: bool
