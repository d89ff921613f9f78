"""How much CPU time do the networks of a study of 54 slices take, training alone."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
from minisom import MiniSom

from bench import at_least, header, holds, median_times, note
from tomomesh import phantom, window
from tomomesh.model.lattice import lattice
from tomomesh.segment.som import train
from tomomesh.segment.study import train_study
from tomomesh.settings import NetworkSettings

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Inputs = list[NDArray[np.float64]]

NEURONS, PRESENTATIONS = 58, 10_000
ONLINE = NetworkSettings(training="online", iterations=PRESENTATIONS, trim=0)
GAUSSIAN = NetworkSettings(training="online", iterations=PRESENTATIONS, trim=0, neighborhood="gaussian")
BATCH = NetworkSettings()
SOME = slice(0, 54, 18)
"""The slices that are timed; every slice has the same number of presentations."""


def main() -> None:
    header("The networks of 54 slices, 58 neurons and 10,000 presentations each", "minisom")
    head = phantom()
    mask = window(head.volume, lower=head.lower, upper=head.upper)
    inputs = [np.argwhere(plane)[:, ::-1].astype(float) for plane in mask[SOME]]
    calls = {
        "online, bubble": _ours(inputs, ONLINE),
        "online, Gaussian": _ours(inputs, GAUSSIAN),
        "batch, 10 epochs": _ours(inputs, BATCH),
        "MiniSom, Gaussian": _minisom(inputs, "gaussian"),
        "MiniSom, bubble": _minisom(inputs, "bubble"),
    }
    times = median_times(*calls.values(), repeats=7, clock=time.process_time)
    for name, seconds in zip(calls, times, strict=True):
        note(f"{name}: CPU time a slice", f"{1e3 * seconds / len(inputs):.3g} ms")
    bubble, gaussian, batch, peer, peer_bubble = times
    at_least("online against MiniSom, each with its default neighborhood", peer / bubble, 200, "x")
    note("online against MiniSom, bubble both", f"{peer_bubble / bubble:.3g} x")
    note("online against MiniSom, Gaussian both", f"{peer / gaussian:.3g} x")
    note("batch against MiniSom with its default", f"{peer / batch:.3g} x")
    for name, settings in (("online", ONLINE), ("batch", BATCH)):
        one, two = (train_study(mask, settings, threads=threads).codebooks.tobytes() for threads in (1, 2))
        holds(f"{name}: the same bytes with 1 and 2 threads", one == two)


def _ours(inputs: Inputs, settings: NetworkSettings) -> Callable[[], None]:
    ring = lattice("ring", NEURONS)

    def run() -> None:
        for k, pixels in enumerate(inputs):
            train(pixels, ring, settings, np.random.default_rng([0, k]))

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
