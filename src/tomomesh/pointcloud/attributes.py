"""From the points to the vertices: colors, intensities and whatever else is known of the points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from ..model.points import COLORS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.points import PointSet

NEAREST = 3
"""Points whose values are mixed at a vertex. The corners of a triangle of points."""

MIXED = (*COLORS, "alpha")
"""Integers that may be mixed as if they were floats; all others are labels or counts."""


def carry(points: PointSet, vertices: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """Give every vertex the attributes of the points about it.

    Floats and colors are the mean of the three nearest points, weighted by their inverse distances (Shepard 1968);
    what is not finite counts for nothing. Other integers are those of the nearest point. Points at one position
    count as one, with the mean of their floats and colors, and the lower median of their other integers, which is
    the majority where there is one. The order of the points changes nothing.

    Parameters
    ----------
    points : PointSet
        At least one.
    vertices : (n, 3) float array
        In the unit of the points.

    Returns
    -------
    dict of str to (n,) or (n, c) array
        Under the names and in the types of the points' attributes.
    """
    if not points.attributes:
        return {}
    # in lexicographic order: neither the tree nor a sum can depend on the order of the points
    positions, owner = np.unique(points.positions + 0.0, axis=0, return_inverse=True)
    found = scipy.spatial.cKDTree(positions).query(vertices, k=list(range(1, min(NEAREST, len(positions)) + 1)))
    distance, near = (np.asarray(one) for one in found)
    weights = np.divide(distance[:, :1], distance, out=np.ones_like(distance), where=distance > 0)
    carried: dict[str, NDArray[Any]] = {}
    for name, values in points.attributes.items():
        one = _mixed if values.dtype.kind == "f" or name in MIXED else _nearest
        columns = [one(column, owner.ravel(), near, weights) for column in values.reshape(len(values), -1).T]
        carried[name] = np.stack(columns, axis=1).reshape(-1, *values.shape[1:])
    return carried


def _nearest(
    column: NDArray[Any], owner: NDArray[np.int64], near: NDArray[np.int64], weights: NDArray[np.float64]
) -> NDArray[Any]:
    """Take the nearest position's value; of several there, the lower median."""
    ordered, starts = _runs(column, owner)
    sizes = np.diff(starts, append=len(ordered))
    return np.asarray(ordered[starts + (sizes - 1) // 2][near[:, 0]])


def _mixed(
    column: NDArray[Any], owner: NDArray[np.int64], near: NDArray[np.int64], weights: NDArray[np.float64]
) -> NDArray[Any]:
    """Take the weighted mean of the nearest positions, each with the mean of its values."""
    ordered, starts = _runs(column, owner)
    with np.errstate(invalid="ignore"):  # a NaN may have any bits
        ordered = ordered.astype(np.float64)
    values = _means(ordered, np.ones(len(ordered)), starts)[near]
    mixed = _means(values.ravel(), weights.ravel(), np.arange(0, values.size, values.shape[1]))
    return (mixed if column.dtype.kind == "f" else np.rint(mixed)).astype(column.dtype)


def _runs(column: NDArray[Any], owner: NDArray[np.int64]) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Return the values position by position, rising at each, and where each position's begin."""
    order = np.lexsort((column, owner))
    return column[order], np.flatnonzero(np.diff(owner[order], prepend=-1))


def _means(values: NDArray[np.float64], weights: NDArray[np.float64], starts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the weighted means of runs of values, as if those not finite were not there; NaN where none is."""
    known = np.isfinite(values)
    masked = np.where(known, values, np.nan)
    with np.errstate(invalid="ignore", over="ignore"):
        total = np.add.reduceat(np.where(known, weights * values, 0.0), starts)
        mean = total / np.add.reduceat(np.where(known, weights, 0.0), starts)
    # within the values, so that rounding leaves a constant as it is
    return np.clip(mean, np.fmin.reduceat(masked, starts), np.fmax.reduceat(masked, starts))
