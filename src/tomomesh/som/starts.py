"""Where the neurons stand before the training."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import UsageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.lattice import Lattice

    Moments = tuple[NDArray[np.float64], NDArray[np.float64]]

CLOSED = ("ring", "torus", "sphere")
"""Networks that an ellipse start lays around the inputs, in the directions that these came in."""


def start_positions(
    inputs: NDArray[np.float64],
    lattice: Lattice,
    start: str | NDArray[np.float64],
    rng: np.random.Generator,
    *,
    weights: NDArray[np.float64] | None = None,
    spread: Moments | None = None,
) -> NDArray[np.float64]:
    """Place the neurons before training, (u, d).

    Parameters
    ----------
    inputs : (n, d) float array
    lattice : Lattice
    start : {"random", "ellipse", "axes", "neighbor"} or (u, d) float array
        ``"random"`` draws inputs. ``"axes"`` lays the network at rest along the principal axes of the inputs, with
        their mean and variances. ``"ellipse"`` does the same to open networks; closed ones are stretched by the
        symmetric root of the covariance, which turns them the least: neuron k stays on the same meridian from
        slice to slice; so do those that have no ``"neighbor"``. An array is taken as it is.
    rng : Generator
    weights : (n,) float array, optional
        Of the inputs, all over 0.
    spread : pair of arrays, optional
        The `moments` of the inputs, where they are known.

    Raises
    ------
    UsageError
        For a start that there is not, or one of another shape.
    """
    u, d = len(lattice), inputs.shape[1]
    if not isinstance(start, str):
        return _given(np.asarray(start, np.float64), (u, d))
    if start == "random":
        share = None if weights is None else weights / weights.sum()
        return inputs[rng.choice(len(inputs), u, replace=len(inputs) < u, p=share)]
    if start not in ("ellipse", "axes", "neighbor"):
        raise UsageError("there is no such start", found=f"start = {start}", expected="random | ellipse | axes")
    center, covariance = spread or moments(np.ascontiguousarray(inputs.T), weights)
    variance, axes = np.linalg.eigh(covariance)
    deviation = np.sqrt(np.maximum(variance, 0.0))
    if start != "axes" and lattice.name in CLOSED:
        shared = min(lattice.places.shape[1], d)
        return np.asarray(center + lattice.places[:, :shared] @ ((axes * deviation) @ axes.T)[:shared])
    own, towards = _longest_first(lattice), np.arange(d)[::-1]
    shared = min(len(own), d)
    own, towards = own[:shared], towards[:shared]
    return np.asarray(center + (lattice.places[:, own] * deviation[towards]) @ _pointing_forward(axes[:, towards]).T)


def _given(start: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.float64]:
    if start.shape != shape or not np.isfinite(start).all():
        raise UsageError("the start does not fit", found=f"shape = {start.shape}", expected=f"{shape}, finite")
    return start


def _longest_first(lattice: Lattice) -> NDArray[np.intp]:
    """Order the coordinates of a network by its sides, the longest first; as they are where they are no sides."""
    sides = lattice.shape if len(lattice.shape) == lattice.places.shape[1] else range(lattice.places.shape[1], 0, -1)
    return np.argsort(sides)[::-1]


def _pointing_forward(axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Choose the sign of each column so that its largest component is positive."""
    largest = np.abs(axes).argmax(axis=0)
    return axes * np.where(axes[largest, np.arange(axes.shape[1])] < 0, -1.0, 1.0)


def moments(by_axis: NDArray[np.float64], weights: NDArray[np.float64] | None = None) -> Moments:
    """Return the mean (d,) and the covariance (d, d) of weighted inputs (d, n).

    Equal to those of inputs that are repeated as often as they weigh.
    """
    if weights is None:
        center = by_axis.sum(axis=1) / by_axis.shape[1]
        off = by_axis - center[:, None]
        return center, off @ off.T / by_axis.shape[1]
    share = weights / weights.sum()
    center = np.einsum("an,n->a", by_axis, share)
    off = by_axis - center[:, None]
    return center, (off * share) @ off.T
