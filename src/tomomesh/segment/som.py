"""Train one self-organising map on one set of inputs (eq. 1, 2)."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ..kernels import som as kernels
from .signal import moments

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.lattice import Lattice
    from ..settings import NetworkSettings

FINEST_RADIUS = 0.65
"""Last radius of the batch map on a thin line, hops: measured best at 58 to 200 neurons."""
REFIT_EPOCHS = 5
"""Batch passes after stray inputs are dropped."""


def train(
    inputs: NDArray[np.float64],
    lattice: Lattice,
    settings: NetworkSettings,
    rng: np.random.Generator,
    *,
    pixel_area: float = 1.0,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
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

    Returns
    -------
    codebook : (u, d) float array
    kept : (n,) bool array
        False for the stray inputs that the trimmed re-fit dropped.
    """
    codebook = np.ascontiguousarray(start_positions(inputs, lattice, settings.start, rng).T)
    by_axis = np.ascontiguousarray(inputs.T)
    first, last = radii(inputs, lattice, settings, pixel_area)
    if settings.training == "online":
        _train_online(codebook, inputs, lattice, settings, (first, last), rng)
    else:
        sigmas = last + (first - last) * _falling(settings.epochs, settings.radius_power)
        _train_batch(codebook, by_axis, lattice, settings, sigmas)
    kept = _without_strays(codebook, by_axis, settings.trim)
    if not kept.all():
        narrow = np.full(REFIT_EPOCHS, last)
        _train_batch(codebook, np.ascontiguousarray(by_axis[:, kept]), lattice, settings, narrow)
    return np.ascontiguousarray(codebook.T), kept


def start_positions(
    inputs: NDArray[np.float64], lattice: Lattice, start: str, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Place the neurons before training, (u, d).

    ``"random"`` draws inputs. ``"ellipse"`` lays the lattice on the ellipse (ring), the longest axis (chain) or
    the plane of the two longest axes (grid) of the inputs. A ring starts at the first axis and turns with the
    symmetric root of the covariance, so that neuron k stays on the same meridian from slice to slice.
    """
    u = len(lattice)
    if start == "random":
        return inputs[rng.choice(len(inputs), u, replace=len(inputs) < u)]
    center, covariance = moments(inputs)
    variance, axes = np.linalg.eigh(covariance)
    spread = np.sqrt(np.maximum(variance, 0.0))
    if lattice.name == "ring":
        angle = 2 * np.pi * np.arange(u) / u
        plane = np.zeros((u, inputs.shape[1]))
        plane[:, 0], plane[:, 1] = np.cos(angle), np.sin(angle)
        return np.asarray(center + np.sqrt(2) * plane @ (axes * spread) @ axes.T)
    sides = [np.linspace(-1, 1, side) if side > 1 else np.zeros(1) for side in lattice.shape]
    coordinates = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(u, -1)
    longest = np.argsort(lattice.shape) + inputs.shape[1] - len(lattice.shape)
    towards = _pointing_forward(axes[:, longest])
    return np.asarray(center + np.sqrt(3) * (coordinates * spread[longest]) @ towards.T)


def _pointing_forward(axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Choose the sign of each column so that its largest component is positive."""
    largest = np.abs(axes).argmax(axis=0)
    return axes * np.where(axes[largest, np.arange(axes.shape[1])] < 0, -1.0, 1.0)


def radii(
    inputs: NDArray[np.float64], lattice: Lattice, settings: NetworkSettings, pixel_area: float = 1.0
) -> tuple[float, float]:
    """Return the first and the last radius, hops.

    The first is half of the farthest hop. Online, the last is 1. In batch it is `FINEST_RADIUS`, and more where
    the inputs are a thick band of half width h: h / s for neurons s apart. A line of neurons folds into the
    band at half of that (Ritter & Schulten 1988), and at twice that it shrinks; measured, h / s is best.
    """
    if settings.radius is not None:
        return settings.radius
    first = lattice.hops.max() / 2
    if settings.training == "online":
        return first, 1.0
    return max(first, FINEST_RADIUS), max(FINEST_RADIUS, _half_widths(inputs, lattice, pixel_area))


def _half_widths(inputs: NDArray[np.float64], lattice: Lattice, pixel_area: float) -> float:
    """Estimate h / s of a ring from the number and the spread of its inputs."""
    if lattice.name != "ring" or inputs.shape[1] != 2:
        return 0.0
    length = 2 * np.pi * np.sqrt(np.trace(moments(inputs)[1]))
    half_width = len(inputs) * pixel_area / (2 * length)
    return float(half_width * len(lattice) / length)


@lru_cache(maxsize=8)
def _falling(steps: int, power: float) -> NDArray[np.float64]:
    """Fall from 1 to 0 as (1 - t)^power (Reyes Aldasoro 1998); kept, for every slice asks for the same."""
    return np.asarray((1 - np.arange(steps) / max(steps - 1, 1)) ** power)


def _train_online(
    codebook: NDArray[np.float64],
    inputs: NDArray[np.float64],
    lattice: Lattice,
    settings: NetworkSettings,
    radii: tuple[float, float],
    rng: np.random.Generator,
) -> None:
    shown = inputs[rng.integers(len(inputs), size=settings.iterations)]
    alpha = settings.alpha[1] + (settings.alpha[0] - settings.alpha[1]) * _falling(len(shown), settings.alpha_power)
    radius = radii[1] + (radii[0] - radii[1]) * _falling(len(shown), settings.radius_power)
    gaussian = settings.neighborhood == "gaussian"
    kernels.train_online(codebook, shown, lattice.hops, lattice.nearest_first, lattice.within, alpha, radius, gaussian)


def _train_batch(
    codebook: NDArray[np.float64],
    by_axis: NDArray[np.float64],
    lattice: Lattice,
    settings: NetworkSettings,
    radius: NDArray[np.float64],
) -> None:
    hop, reach = np.arange(lattice.hops.max() + 1), radius[:, None]
    if settings.neighborhood == "bubble":
        weights = (hop <= reach) * 1.0
    else:
        weights = np.exp(-0.5 * (hop / np.maximum(reach, 1e-6)) ** 2)
    kernels.train_batch(codebook, by_axis, lattice.hops, weights.astype(np.float64))


def _without_strays(codebook: NDArray[np.float64], by_axis: NDArray[np.float64], trim: float) -> NDArray[np.bool_]:
    """Keep the inputs that are nearer to their neuron than `trim` times the median; all where `trim` is 0."""
    if trim == 0:
        return np.ones(by_axis.shape[1], bool)
    _, squared = match(codebook, by_axis)
    return np.asarray(squared <= trim**2 * np.median(squared))


def match(codebook: NDArray[np.float64], by_axis: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return the winner of each input and the squared distance to it (eq. 1); arrays are (d, u) and (d, n).

    In single precision, relative to the first neuron.
    """
    first = codebook[:, :1]
    winners, squared = np.empty(by_axis.shape[1], np.int32), np.empty(by_axis.shape[1], np.float32)
    near_codebook, near_inputs = (np.ascontiguousarray(places - first, np.float32) for places in (codebook, by_axis))
    kernels.best_matching_units(near_codebook, near_inputs, winners, squared)
    return winners, squared
