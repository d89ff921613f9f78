"""Tell whether a cloud is a stack of contours: curves in parallel planes that lie far apart."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from .rings import outline

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

PATCHES, PATCH, INNER = 12, 128, 0.6
"""Places at which a cloud is looked at, how many of its points each time, and the share of their radius within which
their neighbors are all there. Chosen: half and twice of it change no case of benchmarks/constants.py."""
TILT = 0.15
"""Largest mean square of the tangents along a normal: what a noise of 0.2 sampling distances leaves. It is 1/3 where
neighbors lie in all directions. Chosen: half and twice of it change no case of benchmarks/constants.py."""
APART = 2.0
"""Least distance of the slices, in sampling distances within them: the median; half as much for any two. Chosen: half
of it changes nothing, with twice of it the stack is not found."""
PARTED = 0.5
"""Heights farther apart than this, in sampling distances, are of different planes. Chosen: half and twice of it change
no case of benchmarks/constants.py."""
FEWEST, SLICES = 6, 3
"""Points that a plane has at least, and planes that a stack has. Chosen: half and twice of them change no case of
benchmarks/constants.py."""
STRAYS = 0.02
"""Share of the points that may lie in no plane. Chosen: half and twice of it change no case of benchmarks/constants.py.
"""
AROUND, CROWD, CROWDED = 3.0, 14, 0.1
"""Within so many sampling distances of a point on a curve lie some 7 points, in an area 28: a point with over `CROWD`
lies in an area, and such points are at most this share. Chosen: half and twice change nothing and no stack found
(AROUND); no stack found and nothing (CROWD); nothing and nothing (CROWDED)."""
SAMPLE, PLENTY = 8_000, 1_000
"""Points on which a cloud is judged, and points that suffice around a place. Judged on 8,000, shares that are compared
with 2 % are told to 0.2 %."""
STIR = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Odd numbers of 64 bits, which stir the bits of three coordinates into one."""
LOOKED_AT, CLOSED, SHORT = 8, 0.5, 2.0
"""Slices whose contours are looked at, the share of the points that must be on closed ones, and the longest gaps that
those may have, in local sampling distances. Chosen: half of the first changes the distance by -1.3 %,
twice by +1.2 %; with twice of the second, or half of the third, the stack is not found."""


@dataclass(frozen=True)
class Slices:
    """The planes of a stack of contours.

    Attributes
    ----------
    origin : (3,) float array
    axes : (3, 3) float array
        Two directions within the planes and their normal, right-handed: one a row.
    heights : (s,) float array
        The planes along the normal, rising, from the origin.
    labels : (n,) int32 array
        The plane of each point; -1 where it lies in none.
    spacing : float
        Distance of neighboring points within the planes.
    rings : tuple of tuples of (u, 3) float arrays
        The contours of each plane, where they are known: seen against the normal, the inside on their left.
    """

    origin: Floats
    axes: Floats
    heights: Floats
    labels: NDArray[np.int32]
    spacing: float
    rings: tuple[tuple[Floats, ...], ...] = ()

    @property
    def normal(self) -> Floats:
        """Direction across the planes, (3,)."""
        return np.asarray(self.axes[2])

    @property
    def distance(self) -> float:
        """Median distance of neighboring planes."""
        return float(np.median(np.diff(self.heights)))

    def placed(self, positions: Floats) -> Floats:
        """Carry positions (n, 3) to the two axes and the height."""
        return np.stack([((positions - self.origin) * axis).sum(axis=1) for axis in self.axes], axis=1)


def find_slices(positions: Floats) -> Slices | None:
    """Find the planes of a stack of contours, from the positions of its points alone.

    Neighbors on a contour lie along it, so that all their differences t lie in the planes: the normal is the
    eigenvector of the least eigenvalue of the mean of t t^T. What is found must then lie in few planes, on curves
    rather than areas, far closer within the planes than these are to each other, and mostly on closed contours.

    Parameters
    ----------
    positions : (n, 3) float array

    Returns
    -------
    Slices or None
        None for any other cloud.
    """
    if len(positions) < FEWEST * SLICES:
        return None
    origin = np.array([(column.min() + column.max()) / 2 for column in positions.T])
    local = positions - origin
    lots = _lots(local)
    some = local[lots < SAMPLE / len(local)]
    some = some[np.lexsort(some.T)]
    places = _places(some)
    rough = _rough_normal(local, some, places)
    if rough is None:
        return None
    normal = _refined(local, lots, places, *rough)
    if _parted(some @ normal, PARTED * rough[1], 2 if len(some) < len(local) else FEWEST) is None:
        return None
    order = np.lexsort(local.T)
    found = _planes(local[order], normal, rough[1])
    if found is None:
        return None
    labels = np.empty(len(order), np.int32)
    labels[order] = found.labels
    return replace(found, origin=origin, labels=labels)


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
    return np.asarray(some[cKDTree(some).query(thrown)[1]])


def _rough_normal(local: Floats, some: Floats, places: Floats) -> tuple[Floats, float] | None:
    """Return a normal that all neighbors agree on, and the distance between them; None where there is none."""
    wanted = min(max(PATCH * len(some) // len(local), 4), len(some))
    radius = np.asarray(cKDTree(some).query(places, k=[wanted])[0])[:, 0]
    patches = [_around(local, place, r) for place, r in zip(places, radius, strict=True)]
    steps = np.concatenate([_steps(patch, INNER * r) for patch, r in zip(patches, radius, strict=True)])
    squared = (steps**2).sum(axis=1)
    steps, squared = steps[squared > 0], squared[squared > 0]
    if len(steps) < FEWEST:
        return None
    values, vectors = np.linalg.eigh((steps / squared[:, None]).T @ steps / len(steps))
    return (vectors[:, 0], float(np.sqrt(np.median(squared)))) if values[0] < TILT else None


def _around(local: Floats, place: Floats, radius: float) -> Floats:
    """Return the steps from a place to the points within a radius."""
    slab = np.flatnonzero(np.abs(local[:, 0] - place[0]) <= radius)
    step = local[slab] - place
    return np.asarray(step[np.einsum("ij,ij->i", step, step) <= radius**2])


def _steps(patch: Floats, radius: float) -> Floats:
    """Return the steps to the two neighbors of each point within a radius."""
    inner = patch[np.einsum("ij,ij->i", patch, patch) <= radius**2]
    near = cKDTree(patch).query(inner, k=min(3, len(patch)))[1]
    return np.asarray((patch[near.reshape(len(inner), -1)[:, 1:]] - inner[:, None]).reshape(-1, 3))


def _refined(local: Floats, lots: Floats, places: Floats, normal: Floats, spacing: float) -> Floats:
    """Turn a normal until it suits ever larger parts of the planes through some points."""
    radius, widest = 4 * spacing, 4 * float(np.sqrt((local**2).sum(axis=1).max()))
    drawn = 1.0
    while radius < 2 * widest:
        total, count = np.zeros((3, 3)), 0
        for place in places:
            step = _around(local, place, radius)
            within = step[np.abs(step @ normal) < spacing]
            centered = within - within.mean(axis=0)
            total, count = total + centered.T @ centered, count + len(step)
        normal = np.linalg.eigh(total)[1][:, 0]
        radius *= 2
        if count > PLENTY * PATCHES:
            drawn *= PLENTY * PATCHES / count
            local, lots = local[lots < drawn], lots[lots < drawn]
    return np.asarray(normal * np.sign(normal[np.argmax(np.abs(normal))]))


def axes_across(normal: Floats) -> Floats:
    """Return two directions across a normal, and the normal."""
    first = np.eye(3)[np.argmin(np.abs(normal))]
    first = first - normal * (first @ normal)
    first /= np.sqrt((first**2).sum())
    return np.stack([first, np.cross(normal, first), normal])


def _planes(local: Floats, normal: Floats, spacing: float) -> Slices | None:
    """Part points by their heights; None where they are no stack of contours."""
    for _ in range(2):
        found = _parted(local @ normal, PARTED * spacing, FEWEST)
        if found is None:
            return None
        labels, normal = found, common_normal(local, found, normal)
    axes = axes_across(normal)
    placed = np.stack([(local * axis).sum(axis=1) for axis in axes], axis=1)
    heights = np.bincount(labels[labels >= 0], placed[labels >= 0, 2]) / np.bincount(labels[labels >= 0])
    gaps, looked_at = np.diff(heights), np.unique(np.linspace(0, len(heights) - 1, LOOKED_AT).astype(int))
    planar = [np.unique(placed[labels == k, :2], axis=0) for k in looked_at]
    spacing = float(np.median(np.concatenate([_second_nearest(points) for points in planar])))
    apart = np.median(gaps) >= APART * spacing and gaps.min() >= APART / 2 * spacing
    if not (apart and _curves(planar) and _mostly_closed(planar)):
        return None
    return Slices(np.zeros(3), axes, heights, labels, spacing)


def _parted(height: Floats, gap: float, fewest: int) -> NDArray[np.int32] | None:
    """Return the plane of each point by rising height, -1 for none; None where they make no stack."""
    order = np.argsort(height, kind="stable")
    group = np.empty(len(height), np.int64)
    group[order] = np.cumsum(np.diff(height[order], prepend=height[order[0]]) > gap)
    full = np.bincount(group) >= fewest
    labels = np.where(full, np.cumsum(full) - 1, -1)[group].astype(np.int32)
    return labels if full.sum() >= SLICES and np.mean(labels < 0) <= STRAYS else None


def common_normal(local: Floats, labels: NDArray[np.int32], normal: Floats) -> Floats:
    """Fit the normal of parallel planes to their points."""
    taken, label = local[labels >= 0], labels[labels >= 0]
    means = np.stack([np.bincount(label, column) for column in taken.T], axis=1) / np.bincount(label)[:, None]
    centered = taken - means[label]
    fitted = np.linalg.eigh(centered.T @ centered)[1][:, 0]
    return np.asarray(fitted * np.sign(fitted @ normal))


def _second_nearest(points: Floats) -> Floats:
    return np.asarray(cKDTree(points).query(points, k=[3])[0])[:, 0]


def _curves(planar: Sequence[Floats]) -> bool:
    """Tell whether points (n, 2) of some slices lie on curves rather than in areas."""
    around = [
        cKDTree(points).query_ball_point(points, AROUND * _second_nearest(points), return_length=True)
        for points in planar
    ]
    return bool(np.mean(np.concatenate(around) > CROWD) < CROWDED)


def _mostly_closed(planar: Sequence[Floats]) -> bool:
    """Tell whether most points of some slices are on contours that all but close by themselves."""
    found = [outline(points) for points in planar]
    holding = [len(points) for points, inside in zip(planar, found, strict=True) if 0 < inside.reach <= SHORT]
    return sum(holding) - sum(len(run) for inside in found for run in inside.open) > CLOSED * sum(map(len, planar))
