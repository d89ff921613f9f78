"""What an estimator takes and refuses, in the words that scikit-learn's own use."""

from __future__ import annotations

import re
import sys
from contextlib import contextmanager
from operator import index
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from ..kernels.som.online import INDEX_BITS
from ..model.graph import lattice_of
from ..model.lattice import lattice, other_number
from .schedules import schedule_warnings

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import ArrayLike, NDArray

    from ..model.lattice import Lattice
    from ..settings import NetworkSettings
    from .schedules import Fall

PARAMETERS = {"neurons": "n_neurons", "network": "topology", "iterations": "epochs"}
"""Options of the command line that the estimator calls otherwise."""


@contextmanager
def as_parameters() -> Iterator[None]:
    """Name parameters in what is raised, and no options: who trains a network in Python has none."""
    try:
        yield
    except UsageError as error:
        named = re.sub(r"--([a-z]+(?:-[a-z]+)*)", lambda found: _parameter(found[1]), str(error))
        error.args = (named,)
        raise


def _parameter(option: str) -> str:
    return PARAMETERS.get(option, option.replace("-", "_"))


def checked_matrix(X: ArrayLike, estimator: str, *, features: int | None = None) -> NDArray[np.float64]:
    """Return inputs (n, d) as floats.

    Raises
    ------
    TypeError, ValueError
        For what is no matrix of finite real numbers with a sample and a feature at least, or has other than
        `features` columns.
    """
    if hasattr(X, "toarray"):
        raise TypeError("Sparse data was passed, but dense data is required: convert it with X.toarray().")
    found = np.asarray(X)
    if np.iscomplexobj(found):
        raise ValueError("Complex data not supported: found an array of complex numbers.")
    found = np.asarray(found, np.float64)
    if found.ndim != 2:
        raise ValueError(f"Expected 2D array, got {found.ndim}D array instead. Reshape your data to (n, d).")
    for count, what in zip(found.shape, ("sample", "feature"), strict=True):
        if count < 1:
            raise ValueError(f"Found array with 0 {what}(s) (shape={found.shape}) while a minimum of 1 is required.")
    if not np.isfinite(found).all():
        raise ValueError(f"Input X contains NaN or infinity: {estimator} takes finite numbers alone.")
    if features is not None and found.shape[1] != features:
        raise ValueError(f"X has {found.shape[1]} features, but {estimator} is expecting {features} features as input.")
    return found


def checked_weights(sample_weight: ArrayLike | None, samples: int) -> NDArray[np.float64] | None:
    """Return weights (n,), or None where all inputs count alike.

    Raises
    ------
    ValueError
        For what is no such weights.
    """
    if sample_weight is None:
        return None
    weights = np.asarray(sample_weight, np.float64)
    weights = np.full(samples, weights) if weights.ndim == 0 else weights
    if weights.shape != (samples,):
        raise ValueError(f"Sample weights must be 1D and one a sample: found {weights.shape}, wanted ({samples},).")
    if not np.isfinite(weights).all() or (weights < 0).any() or not weights.any():
        raise ValueError("Sample weights must be finite, none negative, and not all zero.")
    return weights


def checked_lattice(
    topology: str, neurons: int | tuple[int, int], *, shape: tuple[int, int] | None, edges: ArrayLike | None
) -> Lattice:
    """Return the network of a topology, or of a graph's edges (e, 2); two numbers of neurons are a shape.

    Raises
    ------
    UsageError
        Where edges are given to another topology, the neurons are no number, or there are too many.
    """
    neurons, shape = _counted(neurons, shape)
    if topology == "graph":
        found = lattice_of(np.empty((0, 2), int) if edges is None else edges, neurons)
    elif edges is not None:
        raise UsageError("edges are a graph's", found=f"topology = {topology}", expected="graph")
    else:
        found = lattice(topology, neurons, shape=shape)
    if len(found) > INDEX_BITS:
        raise UsageError("the network is too large", found=f"{len(found)} neurons", expected=f"{INDEX_BITS}")
    return found


def warnings_of(
    lattice: Lattice, asked: int | tuple[int, int] | None, settings: NetworkSettings, falls: Mapping[str, Fall]
) -> list[str]:
    """Return what to be warned of: falls that rise, and another number of neurons than was asked for."""
    other = other_number(lattice, asked) if isinstance(asked, int) else None
    cure = "" if lattice.name == "sphere" else " (shape sets the sides)"
    return [*schedule_warnings(settings, **falls), *([other + cure] if other else [])]


def _counted(neurons: Any, shape: Any) -> tuple[int, tuple[int, int] | None]:
    """Return a number of neurons, and a shape where there is one."""
    if np.ndim(neurons) and shape is not None:
        raise UsageError("two shapes are asked for", found=f"n_neurons = {neurons}, shape = {shape}", expected="one")
    sides = shape if np.ndim(neurons) == 0 else neurons
    try:
        if sides is None:
            return index(neurons), None
        rows, columns = map(index, sides)
    except (TypeError, ValueError):
        found = f"n_neurons = {neurons!r}" if sides is None else f"shape = {sides!r}"
        raise UsageError("neurons are counted", found=found, expected="a whole number, or two as shape") from None
    return rows * columns, (rows, columns)


def seed_of(random_state: Any) -> int:
    """Return the seed that a random state comes down to: itself, or one drawn from it, or from the system."""
    if random_state is None:
        return int(np.random.default_rng().integers(2**32))
    if isinstance(random_state, np.random.Generator):
        return int(random_state.integers(2**32))
    if isinstance(random_state, np.random.RandomState):
        return int(random_state.randint(2**31 - 1))
    return int(random_state)


class NotFittedError(ValueError, AttributeError):
    """The estimator was not fitted before."""


def not_fitted(estimator: str) -> Exception:
    """Return scikit-learn's own error where that is at work, so that its tools know it."""
    theirs = sys.modules.get("sklearn.exceptions")
    kind: type[Exception] = NotFittedError if theirs is None else theirs.NotFittedError
    return kind(f"This {estimator} instance is not fitted yet. Call 'fit' first.")
