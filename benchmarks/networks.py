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
    from numpy.typing import NDArray

    Inputs = list[NDArray[np.float64]]

NEURONS, PRESENTATIONS = 58, 10_000
ONLINE = NetworkSettings(training="online", iterations=PRESENTATIONS, trim=0)
GAUSSIAN = NetworkSettings(training="online", iterations=PRESENTATIONS, trim=0, neighborhood="gaussian")
BATCH = NetworkSettings()
SOME = slice(0, 54, 18)
"""The slices that MiniSom is timed on; every slice has the same number of presentations."""


def main() -> None:
    header("The networks of 54 slices, 58 neurons and 10,000 presentations each", "minisom")
    head = phantom()
    mask = window(head.volume, lower=head.lower, upper=head.upper)
    inputs = [np.argwhere(plane)[:, ::-1].astype(float) for plane in mask]
    bubble, gaussian, batch = (_ours(inputs, settings) for settings in (ONLINE, GAUSSIAN, BATCH))
    peer = _minisom(inputs[SOME], "gaussian")
    peer_bubble = _minisom(inputs[SOME], "bubble")
    for name, seconds in (
        ("online, bubble", bubble),
        ("online, Gaussian", gaussian),
        ("batch, 10 epochs", batch),
        ("MiniSom, Gaussian", peer),
        ("MiniSom, bubble", peer_bubble),
    ):
        note(f"{name}: CPU time a slice", f"{1e3 * seconds:.3g} ms")
    at_least("online against MiniSom, each with its default neighborhood", peer / bubble, 200, "x")
    note("online against MiniSom, bubble both", f"{peer_bubble / bubble:.3g} x")
    note("online against MiniSom, Gaussian both", f"{peer / gaussian:.3g} x")
    note("batch against MiniSom with its default", f"{peer / batch:.3g} x")
    for name, settings in (("online", ONLINE), ("batch", BATCH)):
        one, two = (train_study(mask, settings, threads=threads).codebooks.tobytes() for threads in (1, 2))
        holds(f"{name}: the same bytes with 1 and 2 threads", one == two)


def _ours(inputs: Inputs, settings: NetworkSettings) -> float:
    """Return the CPU seconds a slice."""
    ring = lattice("ring", NEURONS)

    def study() -> None:
        for k, pixels in enumerate(inputs):
            train(pixels, ring, settings, np.random.default_rng([0, k]))

    return median_times(study, clock=time.process_time)[0] / len(inputs)


def _minisom(inputs: Inputs, neighborhood: str) -> float:
    """Return the CPU seconds a slice, of the training alone."""

    def study() -> None:
        for pixels in inputs:
            som = MiniSom(
                NEURONS, 1, 2, sigma=NEURONS // 4, learning_rate=0.5,
                neighborhood_function=neighborhood, random_seed=0,
            )  # fmt: skip
            som.train_random(pixels, PRESENTATIONS)

    return median_times(study, repeats=3, clock=time.process_time)[0] / len(inputs)


if __name__ == "__main__":
    main()
