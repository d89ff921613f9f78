"""Positions of the vertices of a mesh in patches: whether any two are equal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...measure.topology import count_positions, first_equals

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .patch import MeshPatch, Patches

    Floats = NDArray[np.float64]


def distinct_in(patches: Patches, kind: type[np.floating[Any]] = np.float64) -> int:
    """Count the positions that stay apart at a precision, as `tomomesh.measure.topology.distinct_positions`.

    Equal ones lie at equal heights, so only vertices at heights of other patches are brought together.
    """
    spans = np.reshape(patches.told(_span, [kind], [patches.along]), (len(patches), 2))
    zones = [zones_of(spans, one) for one in range(len(patches))]
    found = patches.told(_unique, [kind], [patches.along], zones)
    beside = np.concatenate([np.empty((0, 3)), *(places for _, places in found)])
    return int(sum(number for number, _ in found)) - len(beside) + count_positions(beside)


def zones_of(spans: Floats, one: int) -> Floats:
    """Return which heights of one span (s, 2) the others have too, as rising zones (z, 2) that do not overlap."""
    others = np.delete(spans, one, axis=0)
    low, high = np.maximum(others[:, 0], spans[one, 0]), np.minimum(others[:, 1], spans[one, 1])
    some = np.flatnonzero(low <= high)
    some = some[np.argsort(low[some], kind="stable")]
    low, reached = low[some], np.maximum.accumulate(high[some])
    begins = np.flatnonzero(np.r_[True, low[1:] > reached[:-1]][: len(low)])
    ends = np.r_[begins[1:] - 1, len(low) - 1][: len(begins)]
    return np.stack([low[begins], reached[ends]], axis=1)


def _places(patch: MeshPatch, kind: type[np.floating[Any]]) -> Floats:
    with np.errstate(over="ignore"):
        return np.array(patch.kept.astype(kind, copy=False), np.float64, order="C")


def heights_of(places: Floats, along: Sequence[float]) -> Floats:
    """Return how far positions (n, 3) lie along a direction, (n,): equal ones equally far."""
    x, y, z = along
    return np.asarray(x * places[:, 0] + y * places[:, 1] + z * places[:, 2])


def _span(patch: MeshPatch, kind: type[np.floating[Any]], along: Sequence[float]) -> tuple[float, float]:
    heights = heights_of(_places(patch, kind), along)
    return float(heights.min(initial=np.inf)), float(heights.max(initial=-np.inf))


def _unique(
    patch: MeshPatch, kind: type[np.floating[Any]], along: Sequence[float], zones: Floats
) -> tuple[int, Floats]:  # fmt: skip
    """Count the positions of a patch, and return those within zones, each once."""
    places = _places(patch, kind)
    once = first_equals(places) == np.arange(len(places))
    heights = heights_of(places, along)
    zone = np.searchsorted(zones[:, 0], heights, side="right") - 1
    beside = (zone >= 0) & (heights <= np.r_[zones[:, 1], -np.inf][zone])
    return int(once.sum()), places[once & beside]
