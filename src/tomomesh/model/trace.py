"""The history of a fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


class Motion(NamedTuple):
    """How a mesh moves at one step; see `Trace`."""

    speed: float
    acceleration: float
    kinetic: float
    potential: float = 0.0
    distance_mm: float = 0.0
    clamped: int = 0
    unattracted: int = 0

    def rests(self, tolerance: float) -> bool:
        """Tell whether neither speed nor acceleration of any vertex reaches a tolerance."""
        return bool(max(self.speed, self.acceleration) < tolerance)


@dataclass(frozen=True)
class Trace:
    """What the dynamic mesh did, one entry a step (t,).

    Attributes
    ----------
    speed, acceleration : float arrays
        Largest over the vertices, cube edges per unit time (1/omega) and its square; without a network, voxels per
        step and its square.
    kinetic, potential : float arrays
        Energy per unit k_d, mm^2; springs and attraction together.
    distance_mm : float array
        Mean distance of the attracted vertices to their points.
    clamped : int array
        Vertices whose motion was limited to one cube edge.
    unattracted : int array
        Vertices without a point among their 27 cubes (k_d = 0).
    converged : bool
        Whether the mesh is at rest: speed and acceleration of every vertex are below the tolerance.
    """

    speed: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    kinetic: NDArray[np.float64]
    potential: NDArray[np.float64]
    distance_mm: NDArray[np.float64]
    clamped: NDArray[np.int64]
    unattracted: NDArray[np.int64]
    converged: bool

    @classmethod
    def of(cls, history: Sequence[Motion], *, converged: bool) -> Trace:
        """Return a history as arrays."""
        steps = np.array(history).reshape(-1, len(Motion._fields)).T
        speed, acceleration, kinetic, potential, distance = steps[:5]
        clamped, unattracted = steps[5:].astype(np.int64)
        return cls(speed, acceleration, kinetic, potential, distance, clamped, unattracted, converged)
