"""How much CPU time do the networks of a study of 54 slices take, training alone; ``som_*.py`` have the rest."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
from minisom import MiniSom

from bench import at_least, header, holds, median_times, note
from tomomesh import phantom, window
from tomomesh.model.lattice import lattice
from tomomesh.segmentation.networks.training import train_study
from tomomesh.settings import NetworkSettings
from tomomesh.som.fit import fit

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Inputs = list[NDArray[np.float64]]

NEURONS, PRESENTATIONS = 58, 10_000
ONLINE = NetworkSettings(training="online", iterations=PRESENTATIONS, trim=0)
GAUSSIAN = NetworkSettings(training="online", iterations=PRESENTATIONS, trim=0, neighborhood="gaussian")
BATCH = NetworkSettings()
FEW = NetworkSettings(epochs=3, trim=0)
"""Three passes from an ellipse: about as many presentations as online."""
SOME = slice(0, 54, 18)
"""The slices that MiniSom is timed on; every slice has the same number of presentations."""


def main() -> None:
    header("The networks of 54 slices, 58 neurons and 10,000 presentations each", "minisom")
    head = phantom()
    mask = window(head.volume, lower=head.lower, upper=head.upper)
    inputs = [np.argwhere(plane)[:, ::-1].astype(float) for plane in mask if np.count_nonzero(plane) >= NEURONS]
    some = inputs[SOME]
    calls = {
        "online, bubble": _ours(inputs, ONLINE),
        "online, Gaussian": _ours(inputs, GAUSSIAN),
        "batch, 3 epochs": _ours(inputs, FEW),
        "batch, 10 epochs and the trimmed re-fit": _ours(inputs, BATCH),
        "MiniSom, Gaussian": _minisom(some, "gaussian"),
        "MiniSom, bubble": _minisom(some, "bubble"),
    }
    totals = median_times(*calls.values(), repeats=7, clock=time.process_time)
    counts = [len(some if name.startswith("MiniSom") else inputs) for name in calls]
    times = [seconds / count for seconds, count in zip(totals, counts, strict=True)]
    for name, seconds in zip(calls, times, strict=True):
        note(f"{name}: CPU time a slice", f"{1e3 * seconds:.3g} ms")
    bubble, gaussian, few, batch, peer, peer_bubble = times
    at_least("online against MiniSom, each with its default neighborhood", peer / bubble, 250, "x")
    note("online against MiniSom, bubble both", f"{peer_bubble / bubble:.3g} x")
    note("online against MiniSom, Gaussian both", f"{peer / gaussian:.3g} x")
    shown = FEW.epochs * sum(map(len, inputs)) / len(inputs) / PRESENTATIONS
    at_least("batch of 3 epochs against MiniSom, for the same presentations", peer / few * shown, 1000, "x")
    note("batch of 10 epochs and the trimmed re-fit against MiniSom", f"{peer / batch:.3g} x")
    for name, settings in (("online", ONLINE), ("batch", BATCH)):
        one, two = (train_study(mask, settings, threads=threads).codebooks.tobytes() for threads in (1, 2))
        holds(f"{name}: the same bytes with 1 and 2 threads", one == two)


def _ours(inputs: Inputs, settings: NetworkSettings) -> Callable[[], None]:
    ring = lattice("ring", NEURONS)

    def run() -> None:
        for k, pixels in enumerate(inputs):
            fit(pixels, ring, settings, np.random.default_rng([0, k]))

    return run


def _minisom(inputs: Inputs, neighborhood: str) -> Callable[[], None]:
    def run() -> None:
        for pixels in inputs:
            som = MiniSom(
                NEURONS, 1, 2, sigma=NEURONS // 4, learning_rate=0.5,
                neighborhood_function=neighborhood, random_seed=0,
            )  # fmt: skip
            som.train_random(pixels, PRESENTATIONS)

    return run


if __name__ == "__main__":
    main()
