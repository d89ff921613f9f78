"""What happened in each epoch of a training."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class History:
    """One number an epoch (a pass over the inputs; in online training as many presentations), each (epochs,).

    Attributes
    ----------
    quantization_error : float array
        Mean distance of an input to its winner, before the epoch in batch and after it online.
    largest_move : float array
        Farthest that a neuron moved.
    radius : float array
        Of the neighborhood at the end of the epoch, hops.
    alpha : float array
        Learning rate at the end of the epoch; 1 in batch, which moves a neuron all the way.
    """

    quantization_error: NDArray[np.float64]
    largest_move: NDArray[np.float64]
    radius: NDArray[np.float64]
    alpha: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.radius)

    def __repr__(self) -> str:
        """Return one line: the numbers of all epochs would fill a page."""
        ends = [float(self.quantization_error[n]) for n in (0, -1)] if len(self) else []
        told = f", quantization error {ends[0]:.4g} to {ends[1]:.4g}" if ends else ""
        return f"<History: {len(self)} epochs{told}>"

    def then(self, later: History) -> History:
        """Append what happened later."""
        pairs = [(getattr(self, entry.name), getattr(later, entry.name)) for entry in fields(self)]
        return History(*(np.concatenate(pair) for pair in pairs))
