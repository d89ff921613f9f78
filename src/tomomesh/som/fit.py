"""Train one self-organising map on one set of inputs (eq. 1, 2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.som.neighborhoods import BUBBLE, GAUSSIAN, LATERAL
from .inputs import Shown, flat, match, median
from .passes import Look, Watch, train_batch, train_online
from .schedules import Fall, falling, radius_power
from .starts import CLOSED, start_positions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.lattice import Lattice
    from ..settings import NetworkSettings
    from .history import History

__all__ = ["Fitted", "fit", "match", "radii", "shape_of", "start_positions"]

Callback = Callable[["NDArray[np.float64]", int], None]

FINEST_OF_SHAPES, FINEST = 0.4, 0.65
"""Last radius of a bell in batch, hops: of the networks that take the shape of a line or a closed surface; of sheets.

Measured on rings over lines 1 to 8 pixels wide: 0.4 is best or next to it for 20 to 80 neurons, 0.65 draws them in two
to three times as much and is better from 200; on spheres of 162 to 1,002, half the loss of volume.
"""
WIDEST = 0.25
"""Most of the farthest hop that the last radius may be: a filled disc asks for 1 / (2 pi), 0.16, two thirds of that.
Chosen: half and twice of it change no case of benchmarks/constants.py."""
REFIT_EPOCHS = 5
"""Batch passes after stray inputs are dropped. Measured: five bring 2 % of strays from 0.48 to 0.07 pixels."""
SHAPES = {"bubble": BUBBLE, "gaussian": GAUSSIAN, "lateral": LATERAL}


@dataclass(frozen=True)
class Fitted:
    """A trained network.

    Attributes
    ----------
    codebook : (u, d) float array
    kept : (n,) bool array
        False for inputs without weight, and for stray ones that the trimmed re-fit dropped.
    history : History
    radius : float
        The last of the training, hops.
    """

    codebook: NDArray[np.float64]
    kept: NDArray[np.bool_]
    history: History
    radius: float


def fit(
    inputs: NDArray[np.float64],
    lattice: Lattice,
    settings: NetworkSettings,
    rng: np.random.Generator,
    *,
    pixel_area: float = 1.0,
    weights: NDArray[np.float64] | None = None,
    start: NDArray[np.float64] | None = None,
    callback: Callback | None = None,
    alpha_fall: Fall | None = None,
    radius_fall: Fall | None = None,
    record: bool = False,
    look: Look | None = None,
) -> Fitted:
    """Fit a network to inputs.

    Parameters
    ----------
    inputs : (n, d) float array
        Finite; in their own fixed order.
    lattice : Lattice
        The topology of u neurons.
    settings : NetworkSettings
    rng : Generator
        Draws the random start and the order of the presentations.
    pixel_area : float
        Area that one input stands for; from it follows how thick a band the inputs fill.
    weights : (n,) float array, optional
        How much each input counts: one of weight 2 as two, one of weight 0 not at all.
    start : (u, d) float array, optional
        The codebook to start from, in place of the settings' start.
    callback : callable, optional
        Called as ``callback(codebook, epoch)`` after each epoch, with a codebook of its own.
    alpha_fall, radius_fall : callable, optional
        How the learning rate and the radius fall, in place of the settings': from the time (t,), 0 to 1, to what
        is left, 1 to 0.
    record : bool
        Whether the history holds the error of every epoch of online training, too; in batch that costs nothing.
    look : Look, optional
        Who is told of the start and of each epoch, in place of `callback`.

    Returns
    -------
    Fitted

    Raises
    ------
    UsageError
        For weights, a start or a fall that do not fit.
    """
    shown = Shown.of(inputs, weights)
    codebook = _placed(shown, lattice, settings.start if start is None else start, rng)
    if look is None and callback is not None:
        look = Look(lambda codebook, done, radius, alpha: callback(codebook, done - 1) if done else None)
    watch = Watch(settings.least_move, look, record, shown.axes)
    online = settings.training == "online"
    steps = settings.iterations if online else settings.epochs
    first, last = _radii(shown, lattice, settings, pixel_area)
    radius = falling(first, last, steps, fall=radius_fall or settings.radius_fall, power=radius_power(settings))
    if online:
        rate_fall = alpha_fall or settings.alpha_fall
        alpha = falling(*settings.alpha, steps, fall=rate_fall, power=settings.alpha_power)
        watch.tell(codebook, 0, radius[0], alpha[0])
        history = train_online(codebook, shown, lattice, shape_of(settings), alpha, radius, rng, watch)
    else:
        watch.tell(codebook, 0, radius[0], 1.0)
        history = train_batch(codebook, shown, lattice, shape_of(settings), radius, watch)
    near = _without_strays(codebook, shown, settings.trim)
    if not near.all():
        refit = replace(settings, training="batch")
        narrow = np.full(REFIT_EPOCHS, _radii(shown, lattice, refit, pixel_area)[1])
        again = train_batch(codebook, shown.only(near), lattice, shape_of(refit), narrow, watch, len(history))
        history = history.then(again)
    kept = near
    if weights is not None:
        kept = np.asarray(weights) > 0
        kept[kept] = near
    return Fitted(np.ascontiguousarray(codebook[: shown.axes].T), kept, history, last)


def shape_of(settings: NetworkSettings) -> int:
    """Return the number of the neighborhood; ``"auto"`` is a bubble online and a bell in batch."""
    if settings.neighborhood == "auto":
        return BUBBLE if settings.training == "online" else GAUSSIAN
    return SHAPES[settings.neighborhood]


def _placed(
    shown: Shown, lattice: Lattice, start: str | NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return the start, (d, u)."""
    given = start if isinstance(start, str) else flat(np.asarray(start, np.float64))
    spread = shown.spread if isinstance(start, str) and start != "random" else None
    places = start_positions(shown.inputs, lattice, given, rng, weights=shown.weights, spread=spread)
    return np.array(places.T, order="C")


def radii(
    inputs: NDArray[np.float64], lattice: Lattice, settings: NetworkSettings, pixel_area: float = 1.0
) -> tuple[float, float]:
    """Return the first and the last radius, hops.

    The first is half of the farthest hop. The last is 1 for a bubble and for lateral coupling: a neuron on its own
    would fold into a band. For a bell it is `FINEST`, in batch on lines and closed surfaces `FINEST_OF_SHAPES`, and
    more where the inputs of a ring's batch are a thick band of half width h: h / s for neurons s apart. A line of
    neurons folds into the band at half of that (Ritter & Schulten 1988), and at twice that it shrinks; measured,
    h / s is best.

    Parameters
    ----------
    inputs : (n, d) float array
    lattice : Lattice
    settings : NetworkSettings
    pixel_area : float
        Area that one input stands for; 0 where inputs are no pixels.
    """
    return _radii(Shown.of(inputs, None), lattice, settings, pixel_area)


def _radii(shown: Shown, lattice: Lattice, settings: NetworkSettings, pixel_area: float) -> tuple[float, float]:
    if settings.radius is not None:
        return settings.radius
    bell = shape_of(settings) == GAUSSIAN
    shaped = lattice.name in ("chain", *CLOSED) and settings.training == "batch"
    last = (FINEST_OF_SHAPES if shaped else FINEST) if bell else 1.0
    if settings.training == "batch" and bell and lattice.name == "ring" and shown.axes == 2:
        last = max(last, min(_half_widths(shown, lattice, pixel_area), WIDEST * lattice.farthest))
    return max(lattice.farthest / 2, last), last


def _half_widths(shown: Shown, lattice: Lattice, pixel_area: float) -> float:
    """Estimate h / s of a ring from the number and the spread of its inputs."""
    length = 2 * np.pi * shown.spread[1].trace() ** 0.5
    half_width = len(shown) * pixel_area / (2 * max(length, 1e-300))
    return float(half_width * len(lattice) / max(length, 1e-300))


def _without_strays(codebook: NDArray[np.float64], shown: Shown, trim: float) -> NDArray[np.bool_]:
    """Keep the inputs that are nearer to their neuron than `trim` times the median; all where `trim` is 0."""
    if trim == 0:
        return np.ones(len(shown), bool)
    _, squared = shown.match(codebook)
    return np.asarray(squared <= trim**2 * median(squared, shown.weights))
