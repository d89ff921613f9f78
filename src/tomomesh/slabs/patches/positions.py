"""Positions of the vertices of a mesh in patches: whether any two are equal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...measure.topology import count_positions, first_equals

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .patch import Patch, Patches

    Floats = NDArray[np.float64]

ALONG = (0.0, 0.0, 1.0)
"""A direction along which the patches of axial slices follow one another. No result depends on it, only how many
vertices lie beside other patches."""


def distinct_in(patches: Patches, kind: type[np.floating[Any]] = np.float64, *, along: Sequence[float] = ALONG) -> int:
    """Count the positions that stay apart at a precision, as `tomomesh.measure.topology.distinct_positions`.

    Equal ones lie at equal heights, so only vertices at heights of other patches are brought together.
    """
    slabs, count = patches.slabs, len(patches.kept)
    ways, kinds = [tuple(along)] * count, [kind] * count
    spans = np.reshape(slabs.fetch(slabs.each(_span, patches.kept, kinds, ways)), (count, 2))
    others = [np.delete(spans, n, axis=0) for n in range(count)]
    both = [np.stack([np.maximum(o[:, 0], s[0]), np.minimum(o[:, 1], s[1])], 1) for o, s in zip(others, spans, strict=True)]
    zones = [_merged(zone[zone[:, 0] <= zone[:, 1]]) for zone in both]
    found = slabs.fetch(slabs.each(_unique, patches.kept, kinds, ways, zones))
    beside = np.concatenate([np.empty((0, 3)), *(places for _, places in found)])
    return sum(number for number, _ in found) - len(beside) + count_positions(beside)


def _places(patch: Patch, kind: type[np.floating[Any]]) -> Floats:
    with np.errstate(over="ignore"):
        return np.array(patch.kept.astype(kind, copy=False), np.float64, order="C")


def _heights(places: Floats, along: Sequence[float]) -> Floats:
    x, y, z = along
    return np.asarray(x * places[:, 0] + y * places[:, 1] + z * places[:, 2])


def _span(patch: Patch, kind: type[np.floating[Any]], along: Sequence[float]) -> tuple[float, float]:
    heights = _heights(_places(patch, kind), along)
    return float(heights.min(initial=np.inf)), float(heights.max(initial=-np.inf))


def _merged(zones: Floats) -> Floats:
    """Return the same heights as few zones (z, 2) that do not overlap."""
    zones = zones[np.argsort(zones[:, 0])]
    reached = np.maximum.accumulate(zones[:, 1]) if len(zones) else zones[:, 1]
    begins = np.flatnonzero(np.r_[True, zones[1:, 0] > reached[:-1]][: len(zones)])
    ends = np.r_[begins[1:] - 1, len(zones) - 1][: len(begins)]
    return np.stack([zones[begins, 0], reached[ends]], axis=1)


def _unique(
    patch: Patch, kind: type[np.floating[Any]], along: Sequence[float], zones: Floats
) -> tuple[int, Floats]:  # fmt: skip
    """Count the positions of a patch, and return those within zones, each once."""
    places = _places(patch, kind)
    once = first_equals(places) == np.arange(len(places))
    heights = _heights(places, along)
    zone = np.searchsorted(zones[:, 0], heights, side="right") - 1
    beside = (zone >= 0) & (heights <= np.r_[zones[:, 1], -np.inf][zone])
    return int(once.sum()), places[once & beside]
