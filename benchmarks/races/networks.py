"""Networks beside MiniSom (rings on slices) and somoclu (a map on 784 dimensions), and their part of a study."""

from __future__ import annotations

import tracemalloc
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import Cost, at_least, costs, note
from tomomesh import phantom, window
from tomomesh.model.lattice import lattice
from tomomesh.segmentation.networks.training import train_study
from tomomesh.settings import NetworkSettings
from tomomesh.som.fit import fit

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

NEURONS, PRESENTATIONS = 58, 10_000
FEW = NetworkSettings(epochs=3, trim=0)
ONLINE = NetworkSettings(training="online", iterations=PRESENTATIONS, trim=0)
SOME = slice(0, 54, 18)
"""The slices that MiniSom is clocked on; every slice has the same number of presentations."""
SIDE, AXES, SAMPLES = 40, 784, 60_000


def main() -> None:
    head = phantom()
    mask = window(head.volume, lower=head.lower, upper=head.upper)
    (study,) = costs(lambda: train_study(mask, NetworkSettings()))
    note("networks of 54 slices: CPU, wall", f"{1e3 * study.cpu:.3g} ms, {1e3 * study.wall:.3g} ms")
    rings([np.argwhere(plane)[:, ::-1].astype(float) for plane in mask if np.count_nonzero(plane) >= NEURONS])
    wide()


def rings(inputs: list[Floats]) -> None:
    """Clock rings beside MiniSom's chain, for the same number of presentations."""
    if (peer := imported("minisom")) is None:
        return
    ring = lattice("ring", NEURONS)

    def ours(settings: NetworkSettings) -> Callable[[], None]:
        def run() -> None:
            for one in inputs:
                fit(one, ring, settings, np.random.default_rng(0))

        return run

    def theirs() -> None:
        for one in inputs[SOME]:
            som = peer.MiniSom(NEURONS, 1, 2, sigma=NEURONS // 4, learning_rate=0.5, random_seed=0)
            som.train_random(one, PRESENTATIONS)

    few, online, minisom = costs(ours(FEW), ours(ONLINE), theirs, repeats=3)
    slices = len(inputs) / len(inputs[SOME])
    shown = FEW.epochs * sum(map(len, inputs)) / len(inputs) / PRESENTATIONS
    told("batch of 3 epochs against MiniSom, for the same presentations", few, minisom, slices * shown, 1500)
    told("online against MiniSom, each with its default neighborhood", online, minisom, slices, 250)


def wide() -> None:
    """Clock a map of many dimensions beside somoclu's, and measure what it takes over its inputs."""
    inputs, grid = clusters(SAMPLES), lattice("grid", 0, shape=(SIDE, SIDE))
    start = inputs[np.random.default_rng(1).choice(SAMPLES, len(grid), replace=False)]

    def ours() -> None:
        fit(inputs, grid, NetworkSettings(epochs=1, trim=0), np.random.default_rng(0), start=start)

    tracemalloc.start()
    ours()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    note(f"{SAMPLES:,} x {AXES}: peak over {inputs.nbytes / 2**20:.0f} MiB of inputs", f"{peak / 2**20:.0f} MiB")
    if (peer := imported("somoclu")) is None:
        return
    shown, first = inputs.astype(np.float32), start.astype(np.float32).reshape(SIDE, SIDE, -1)

    def theirs() -> None:
        peer.Somoclu(SIDE, SIDE, initialcodebook=first.copy()).train(shown, epochs=1)

    try:
        mine, somoclu = costs(ours, theirs, repeats=1)
    except NameError:  # its Python part loads without its binary
        note("somoclu", "not measured: it has no binary here")
        return
    told(f"{SAMPLES:,} x {AXES}, an epoch of batch against somoclu", mine, somoclu, 1.0, 20)


def told(figure: str, ours: Cost, peer: Cost, times: float, mark: float) -> None:
    """Print how many times faster we are, where the peer did a part of the work."""
    note(f"{figure}: CPU", f"{ours.cpu:.3g} s for {peer.cpu * times:.3g} s")
    note(f"{figure}: wall, ratio", f"{peer.wall * times / ours.wall:.3g} x")
    at_least(f"{figure}: CPU, ratio", peer.cpu * times / ours.cpu, mark, "x")


def imported(name: str) -> Any:
    """Return a peer, or None after saying that it is absent."""
    try:
        return import_module(name)
    except ImportError:
        note(name, "not measured: it is not installed")
        return None


def clusters(samples: int) -> Floats:
    """Draw digits-like data: 50 clusters on a few of their own axes."""
    rng = np.random.default_rng(0)
    centers, basis = rng.normal(size=(50, AXES)), rng.normal(size=(20, AXES))
    inputs = centers[rng.integers(50, size=samples)]
    return inputs + 0.3 * rng.normal(size=(samples, 20)) @ basis


if __name__ == "__main__":
    main()
