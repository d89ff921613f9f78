"""A self-organising map as an estimator, with the manners of scikit-learn, which it does not need."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..settings import NetworkSettings
from .checks import as_parameters, checked_lattice, checked_matrix, checked_weights, not_fitted, seed_of, warnings_of
from .fit import fit, match
from .inputs import area_of_each
from .measures import quantization_error
from .parameters import Parametrized
from .saving import load_network, save_network

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from ..model.lattice import Lattice
    from .fit import Callback, Fitted
    from .history import History
    from .schedules import Fall


class SOM(Parametrized):
    """Self-organising map of any topology, on inputs of any dimension d.

    Parameters
    ----------
    n_neurons : int, or (rows, columns)
        Neurons u; a sheet or a sphere has the number that it can have nearest to it. Two numbers are a `shape`.
    topology : {"grid", "hexagonal", "chain", "ring", "cylinder", "torus", "sphere", "graph"}
    shape : (rows, columns), optional
        Sides of a grid, hexagonal grid, cylinder or torus, in place of `n_neurons`.
    edges : (e, 2) array of int, optional
        The graph, where `topology` is ``"graph"``.
    training : {"batch", "online"}
    neighborhood : {"auto", "bubble", "gaussian", "lateral"}
    start : {"axes", "ellipse", "random"} or (u, d) array
    epochs : int
        Passes over the inputs; online as many presentations.
    alpha : (float, float)
        First and last learning rate, online.
    radius : (float, float), optional
        First and last radius of the neighborhood, hops.
    alpha_fall, radius_fall : {"power", "linear", "exponential", "inverse"} or callable
        A callable takes the time (t,), 0 to 1, and returns what is left of the fall, 1 to 0.
    alpha_power : float
    radius_power : float, optional
        5 online, 2 in batch where not given.
    least_move : float
        The training stops after an epoch in which no neuron moved farther.
    trim : float
        Inputs farther from their neuron than this many medians are dropped in a second fit; 0: none.
    pixel_area : float, optional
        Area that one input stands for, where the inputs of a ring fill a band; 0 where they lie on a line. Found from
        the inputs where not given.
    random_state : int, RandomState, Generator or None
        `fit` stores the seed that it comes down to.
    callback : callable, optional
        Called as ``callback(codebook, epoch)`` after each epoch.

    Attributes
    ----------
    codebook_ : (u, d) float array
    lattice_ : Lattice
    labels_ : (n,) int array
        Winner of each input of the last fit.
    quantization_error_ : float
        Mean distance of an input to its winner.
    n_iter_ : int
        Epochs that were run.
    history_ : History
    strays_ : int
        Inputs that the trimmed re-fit dropped.
    seed_ : int
    n_features_in_ : int

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh import SOM
    >>> turn = np.linspace(0, 6.28, 500)
    >>> circle = np.column_stack([np.cos(turn), np.sin(turn)])
    >>> som = SOM(20, topology="ring").fit(circle)
    >>> som.predict(circle[:1]).shape
    (1,)
    """

    codebook_: NDArray[np.float64]
    lattice_: Lattice
    history_: History
    quantization_error_: float
    labels_: NDArray[np.int64]
    n_iter_: int
    strays_: int
    seed_: int
    n_features_in_: int

    def __init__(
        self,
        n_neurons: int | tuple[int, int] = 100,
        *,
        topology: str = "grid",
        shape: tuple[int, int] | None = None,
        edges: ArrayLike | None = None,
        training: str = "batch",
        neighborhood: str = "auto",
        start: str | ArrayLike = "axes",
        epochs: int = 20,
        alpha: tuple[float, float] = (0.5, 0.01),
        radius: tuple[float, float] | None = None,
        alpha_fall: str | Fall = "power",
        radius_fall: str | Fall = "power",
        alpha_power: float = 3.0,
        radius_power: float | None = None,
        least_move: float = 0.0,
        trim: float = 0.0,
        pixel_area: float | None = None,
        random_state: Any = None,
        callback: Callback | None = None,
    ) -> None:
        self.n_neurons = n_neurons
        self.topology = topology
        self.shape = shape
        self.edges = edges
        self.training = training
        self.neighborhood = neighborhood
        self.start = start
        self.epochs = epochs
        self.alpha = alpha
        self.radius = radius
        self.alpha_fall = alpha_fall
        self.radius_fall = radius_fall
        self.alpha_power = alpha_power
        self.radius_power = radius_power
        self.least_move = least_move
        self.trim = trim
        self.pixel_area = pixel_area
        self.random_state = random_state
        self.callback = callback

    def fit(self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None) -> Self:
        """Train the network anew.

        Parameters
        ----------
        X : (n, d) array
        y : ignored
        sample_weight : (n,) array, optional
            How much each input counts.

        Raises
        ------
        ValueError
            For what is no matrix of finite numbers.
        UsageError
            For a parameter outside its limits.
        """
        inputs = checked_matrix(X, type(self).__name__)
        weights = checked_weights(sample_weight, len(inputs))
        with as_parameters():
            fitted = self._fitted(inputs, weights)
        dropped = ~fitted.kept if weights is None else ~fitted.kept & (weights > 0)
        self.history_, self.strays_ = fitted.history, int(dropped.sum())
        return self._settle(fitted.codebook, inputs, weights)

    def _fitted(self, inputs: NDArray[np.float64], weights: NDArray[np.float64] | None) -> Fitted:
        """Train; warn of what is likely not meant."""
        settings = self._settings(len(inputs))
        falls: Any = {name: f for name in ("alpha_fall", "radius_fall") if callable(f := getattr(self, name))}
        self.lattice_ = checked_lattice(self.topology, self.n_neurons, shape=self.shape, edges=self.edges)
        for warning in warnings_of(self.lattice_, None if self.shape else self.n_neurons, settings, falls):
            warnings.warn(warning, stacklevel=3)
        self.seed_ = seed_of(self.random_state)
        area = area_of_each(inputs, self.lattice_, weights) if self.pixel_area is None else self.pixel_area
        return fit(
            inputs, self.lattice_, settings, np.random.default_rng(self.seed_), pixel_area=area, weights=weights,
            start=None if isinstance(self.start, str) else np.asarray(self.start, np.float64),
            callback=self.callback, record=True, **falls,
        )  # fmt: skip

    def partial_fit(self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None) -> Self:
        """Train on: as many presentations of the new inputs as there are, at the last learning rate and radius.

        The first call is a `fit`. Parameters are those of `fit`.
        """
        if not hasattr(self, "codebook_"):
            return self.fit(X, y, sample_weight)
        inputs = self._matrix(X)
        weights = checked_weights(sample_weight, len(inputs))
        rate, reach = float(self.alpha[1]), float(self.history_.radius[-1])
        with as_parameters():
            own = self._settings(len(inputs))
        settings = replace(
            own, training="online", iterations=len(inputs), trim=0.0, alpha=(rate, rate),
            radius=(reach, reach), neighborhood="bubble" if self.neighborhood == "bubble" else "gaussian",
        )  # fmt: skip
        fitted = fit(
            inputs, self.lattice_, settings, np.random.default_rng([self.seed_, self.n_iter_]), weights=weights,
            start=self.codebook_, callback=self.callback, record=True,
        )  # fmt: skip
        self.history_ = self.history_.then(fitted.history)
        return self._settle(fitted.codebook, inputs, weights)

    def predict(self, X: ArrayLike) -> NDArray[np.int64]:
        """Return the number of each input's winner, (n,)."""
        return self._winners(self._matrix(X))

    def transform(self, X: ArrayLike) -> NDArray[np.float64]:
        """Return the distance of each input to each neuron, (n, u)."""
        from scipy.spatial.distance import cdist

        return np.asarray(cdist(self._matrix(X), self.codebook_))

    def fit_predict(self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None) -> NDArray[np.int64]:
        """Train, and return the number of each input's winner, (n,)."""
        return self.fit(X, y, sample_weight).labels_

    def fit_transform(
        self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Train, and return the distance of each input to each neuron, (n, u)."""
        return self.fit(X, y, sample_weight).transform(X)

    def score(self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None) -> float:
        """Return the quantization error of the inputs, negative: more is better."""
        inputs = self._matrix(X)
        return -quantization_error(self.codebook_, inputs, weights=checked_weights(sample_weight, len(inputs)))

    def save(self, path: str | Path) -> None:
        """Write parameters, network and history to an ``.npz`` file of plain arrays; the callback is left out.

        Raises
        ------
        UsageError
            Where a fall is a callable.
        """
        self._check_fitted()
        kept = {"n_iter_": self.n_iter_, "strays_": self.strays_, "seed_": self.seed_}
        figures = kept | {"quantization_error_": self.quantization_error_}
        arrays = {"codebook_": self.codebook_, "labels_": self.labels_}
        params = self.get_params() | {"callback": None, "random_state": self.seed_}
        save_network(path, params, figures, arrays, self.lattice_, self.history_)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a network that `save` wrote; nothing in the file is run.

        Raises
        ------
        UnreadableError, FormatError
            Where there is no such file, and where it is no saved network.
        """
        params, state = load_network(path)
        found = cls(**params)
        vars(found).update(state)
        found.n_features_in_ = found.codebook_.shape[1]
        return found

    def _settings(self, inputs: int) -> NetworkSettings:
        """Return the settings of a training on so many inputs, checked."""
        return NetworkSettings(
            training=self.training, neighborhood=self.neighborhood, epochs=self.epochs,
            iterations=max(self.epochs * inputs, 1), alpha=self.alpha, radius=self.radius,
            start=self.start if isinstance(self.start, str) else "axes", alpha_power=self.alpha_power,
            alpha_fall=self.alpha_fall if isinstance(self.alpha_fall, str) else "power",
            radius_fall=self.radius_fall if isinstance(self.radius_fall, str) else "power",
            radius_power=self.radius_power, least_move=self.least_move, trim=self.trim,
        )  # fmt: skip

    def _settle(
        self, codebook: NDArray[np.float64], inputs: NDArray[np.float64], weights: NDArray[np.float64] | None
    ) -> Self:
        """Keep a codebook, and how well it lies on its inputs."""
        self.codebook_, self.n_features_in_ = codebook, inputs.shape[1]
        self.n_iter_ = len(self.history_)
        self.labels_ = self._winners(inputs)
        self.quantization_error_ = quantization_error(codebook, inputs, weights=weights)
        return self

    def _winners(self, inputs: NDArray[np.float64]) -> NDArray[np.int64]:
        return match(self.codebook_, inputs)[0].astype(np.int64)

    def _check_fitted(self) -> None:
        if not hasattr(self, "codebook_"):
            raise not_fitted(type(self).__name__)

    def _matrix(self, X: ArrayLike) -> NDArray[np.float64]:
        self._check_fitted()
        return checked_matrix(X, type(self).__name__, features=self.n_features_in_)
