"""How the learning rate and the radius fall, each on its own (Reyes Aldasoro 1998)."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ..errors import UsageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..settings import NetworkSettings

Fall = Callable[["NDArray[np.float64]"], "NDArray[np.float64]"]
"""From the time (t,), 0 to 1, to what is left of the fall, 1 to 0."""
LEAST_RATIO, MOST_RATIO = 1e-3, 0.999
"""Limits of last over first in exponential and inverse falls, which reach no 0, and at 1 do not fall. Chosen: half and
twice of them change no case of benchmarks/constants.py."""
SAMPLES = 1001
"""Times at which two falls are compared. Falls are monotone: what two of them differ by between is under a thousandth
of their range."""


def falling(
    first: float, last: float, steps: int, *, fall: str | Fall = "power", power: float = 1.0
) -> NDArray[np.float64]:
    """Return last + (first - last) f(t) at equal steps of t from 0 to 1.

    With q = last / first, and p the power:

        linear       f = 1 - t
        power        f = (1 - t)^p
        exponential  f = (q^t - q) / (1 - q)                 so that the value is first q^t
        inverse      f = (1 / (1 + c t) - q) / (1 - q)       so that it is first / (1 + c t), c = 1 / q - 1

    Parameters
    ----------
    first, last : float
    steps : int
    fall : {"linear", "power", "exponential", "inverse"} or callable
        A callable takes t (steps,) and returns f (steps,).
    power : float

    Raises
    ------
    UsageError
        For a fall that there is not, and for a callable that does not return finite numbers, one a step.
    """
    return np.asarray(last + (first - last) * _left(first, last, steps, fall, power))


def _left(first: float, last: float, steps: int, fall: str | Fall, power: float) -> NDArray[np.float64]:
    if not isinstance(fall, str):
        return _called(fall, steps)
    ratio = last / first if first > 0 else 1.0
    return _named(fall, steps, min(max(ratio, LEAST_RATIO), MOST_RATIO), power)


@lru_cache(maxsize=16)
def _named(fall: str, steps: int, ratio: float, power: float) -> NDArray[np.float64]:
    """Return f; kept, for every slice asks for the same."""
    if fall not in _FALLS:
        raise UsageError("there is no such fall", found=f"fall = {fall}", expected=" | ".join(_FALLS))
    return _FALLS[fall](_times(steps), ratio, power)


def _called(fall: Fall, steps: int) -> NDArray[np.float64]:
    left = np.asarray(fall(_times(steps)), np.float64)
    if left.shape != (steps,) or not np.isfinite(left).all():
        raise UsageError("a fall returns no numbers", found=f"shape = {left.shape}", expected=f"({steps},), finite")
    return left


def _times(steps: int) -> NDArray[np.float64]:
    return np.arange(steps) / max(steps - 1, 1)


_FALLS: dict[str, Callable[[NDArray[np.float64], float, float], NDArray[np.float64]]] = {
    "linear": lambda t, q, p: 1 - t,
    "power": lambda t, q, p: np.asarray((1 - t) ** p),
    "exponential": lambda t, q, p: np.asarray((q**t - q) / (1 - q)),
    "inverse": lambda t, q, p: np.asarray((1 / (1 + (1 / q - 1) * t) - q) / (1 - q)),
}


def radius_power(settings: NetworkSettings) -> float:
    """Return the power of the radius' fall: 5 online; 2 in batch, whose few epochs are to untangle a random start.

    Measured on a ring of 80 over 100 random starts and 10 epochs: a power of 5 leaves 2 tangles, 3 and 2 none, and
    with 58 neurons 3 leaves some.
    """
    if settings.radius_power is not None:
        return settings.radius_power
    return 5.0 if settings.training == "online" else 2.0


def schedule_warnings(
    settings: NetworkSettings, *, alpha_fall: Fall | None = None, radius_fall: Fall | None = None
) -> list[str]:
    """Say so where a learning rate or a radius rises, and where the rate of online training falls faster than it.

    What rises ends as it should begin: no network comes to rest. Where the rate falls faster, the network stiffens
    before its neighborhood is narrow: measured on a ring, five times the distance to the true line. The falls are
    compared by their means over time. The radius' is taken as from 10 to 1 where it follows from the network.

    Parameters
    ----------
    settings : NetworkSettings
    alpha_fall, radius_fall : callable, optional
        In place of the settings' own.

    Returns
    -------
    list of str
    """
    reach = settings.radius or (10.0, 1.0)
    rate_left = _left(*settings.alpha, SAMPLES, alpha_fall or settings.alpha_fall, settings.alpha_power)
    reach_left = _left(*reach, SAMPLES, radius_fall or settings.radius_fall, radius_power(settings))
    found = _rising("radius", reach, reach_left)
    if settings.training != "online":
        return found
    found = _rising("learning rate", settings.alpha, rate_left) + found
    if not found and rate_left.mean() < reach_left.mean() - 1e-9:
        found = ["the learning rate falls faster than the radius: the network stiffens before it has found its place"]
    return found


def _rising(name: str, ends: tuple[float, float], left: NDArray[np.float64]) -> list[str]:
    """Say so where a value is larger at the end than at the beginning."""
    first, last = (ends[1] + (ends[0] - ends[1]) * float(left[n]) for n in (0, -1))
    return [f"the {name} rises from {first:g} to {last:g}: the network comes to no rest"] if last > first else []
