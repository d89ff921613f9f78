"""Look at a network while it is trained."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from .fit import fit, radii, start_positions
from .schedules import falling, radius_power

if TYPE_CHECKING:
    from collections.abc import Callable

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
    start = start_positions(inputs, lattice, settings.start, np.random.default_rng(seed))
    online = settings.training == "online"
    watch = _online if online else _in_batch
    steps, codebooks = watch(inputs, lattice, settings, np.random.default_rng(seed), pixel_area, most - 1)
    chosen = thinned(len(steps), most - 1)
    return Snapshots(
        np.stack([start, *(codebooks[n] for n in chosen)]),
        np.array([0, *(steps[n] for n in chosen)], np.int64),
        "presentations" if online else "epochs",
    )


def thinned(count: int, most: int) -> NDArray[np.int64]:
    """Choose at most so many of some numbers from 0 at equal steps, the last among them."""
    return np.unique(np.linspace(count - 1, 0, min(count, most)).round().astype(np.int64))


def _in_batch(
    inputs: Floats, lattice: Lattice, settings: NetworkSettings, rng: np.random.Generator, pixel_area: float, most: int
) -> tuple[list[int], list[Floats]]:
    seen: list[Floats] = []
    fit(inputs, lattice, settings, rng, pixel_area=pixel_area, callback=lambda codebook, epoch: seen.append(codebook))
    return list(range(1, len(seen) + 1)), seen


def _online(
    inputs: Floats, lattice: Lattice, settings: NetworkSettings, rng: np.random.Generator, pixel_area: float, most: int
) -> tuple[list[int], list[Floats]]:
    """Train piece by piece: each piece goes on with the same generator, rates and radii; the last one trims."""
    count = settings.iterations
    reach = radii(inputs, lattice, settings, pixel_area)
    rate_left = _left(*settings.alpha, count, settings.alpha_fall, settings.alpha_power)
    reach_left = _left(*reach, count, settings.radius_fall, radius_power(settings))
    stops = np.unique(np.ceil(count * (np.arange(1, most + 1) / most) ** 2).astype(np.int64))
    seen: list[Floats] = []
    for first, stop in zip([0, *stops[:-1]], stops, strict=True):
        piece = replace(settings, iterations=int(stop - first), least_move=0.0,
                        trim=settings.trim if stop == count else 0.0)  # fmt: skip
        fitted = fit(
            inputs, lattice, piece, rng, pixel_area=pixel_area, start=seen[-1] if seen else None,
            alpha_fall=_piece(rate_left, first, stop), radius_fall=_piece(reach_left, first, stop),
        )  # fmt: skip
        seen.append(fitted.codebook)
    return stops.tolist(), seen


def _left(first: float, last: float, steps: int, fall: str, power: float) -> Floats:
    """Return what is left of a fall at each step, 1 to 0."""
    whole = falling(first, last, steps, fall=fall, power=power)
    return (whole - last) / (first - last) if first != last else np.zeros(steps)


def _piece(left: Floats, first: int, stop: int) -> Callable[[Floats], Floats]:
    return lambda times: left[first:stop]
