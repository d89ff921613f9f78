"""The slices and rings of points that know them: of trained rings, and of contours that somebody drew."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..measure.polygon import area, side_lengths
from ..model.points import NEURON, RING, SIDE, STRUCTURE
from .direction import FEWEST, axes_across, common_normal
from .levels import typical_gap
from .rings import holes
from .slices import ACROSS, LAYERS, PARTED, Slices

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.points import PointSet

    Floats = NDArray[np.float64]


def known_slices(points: PointSet, thickness: float | None = None) -> Slices | None:
    """Take the slices and rings of points that know them, as the neurons of ring networks do.

    Parameters
    ----------
    points : PointSet
        Of several rings in a slice, the attributes `RING` and `SIDE` tell which each point is on, and whether the
        ring is around the inside or around a hole; without `SIDE`, rings within an odd number of others are holes.
    thickness : float, optional
        How thick contours on one slice are; without, these are no slices.

    Returns
    -------
    Slices or None
        None where the points do not know, or where their slices are not parallel planes.
    """
    neuron = (points.slices >= 0) & (points.neurons >= 0) & (points.kinds == NEURON)
    ring = np.asarray(points.attributes.get(RING, np.zeros(len(points), np.int64)))
    order = np.lexsort((points.neurons, ring, points.slices))
    order = order[neuron[order]]
    numbers = np.unique(points.slices[neuron])
    grouped = _grouped(order, points.slices, ring)
    if len(numbers) < (2 if thickness is None else 1) or min(map(len, grouped)) < FEWEST:
        return None
    rings = [points.positions[one] for one in grouped]
    origin = np.mean([corner for one in rings for corner in (one.min(axis=0), one.max(axis=0))], axis=0)
    labels = np.where(neuron, np.searchsorted(numbers, points.slices), -1).astype(np.int64)
    local = points.positions - origin
    normal = common_normal(local[order], labels[order], rings[-1].mean(axis=0) - rings[0].mean(axis=0))
    height = local @ normal
    structure = points.attributes.get(STRUCTURE)
    groups = np.zeros(len(numbers), np.int64)
    if structure is not None:
        groups[labels[order]] = structure[order]
    levels = np.bincount(labels[order], height[order]) / np.bincount(labels[order])
    rank = np.lexsort((levels, groups))
    labels = np.where(neuron, np.argsort(rank)[labels], -1)
    heights, groups = levels[rank], groups[rank]
    width = max(float(np.ptp(one, axis=0).max()) for one in rings)
    gap = max(typical_gap(heights[groups == one], width) for one in np.unique(groups)) or (thickness or 0.0) / LAYERS
    if max(float(np.ptp(height[one])) for one in grouped) > 2 * PARTED * gap or gap <= 0:
        return None
    sides = np.concatenate([side_lengths(one) for one in rings])
    spacing = min(float(np.median(sides)), gap, *([width / ACROSS] if len(heights) == 1 else []))
    found = Slices(origin, axes_across(normal), heights, groups, labels, spacing, complete=structure is None)
    return replace(found, rings=_oriented(points, grouped, found))


def _grouped(order: NDArray[np.int64], slices: NDArray[np.int32], ring: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Split points in order where the slice or the ring changes."""
    changes = (np.diff(slices[order]) != 0) | (np.diff(ring[order]) != 0)
    return np.split(order, np.flatnonzero(changes) + 1)


def _oriented(points: PointSet, grouped: list[NDArray[np.int64]], found: Slices) -> tuple[tuple[Floats, ...], ...]:
    """Gather the rings of each plane, each turned so that the inside is on its left."""
    planes: list[list[NDArray[np.int64]]] = [[] for _ in found.heights]
    for one in grouped:
        planes[found.labels[one[0]]].append(one)
    return tuple(tuple(points.positions[one] for one in _turned(points, plane, found)) for plane in planes)


def _turned(points: PointSet, plane: list[NDArray[np.int64]], found: Slices) -> list[NDArray[np.int64]]:
    """Turn the rings of a plane around the inside; where they do not know their side, every second one is a hole."""
    curves = [found.placed(points.positions[one])[:, :2] for one in plane]
    side = points.attributes.get(SIDE)
    around = holes(curves) if side is None else [bool(side[one[0]] % 2) for one in plane]
    forward = [area(curve) > 0 for curve in curves]
    return [one if f != hole else one[::-1] for one, f, hole in zip(plane, forward, around, strict=True)]
