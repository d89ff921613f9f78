"""How near do the neurons of one ring lie to the true line of a band, and does the ring describe it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bench import at_most, header, judge, note
from tomomesh import SOM
from tomomesh.segmentation.networks.training import train_study
from tomomesh.settings import NetworkSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

SEEDS = 100
WINDOW = (200, 500)
ONLINE = NetworkSettings(neurons=80, training="online", iterations=10_000, trim=0)
BATCH = NetworkSettings(neurons=80)
PAPER = NetworkSettings(**{"neurons": 80, **NetworkSettings().paper()})


def main() -> None:
    band = judge("band")
    header(f"One ring of 80 neurons on a band, {SEEDS} slices with {SEEDS} seeds")
    images = np.stack([band.slice_image(seed=seed) for seed in range(SEEDS)])
    mask = (images > WINDOW[0]) & (images <= WINDOW[1])
    _measure(band, mask, "online, 10,000 presentations", ONLINE, mark=0.25)
    _measure(band, mask, "batch, 10 epochs", BATCH, mark=0.05)
    short, longer = (_of_estimator(band, mask, epochs) for epochs in (3, 20))
    at_most("SOM at defaults, 3 epochs: mean distance to the line", short, 0.079, "px")
    at_most("SOM at defaults, 20 epochs, which are no worse", longer, short, "px")
    rings = rings_of(mask, PAPER)
    note("--paper: mean distance to the line", f"{_mean_distance(band, rings):.3f} px")
    note("--paper: slices with a tangle", f"{sum(crossings(ring) > 0 for ring in rings)} of {SEEDS}")


def _measure(band: Any, mask: NDArray[np.bool_], name: str, settings: NetworkSettings, mark: float) -> None:
    rings = rings_of(mask, settings)
    at_most(f"{name}: mean distance to the line", _mean_distance(band, rings), mark, "px")
    farthest = max(float(band.coverage(ring).max()) for ring in rings)
    at_most(f"{name}: farthest point of the line from a neuron", farthest, 8, "px")
    at_most(f"{name}: slices with a tangle", sum(crossings(ring) > 0 for ring in rings), 0)


def _of_estimator(band: Any, mask: NDArray[np.bool_], epochs: int) -> float:
    """Return the mean distance to the line of rings that are trained by the estimator, told nothing of the band."""
    rings = [SOM(80, topology="ring", epochs=epochs, random_state=0).fit(np.argwhere(each)).codebook_ for each in mask]
    return _mean_distance(band, rings)


def rings_of(mask: NDArray[np.bool_], settings: NetworkSettings) -> list[NDArray[np.float64]]:
    """Train a network on every slice; its neurons as (row, column)."""
    return list(train_study(mask, settings).codebooks[:, :, ::-1])


def _mean_distance(band: Any, rings: list[NDArray[np.float64]]) -> float:
    return float(np.mean([band.distances(ring).mean() for ring in rings]))


def crossings(ring: NDArray[np.float64]) -> int:
    """Count the pairs of sides of a closed polygon that cross each other."""
    a, b = ring, np.roll(ring, -1, axis=0)
    from_a, from_b = (_side(a[:, None], b[:, None], end[None, :]) for end in (a, b))
    apart = from_a * from_b < 0
    return int((apart & apart.T).sum() // 2)


def _side(a: NDArray[np.float64], b: NDArray[np.float64], p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Tell on which side of the line from a to b a point lies; rounding counts as on the line."""
    along, across = b - a, p - a
    turn = along[..., 0] * across[..., 1] - along[..., 1] * across[..., 0]
    return np.asarray(np.where(np.abs(turn) < 1e-9, 0.0, turn))


if __name__ == "__main__":
    main()
