"""The direction across a stack of contours, from the steps between neighboring points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

PATCHES, PATCH, INNER = 12, 128, 0.6
"""Places at which a cloud is looked at, how many of its points each time, and the share of their radius within which
their neighbors are all there. Chosen: half and twice of it change no case of benchmarks/constants.py."""
TILT = 0.15
"""Largest mean square of the tangents along a normal: what a noise of 0.2 sampling distances leaves. It is 1/3 where
neighbors lie in all directions. Chosen: half and twice of it change no case of benchmarks/constants.py."""
SAMPLE = 8_000
"""Points among which the places and their neighbors are found."""
FEWEST = 6
"""Points, or steps between them, that tell a plane at least. Chosen: half and twice of it change no case of
benchmarks/constants.py."""
STIR = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Odd numbers of 64 bits, which stir the bits of three coordinates into one."""


def rough_normal(local: Floats) -> tuple[Floats, float] | None:
    """Return a normal that all neighbors agree on, and the distance between them; None where there is none.

    Neighbors on a contour lie along it, so that all their differences t lie in the planes: the normal is the
    eigenvector of the least eigenvalue of the mean of t t^T.

    Parameters
    ----------
    local : (n, 3) float array
        Points about their middle; their order changes nothing.
    """
    some = some_of(local)
    places = _places(some)
    wanted = min(max(PATCH * len(some) // len(local), 4), len(some))
    radius = np.asarray(scipy.spatial.cKDTree(some).query(places, k=[wanted])[0])[:, 0]
    patches = [_around(local, place, r) for place, r in zip(places, radius, strict=True)]
    steps = np.concatenate([_steps(patch, INNER * r) for patch, r in zip(patches, radius, strict=True)])
    squared = (steps**2).sum(axis=1)
    steps, squared = steps[squared > 0], squared[squared > 0]
    if len(steps) < FEWEST:
        return None
    values, vectors = np.linalg.eigh((steps / squared[:, None]).T @ steps / len(steps))
    if values[0] >= TILT:
        return None
    return vectors[:, 0] * np.sign(vectors[np.argmax(np.abs(vectors[:, 0])), 0]), float(np.sqrt(np.median(squared)))


def some_of(local: Floats) -> Floats:
    """Return some `SAMPLE` points of a cloud, all where it has no more; which ones follows from their positions."""
    some = local[_lots(local) < SAMPLE / len(local)]
    return np.asarray(some[np.lexsort(some.T)])


def _lots(local: Floats) -> Floats:
    """Give each point a number from 0 to 1 that follows from its position: what is drawn by it suits any order."""
    if len(local) <= SAMPLE:
        return np.zeros(len(local))
    x, y, z = np.ascontiguousarray(local + 0.0).view(np.uint64).T
    drawn = x * STIR[0] ^ y * STIR[1] ^ z * STIR[2]
    drawn ^= drawn >> np.uint64(29)
    drawn *= STIR[0]
    return np.asarray((drawn >> np.uint64(11)) * 2.0**-53)


def _places(some: Floats) -> Floats:
    """Return points all over a cloud: those nearest to places thrown into its box."""
    thrown = np.random.default_rng(0).uniform(-0.5, 0.5, (PATCHES, 3)) * np.array([np.ptp(column) for column in some.T])
    return np.asarray(some[scipy.spatial.cKDTree(some).query(thrown)[1]])


def _around(local: Floats, place: Floats, radius: float) -> Floats:
    """Return the steps from a place to the points within a radius."""
    slab = np.flatnonzero(np.abs(local[:, 0] - place[0]) <= radius)
    step = local[slab] - place
    return np.asarray(step[np.einsum("ij,ij->i", step, step) <= radius**2])


def _steps(patch: Floats, radius: float) -> Floats:
    """Return the steps to the two neighbors of each point within a radius."""
    inner = patch[np.einsum("ij,ij->i", patch, patch) <= radius**2]
    near = scipy.spatial.cKDTree(patch).query(inner, k=min(3, len(patch)))[1]
    return np.asarray((patch[near.reshape(len(inner), -1)[:, 1:]] - inner[:, None]).reshape(-1, 3))


def axes_across(normal: Floats) -> Floats:
    """Return two directions across a normal, and the normal."""
    first = np.eye(3)[np.argmin(np.abs(normal))]
    first = first - normal * (first @ normal)
    first /= np.sqrt((first**2).sum())
    return np.stack([first, np.cross(normal, first), normal])


def common_normal(local: Floats, labels: NDArray[np.int64], normal: Floats) -> Floats:
    """Fit the normal of parallel planes to their points; those of label -1 lie in none."""
    taken, label = local[labels >= 0], labels[labels >= 0]
    means = np.stack([np.bincount(label, column) for column in taken.T], axis=1) / np.bincount(label)[:, None]
    centered = taken - means[label]
    fitted = np.linalg.eigh(centered.T @ centered)[1][:, 0]
    return np.asarray(fitted * np.copysign(1.0, fitted @ normal))
