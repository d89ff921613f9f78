"""The two ways to train: input by input, or all inputs at once, epoch after epoch."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..kernels.som import batch as kernels_of_batch
from ..kernels.som import online as kernels
from ..kernels.som.neighborhoods import LATERAL, weigh
from . import products as wide
from .history import History

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ..model.lattice import Lattice
    from .inputs import Shown

    Floats = NDArray[np.float64]

SETTLED = 0.1
"""Share over its last value under which the radius has settled: a network at rest may stop, little is to come. Chosen:
half and twice of it change no case of benchmarks/constants.py."""
GATHERED = 4_000_000
"""Coordinates of presentations that are laid out at once, 32 MB of them. No result depends on it."""


@dataclass(frozen=True)
class Look:
    """How a training is looked at, which changes nothing about it.

    Attributes
    ----------
    told : callable
        Called as ``told(codebook, done, radius, alpha)`` before the first epoch and after each, of which so many are
        then done, with a codebook (u, d) of its own; raise in it to stop.
    times : int
        Online: how often it is called, the closer together the earlier, as t^2, for a random start untangles within
        the first presentations; 0 is after as many presentations as there are inputs, as it also is where the least
        move may end the training.
    """

    told: Callable[[Floats, int, float, float], None]
    times: int = 0


@dataclass(frozen=True)
class Watch:
    """Who looks on.

    Attributes
    ----------
    tolerance : float
        The training ends after an epoch in which no neuron moved farther, once the radius has settled.
    look : Look or None
    record : bool
        Whether every epoch is measured, where that costs time.
    axes : int
        How many of the codebook's axes are real.
    """

    tolerance: float
    look: Look | None
    record: bool
    axes: int

    @property
    def watched(self) -> bool:
        """Whether anything is asked for between the first and the last presentation."""
        return self.record or self.look is not None or self.tolerance > 0

    def tell(self, codebook: Floats, done: int, radius: float, alpha: float) -> None:
        """Show a copy of the codebook (d, u)."""
        if self.look is not None:
            self.look.told(codebook[: self.axes].T.copy(), done, float(radius), float(alpha))

    def stops(self, presentations: int, inputs: int) -> NDArray[np.int64]:
        """Return after which presentations a network is looked at online, rising, the last among them."""
        if self.look is not None and self.look.times and self.tolerance == 0:
            return at_times(presentations, self.look.times)
        each = inputs if self.watched else presentations
        return np.append(np.arange(each, presentations, each), presentations)


def at_times(presentations: int, times: int) -> NDArray[np.int64]:
    """Return so many numbers of presentations, or fewer, that lie the closer together the smaller they are, as t^2."""
    return np.unique(np.ceil(presentations * (np.arange(1, times + 1) / times) ** 2).astype(np.int64))


def train_online(
    codebook: Floats,
    shown: Shown,
    lattice: Lattice,
    shape: int,
    alpha: Floats,
    radius: Floats,
    rng: np.random.Generator,
    watch: Watch,
) -> History:
    """Present inputs drawn in proportion to their weights (eq. 1, 2).

    Parameters
    ----------
    codebook : (d, u) float array
        Changed in place.
    shown : Shown
    lattice : Lattice
    shape : int
        The neighborhood, see `tomomesh.kernels.som.neighborhoods`.
    alpha, radius : (t,) float arrays
        One presentation each.
    rng : Generator
    watch : Watch

    Returns
    -------
    History
        Empty where nothing asks for it.
    """
    order = _drawn(shown, len(radius), rng)
    stops = watch.stops(len(order), len(shown))
    rows: list[tuple[float, float, float, float]] = []
    for start, stop in pairwise([0, *stops.tolist()]):
        before = codebook.copy()
        _present(codebook, shown, lattice, shape, order[start:stop], alpha[start:stop], radius[start:stop])
        if watch.watched:
            watch.tell(codebook, len(rows) + 1, radius[stop - 1], alpha[stop - 1])
            move = float(np.sqrt(((codebook - before) ** 2).sum(axis=0).max()))
            rows.append((_error(codebook, shown) if watch.record else np.nan, move, radius[stop - 1], alpha[stop - 1]))
            if move <= watch.tolerance and radius[stop - 1] <= radius[-1] * (1 + SETTLED):
                break
    return History(*np.array(rows).reshape(-1, 4).T)


def _box(shown: Shown, shape: int) -> Floats:
    """Return what inhibition may drive no neuron out of; means of inputs stay among them without."""
    if shape == LATERAL:
        return shown.box
    return np.repeat([[-np.inf], [np.inf]], shown.inputs.shape[1], axis=1)


def _drawn(shown: Shown, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Draw inputs in proportion to their weights."""
    at = rng.random(count)
    if shown.weights is None:
        return (at * len(shown)).astype(np.int64)
    steps = np.cumsum(shown.weights)
    drawn = np.searchsorted(steps, at * steps[-1], side="right")
    return np.asarray(np.minimum(drawn, len(steps) - 1), np.int64)


def _present(
    codebook: Floats,
    shown: Shown,
    lattice: Lattice,
    shape: int,
    order: NDArray[np.int64],
    alpha: Floats,
    radius: Floats,
) -> None:
    """Lay the presentations out in their order, many at once, and learn them."""
    step = max(GATHERED // len(codebook), 1)
    for start in range(0, len(order), step):
        some = slice(start, start + step)
        kernels.train_online(
            codebook, shown.rows.take(order[some], axis=0), lattice.hops, lattice.nearest_first, lattice.within,
            alpha[some], radius[some], shape, _box(shown, shape),
        )  # fmt: skip


def _error(codebook: Floats, shown: Shown) -> float:
    _, squared = shown.match(codebook)
    return float(np.average(np.sqrt(squared, dtype=np.float64), weights=shown.weights))


def train_batch(
    codebook: Floats, shown: Shown, lattice: Lattice, shape: int, radius: Floats, watch: Watch, first_epoch: int = 0
) -> History:
    """Move the neurons to the neighborhood-weighted means of the inputs, once for each radius (epochs,).

    The other parameters are those of `train_online`. Epochs are numbered from `first_epoch`.
    """
    neighborhoods = np.zeros((len(radius), lattice.farthest + 1))
    for weights, reach in zip(neighborhoods, radius, strict=True):
        weigh(weights, reach, 1.0, shape)
    settled = int(np.argmax(radius <= radius[-1] * (1 + SETTLED)))
    rows, box = np.empty((len(radius), 2)), _box(shown, shape)
    step = len(radius) if watch.look is None else 1
    done = 0
    while done < len(radius):
        some = slice(done, done + step)
        falls = (lattice.hops, neighborhoods[some], box, watch.tolerance, settled - done, rows[some])
        done += _run(codebook, shown, falls)
        watch.tell(codebook, first_epoch + done, radius[done - 1], 1.0)
        if rows[done - 1, 1] <= watch.tolerance and done > settled:
            break
    return History(rows[:done, 0], rows[:done, 1], radius[:done], np.ones(done))


def _run(codebook: Floats, shown: Shown, falls: tuple[Any, ...]) -> int:
    if shown.wide:
        return wide.train_batch(codebook, shown.by_axis, shown.amounts, *falls)
    return kernels_of_batch.train_batch(codebook, shown.blocks.places, shown.blocks.boxes, shown.filled, *falls)
