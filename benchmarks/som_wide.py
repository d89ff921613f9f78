"""A map of 40 x 40 neurons on 784 dimensions: CPU time against somoclu (batch) and MiniSom (online).

``python som_wide.py [SAMPLES] [PRESENTATIONS]``. somoclu ships no binary for every Python; where it cannot train, its
row is left out.
"""

from __future__ import annotations

import sys
import time
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from minisom import MiniSom

from bench import at_least, header, holds, note
from tomomesh.model.lattice import lattice
from tomomesh.settings import NetworkSettings
from tomomesh.som.fit import fit

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

SIDE, AXES, EPOCHS = 40, 784, 1
SAMPLES, PRESENTATIONS = 60_000, 400


def main() -> None:
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else SAMPLES
    presentations = int(sys.argv[2]) if len(sys.argv) > 2 else PRESENTATIONS
    header(f"{SIDE} x {SIDE} neurons, {samples} samples of {AXES} dimensions", "minisom")
    inputs = clusters(samples)
    grid = lattice("grid", 0, shape=(SIDE, SIDE))
    start = inputs[np.random.default_rng(1).choice(samples, len(grid), replace=samples < len(grid))]

    def batch() -> None:
        fit(inputs, grid, NetworkSettings(epochs=EPOCHS, trim=0), np.random.default_rng(0), start=start)

    ours = cpu(batch)
    note(f"batch, {EPOCHS} epoch: CPU time", f"{ours:.3g} s")
    theirs = somoclu(inputs, start)
    if theirs is None:
        note("batch against somoclu", "not measured: somoclu has no binary here")
    else:
        at_least("batch against somoclu", theirs / ours, 1, "x")
    online(inputs, grid, start, presentations)
    faithful(inputs[:5000], grid)


def clusters(samples: int) -> NDArray[np.float64]:
    """Draw digits-like data: 50 clusters on a few of their own axes."""
    rng = np.random.default_rng(0)
    centers, basis = rng.normal(size=(50, AXES)), rng.normal(size=(20, AXES))
    inputs = centers[rng.integers(50, size=samples)]
    return inputs + 0.3 * rng.normal(size=(samples, 20)) @ basis


def online(inputs: NDArray[np.float64], grid: Any, start: NDArray[np.float64], presentations: int) -> None:
    """Compare presentations one by one, each with its default neighborhood."""

    def ours(neighborhood: str, count: int = presentations) -> Callable[[], Any]:
        kind = NetworkSettings(training="online", iterations=count, trim=0, neighborhood=neighborhood)
        return lambda: fit(inputs, grid, kind, np.random.default_rng(0), start=start)

    ours("auto", 1)()  # the grid's tables are made once
    peer = MiniSom(SIDE, SIDE, AXES, sigma=SIDE // 4, learning_rate=0.5, random_seed=0)
    theirs = cpu(lambda: peer.train_random(inputs, presentations))
    at_least("online against MiniSom, each with its default", theirs / cpu(ours("auto")), 4, "x")
    at_least("online against MiniSom, Gaussian both", theirs / cpu(ours("gaussian")), 4, "x")


def faithful(inputs: NDArray[np.float64], grid: Any) -> None:
    """Check that a short training is one: the map is better than its start, and the same every time."""
    settings = NetworkSettings(epochs=5, trim=0, start="axes")
    found = [fit(inputs, grid, settings, np.random.default_rng(0)) for _ in range(2)]
    errors = found[0].history.quantization_error
    two = fit(inputs, grid, settings, np.random.default_rng(0), callback=lambda codebook, epoch: None)
    holds("looking on changes no bit", two.codebook.tobytes() == found[0].codebook.tobytes())
    holds("5 epochs lower the quantization error", bool(errors[-1] < errors[0]))
    holds("the same bytes again", found[0].codebook.tobytes() == found[1].codebook.tobytes())


def somoclu(inputs: NDArray[np.float64], start: NDArray[np.float64]) -> float | None:
    """Return the CPU time of somoclu's dense kernel, or None where it is not there."""
    try:
        shown = inputs.astype(np.float32)
        first = start.astype(np.float32).reshape(SIDE, SIDE, -1)
        peer = import_module("somoclu").Somoclu(SIDE, SIDE, initialcodebook=first)
        return cpu(lambda: peer.train(shown, epochs=EPOCHS))
    except (ImportError, NameError):  # its Python part loads, and trains, without its binary
        return None


def cpu(call: Callable[[], Any]) -> float:
    before = time.process_time()
    call()
    return time.process_time() - before


if __name__ == "__main__":
    main()
