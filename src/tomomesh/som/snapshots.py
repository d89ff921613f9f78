"""Look at a network while it is trained."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from .fit import fit
from .passes import Look, at_times

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.lattice import Lattice
    from ..settings import NetworkSettings

    Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Snapshots:
    """A network at some times of its training, the start first.

    Attributes
    ----------
    codebooks : (s, u, d) float array
    steps : (s,) int64 array
        What was done until then: presentations online, epochs in batch.
    unit : str
        ``"presentations"`` or ``"epochs"``.
    """

    codebooks: Floats
    steps: NDArray[np.int64]
    unit: str

    def __len__(self) -> int:
        return len(self.steps)


def snapshots(
    inputs: Floats,
    lattice: Lattice,
    settings: NetworkSettings,
    *,
    seed: int = 0,
    pixel_area: float = 1.0,
    most: int = 60,
) -> Snapshots:
    """Train a network as `tomomesh.som.fit` does, and keep what it looked like on the way.

    In batch that is once an epoch, the passes of the trimmed re-fit among them. Online it is at times that lie the
    closer together the earlier they are, as t^2: a random start untangles within the first presentations. No early
    stop is made online.

    Parameters
    ----------
    inputs : (n, d) float array
    lattice : Lattice
    settings : NetworkSettings
    seed : int
    pixel_area : float
        Area that one input stands for.
    most : int
        Most snapshots, two at least.

    Returns
    -------
    Snapshots
    """
    seen: list[Floats] = []
    look = Look(lambda codebook, done, radius, alpha: seen.append(codebook), most - 1)
    online = settings.training == "online"
    asked = replace(settings, least_move=0.0) if online else settings
    fitted = fit(inputs, lattice, asked, np.random.default_rng(seed), pixel_area=pixel_area, look=look)
    steps = at_times(settings.iterations, most - 1) if online else np.arange(1, len(seen))
    seen[len(steps) :] = [fitted.codebook]  # online, the passes of the re-fit are one with the last piece
    chosen = thinned(len(steps), most - 1)
    return Snapshots(
        np.stack([seen[0], *(seen[n + 1] for n in chosen)]),
        np.array([0, *steps[chosen]], np.int64),
        "presentations" if online else "epochs",
    )


def thinned(count: int, most: int) -> NDArray[np.int64]:
    """Choose at most so many of some numbers from 0 at equal steps, the last among them."""
    return np.unique(np.linspace(count - 1, 0, min(count, most)).round().astype(np.int64))
