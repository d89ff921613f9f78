"""What a step hands on: a value, what it found, and what a reader of the result must know."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import wraps
from typing import Any, Generic, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")
U = TypeVar("U")

Stats = Mapping[str, Mapping[str, Any]]
"""Section of the report to its keys; docs/report.md has them all."""


@dataclass(frozen=True)
class Stage(Generic[T]):
    """The result of a step, and what is to be told of it.

    Nothing here steers a later step: that reads `value` alone.

    Attributes
    ----------
    value : object
    stats : mapping
        Sections of the report, each with its keys.
    warnings : tuple of str
    seconds : mapping
        Name of a step to how long it took.
    """

    value: T
    stats: Stats = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)


Later = Callable[[], Stage[Any]]
"""A stage that is made once somebody asks for the report."""


def timed(name: str) -> Callable[[Callable[P, Stage[T]]], Callable[P, Stage[T]]]:
    """Have the stage of a function say how long it took.

    Examples
    --------
    >>> @timed("sum")
    ... def total(numbers):
    ...     return Stage(sum(numbers), {"sum": {"count": len(numbers)}})
    >>> made = total([1, 2, 3])
    >>> made.value, list(made.seconds)
    (6, ['sum'])
    """

    def decorate(step: Callable[P, Stage[T]]) -> Callable[P, Stage[T]]:
        @wraps(step)
        def clocked(*args: P.args, **kwargs: P.kwargs) -> Stage[T]:
            start = time.perf_counter()
            made = step(*args, **kwargs)
            return replace(made, seconds=_added(made.seconds, {name: time.perf_counter() - start}))

        return clocked

    return decorate


def measured(name: str, step: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Stage[T]:
    """Take a step that has nothing to tell but how long it took.

    Examples
    --------
    >>> made = measured("sum", sum, [1, 2, 3])
    >>> made.value, list(made.seconds)
    (6, ['sum'])
    """
    return timed(name)(lambda: Stage(step(*args, **kwargs)))()


def folded(value: U, *stages: Stage[Any]) -> Stage[U]:
    """Return a value as the result of several stages, in whose order keys, warnings and times are told.

    Examples
    --------
    >>> both = folded("mesh", Stage(1, {"fit": {"steps": 3}}, ("rough",)), Stage(2, {"fit": {"filled": 0}}))
    >>> both.value, both.stats, both.warnings
    ('mesh', {'fit': {'steps': 3, 'filled': 0}}, ('rough',))
    """
    stats: dict[str, dict[str, Any]] = {}
    seconds: Mapping[str, float] = {}
    for stage in stages:
        for section, keys in stage.stats.items():
            stats.setdefault(section, {}).update(keys)
        seconds = _added(seconds, stage.seconds)
    return Stage(value, stats, tuple(warning for stage in stages for warning in stage.warnings), seconds)


def _added(one: Mapping[str, float], other: Mapping[str, float]) -> dict[str, float]:
    return {**one, **{name: one.get(name, 0.0) + spent for name, spent in other.items()}}
