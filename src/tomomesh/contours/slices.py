"""Tell whether a cloud is a stack of contours: curves in parallel planes that lie far apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from .direction import FEWEST, axes_across, common_normal, rough_normal
from .levels import columns_of, planes_within, typical_gap
from .rings import outline

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

APART = 2.0
"""Least distance of the slices, in sampling distances within them. Chosen: half of it changes nothing, with twice of it
the stack is not found."""
PARTED = 0.5
"""Neighbors whose heights differ by more than this, in sampling distances, are of different planes. Chosen: half and
twice of it change no case of benchmarks/constants.py."""
NEIGHBORS, LINKED = 8, 3.0
"""Neighbors that a point is joined with to contours, and the farthest of them, in local sampling distances."""
OFF_PLANE = 0.25
"""Most that points may be off their planes (root mean square), in distances of the slices: half of the way to where
they would lie nearer to others."""
SLICES = 3
"""Sliced that a stack has at least. Chosen: half and twice of it change no case of benchmarks/constants.py."""
STRAYS = 0.02
"""Share of the points that may lie in no plane. Chosen: half and twice of it change no case of benchmarks/constants.py.
"""
AROUND, CROWD, CROWDED = 3.0, 14, 0.1
"""Within so many sampling distances of a point on a curve lie some 7 points, in an area 28: a point with over `CROWD`
lies in an area, and such points are at most this share. Chosen: half and twice change nothing and no stack found
(AROUND); no stack found and nothing (CROWD); nothing and nothing (CROWDED)."""
LOOKED_AT, CLOSED, SHORT = 8, 0.5, 2.0
"""Slices whose contours are looked at, the share of the points that must be on closed ones, and the longest gaps that
those may have, in local sampling distances. Chosen: half of the first changes the distance by -1.3 %,
twice by +1.2 %; with twice of the second, or half of the third, the stack is not found."""


LAYERS = 4
"""Voxels that a slice alone is thick at least. Chosen: half of it rounds the edges of a slab off, twice of it takes
eight times the memory."""
ACROSS = 16
"""Voxels that a slice alone is wide at least, where it is thick and has few points. Chosen: of a square 20 wide and 30
thick 0.0 % of the volume is missing, with half of it 2.9 %, without it 5.9 %; with twice of it there is 0.7 % more."""


@dataclass(frozen=True)
class Slices:
    """The planes of a stack of contours.

    Attributes
    ----------
    origin : (3,) float array
    axes : (3, 3) float array
        Two directions within the planes and their normal, right-handed: one a row.
    heights : (s,) float array
        The planes along the normal, from the origin, rising within each group.
    groups : (s,) int64 array
        What the planes are of: contours of different groups have nothing to do with each other. Rising.
    labels : (n,) int64 array
        The plane of each point; -1 where it lies in none.
    spacing : float
        Distance of neighboring points within the planes.
    rings : tuple of tuples of (u, 3) float arrays
        The contours of each plane, where they are known: seen against the normal, the inside on their left.
    complete : bool
        Whether every plane between two was looked at all over: what is not there ends, and was not left out.
    sparse : bool
        Whether nothing was looked at between two planes, however far apart they are.
    """

    origin: Floats
    axes: Floats
    heights: Floats
    groups: NDArray[np.int64]
    labels: NDArray[np.int64]
    spacing: float
    rings: tuple[tuple[Floats, ...], ...] = ()
    complete: bool = False
    sparse: bool = False

    @property
    def normal(self) -> Floats:
        """Direction across the planes, (3,)."""
        return np.asarray(self.axes[2])

    def placed(self, positions: Floats) -> Floats:
        """Carry positions (n, 3) to the two axes and the height."""
        return np.stack([((positions - self.origin) * axis).sum(axis=1) for axis in self.axes], axis=1)


def find_slices(positions: Floats) -> Slices | None:
    """Find the planes of a stack of contours, from the positions of its points alone.

    Points are joined to contours with neighbors of their own height, which gives the normal of all of them and the
    height of each. Sliced are then sought within each column of contours that lie over one another
    (`tomomesh.contours.levels`). The points must lie near these planes, on curves rather than areas, far closer within
    the planes than these are to each other, and mostly on closed contours.

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
    rough = rough_normal(positions - origin)
    if rough is None:
        return None
    local, named = np.unique(positions - origin, axis=0, return_inverse=True)
    contour, spacing = _joined(local, *rough)
    axes = axes_across(common_normal(local, contour, rough[0]))
    placed = np.stack([(local * axis).sum(axis=1) for axis in axes], axis=1)
    found = _planes(placed, contour, spacing)
    if found is None:
        return None
    labels, groups = found
    heights = np.bincount(labels[labels >= 0], placed[labels >= 0, 2]) / np.bincount(labels[labels >= 0])
    return Slices(origin, axes, heights, groups, labels[named.reshape(-1)], spacing)


def one_slice(positions: Floats, thickness: float) -> Slices | None:
    """Take points in one plane as a slice of a thickness; None where they are in none."""
    if len(positions) < FEWEST:
        return None
    origin = np.array([(column.min() + column.max()) / 2 for column in positions.T])
    local = positions[np.lexsort(positions.T)] - origin
    normal = common_normal(local, np.zeros(len(local), np.int64), np.ones(3))
    height = (positions - origin) @ normal
    distinct = np.unique(local, axis=0)
    if np.ptp(height) > thickness or len(distinct) < FEWEST:
        return None
    apart = float(np.median(scipy.spatial.cKDTree(distinct).query(distinct, k=[2])[0]))
    alone = np.zeros(1, np.int64)
    return Slices(
        origin, axes_across(normal), np.array([height.mean()]), alone, np.zeros(len(positions), np.int64),
        min(apart, thickness / LAYERS, float(np.ptp(local, axis=0).max()) / ACROSS),
    )  # fmt: skip


def _joined(local: Floats, normal: Floats, spacing: float) -> tuple[NDArray[np.int64], float]:
    """Join points with near neighbors of their own height; return the contour of each, and the sampling distance."""
    height = local @ normal
    away, near = map(np.asarray, scipy.spatial.cKDTree(local).query(local, k=min(NEIGHBORS + 1, len(local))))
    reach = away[:, 2]
    one = np.broadcast_to(np.arange(len(local))[:, None], near.shape)
    level = np.abs(height[near] - height[one]) <= PARTED * np.maximum(reach[near], reach[one]).clip(max=spacing)
    linked = level & (away <= LINKED * np.maximum(reach[near], reach[one]))
    ends = one[linked], near[linked]
    links = scipy.sparse.coo_array((np.ones(len(ends[0])), ends), shape=(len(local),) * 2)
    return scipy.sparse.csgraph.connected_components(links, directed=False)[1].astype(np.int64), float(np.median(reach))


def _planes(
    placed: Floats, contour: NDArray[np.int64], spacing: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Return the plane of each point, -1 for none, and the group of each plane; None where they make no stack."""
    count = np.bincount(contour)
    low, high = np.full((len(count), 2), np.inf), np.full((len(count), 2), -np.inf)
    np.minimum.at(low, contour, placed[:, :2])
    np.maximum.at(high, contour, placed[:, :2])
    height = np.bincount(contour, placed[:, 2]) / count
    column = columns_of(low, high)
    width = (high - low).max(axis=1)
    plane = planes_within(height, column, width)
    full = np.bincount(plane, count) >= FEWEST
    labels = np.where(full, np.cumsum(full) - 1, -1)[plane][contour]
    group = np.zeros(len(full), np.int64)
    group[plane] = column
    return (labels, group[full]) if _are_stack(placed, labels, group[full], spacing, float(width.max())) else None


def _are_stack(
    placed: Floats, labels: NDArray[np.int64], groups: NDArray[np.int64], spacing: float, width: float
) -> bool:
    """Tell whether points in planes are contours: near them, far apart, on curves, and closed."""
    if np.bincount(groups, minlength=1).max() < SLICES or np.mean(labels < 0) > STRAYS:
        return False
    taken, label = placed[labels >= 0], labels[labels >= 0]
    heights = np.bincount(label, taken[:, 2]) / np.bincount(label)
    gaps = np.array([typical_gap(heights[groups == one], width) for one in range(groups.max() + 1)])[groups][label]
    gap = np.median(gaps[gaps > 0])
    looked_at = np.unique(np.linspace(0, len(heights) - 1, LOOKED_AT).astype(int))
    planar = [np.unique(taken[label == k, :2], axis=0) for k in looked_at]
    near = np.sqrt(np.mean((taken[:, 2] - heights[label]) ** 2)) <= OFF_PLANE * gap
    return bool(near and gap >= APART * spacing and _curves(planar) and _mostly_closed(planar))


def _second_nearest(points: Floats) -> Floats:
    return np.asarray(scipy.spatial.cKDTree(points).query(points, k=[3])[0])[:, 0]


def _curves(planar: Sequence[Floats]) -> bool:
    """Tell whether points (n, 2) of some slices lie on curves rather than in areas."""
    around = [
        scipy.spatial.cKDTree(points).query_ball_point(points, AROUND * _second_nearest(points), return_length=True)
        for points in planar
    ]
    return bool(np.mean(np.concatenate(around) > CROWD) < CROWDED)


def _mostly_closed(planar: Sequence[Floats]) -> bool:
    """Tell whether most points of some slices are on contours that all but close by themselves."""
    found = [outline(points) for points in planar]
    holding = [len(points) for points, inside in zip(planar, found, strict=True) if 0 < inside.reach <= SHORT]
    return sum(holding) - sum(len(run) for inside in found for run in inside.open) > CLOSED * sum(map(len, planar))
