"""Points -> samples of a surface: what lies under noise, and which way it faces.

From positions alone: how far apart the points are, how noisy, which ones are strays; and each point moved onto the
surface that its neighbors describe, with a normal there of either sign.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..cuberille.partition import sampling_distance
from ..kernels.pointcloud.samples import fit_planes, settle
from ..kernels.pointcloud.spacing import find_lonely, local_spacing, region_medians
from ..kernels.threads import in_blocks
from ..model.columns import any_of
from ..progress import Progress, silent
from .search import Index

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

BLOCK = 4_096
"""Points worked on in one call: below 100 ms."""
SIGHT = 2.25
"""Radius, in sampling distances, within which neighbors are counted: about 16 of them."""
REGION = 12
"""Edge of the cubes over which spacing and noise are taken as even, sampling distances."""
REGIONS = 64
"""Of these cubes, those worked on in one call."""
FEW = 8
"""Points under which a region has no say of its own."""
LEAST, MOST = 0.7, 3.4
"""Width of the quadratics where the points are exact and where they are noisy, sampling distances."""
NOISY = 0.6
"""Noise, in sampling distances, from which the greatest width is taken."""
POWER = 0.8
"""Power of the noise with which the width grows: it balances what noise and curvature do to a quadratic."""
FIRST = 0.8
"""Width of the first planes, sampling distances."""
WIDER = 1.25
"""Growth of the width for which planes are fitted anew."""
SLAB = 1.25
"""Noise, in sampling distances, over which points fill a slab rather than a surface, and are merged."""
COARSER = 1.4
"""Growth of the sampling distance where points are merged."""
LEAST_POINTS = 16
"""Points under which there is no telling what surface they describe: they stay where they are."""
ROUGH = 1.15
"""Noise over the roughness that a plane of few points leaves."""
STEEPEST = 0.95
"""Roughness, over the width of the weights, that is taken at most."""
LONELY = 1.7
"""Spacing over that of the region from which a point is a stray."""
LOOSE = 0.3
"""Least distance of the neighbors from the quadratic under a point, sampling distances, from which it is a stray."""
DOUBTFUL = 1.1
"""Spacing over that of the region from which a point is looked at again where it has settled."""
EMPTY, SOME = 2.0, 2
"""Radius around that place, sampling distances, and how many others it must hold: 13 are usual."""
SPARSE = 8.0
"""Spacing over that of the whole cloud from which a point is a stray, whatever its region is like."""
STRAIGHTER = 0.9
"""Share of the points around which the surface bends less than it is said to."""
OFF = 5.0
"""Distance from the surface under a point, over the region's, from which it is a stray."""


@dataclass(frozen=True)
class Samples:
    """Points on the surface that a cloud describes.

    Attributes
    ----------
    positions : (p, 3) float array
        Where each point has settled; strays are left out.
    normals : (p, 3) float array
        Unit normals, of either sign.
    spacing : (p,) float array
        How far apart the points lie around each.
    noise : (p,) float array
        Standard deviation of the points about the surface, around each.
    width : (p,) float array
        Standard deviation of the weights with which each was settled.
    strays : int
        Points left out.
    bend : float
        How far the points around a point lie off a plane, over how far they lie apart, at the `STRAIGHTER` of them.
    """

    positions: Floats
    normals: Floats
    spacing: Floats
    noise: Floats
    width: Floats
    strays: int
    bend: float


def settle_points(positions: Floats, *, threads: int = 0, progress: Progress = silent) -> Samples:
    """Move the points of a cloud onto the surface that they describe.

    Parameters
    ----------
    positions : (n, 3) float array
        Neither their order nor repetitions change anything.
    threads : int
    progress : callable

    Returns
    -------
    Samples
        In the order of their cubes.

    Notes
    -----
    A quadratic over the local plane, with Gaussian weights whose width follows the noise (Levin 1998; Cheng et
    al. 2008). Two sheets are kept apart by the planes of their points. Where the noise is so large that the points
    fill a slab, they are first merged in cubes: a fit to the means, weighted by how many points each stands for,
    is all but the fit to the points.
    """
    points = distinct(positions)
    apart = sampling_distance(points, threads=threads)
    if len(points) < LEAST_POINTS:
        level = np.full(len(points), apart)
        return Samples(points, np.zeros_like(points), level, 0 * level, level, 0, 1.0)
    cloud = _Cloud.of(np.column_stack([points, np.ones(len(points))]), apart, threads, progress)
    spacing, stray = cloud.spacing()
    planes, noise, width = cloud.planes(spacing)
    while np.median(noise) > SLAB * np.median(spacing) and len(cloud.points) > LEAST_POINTS:
        edge = COARSER * float(np.median(spacing))
        merged = _merged(cloud.points[~stray], edge)
        cloud = _Cloud.of(merged, edge, threads, progress)
        spacing, stray = np.full(len(merged), edge), np.zeros(len(merged), bool)
        planes, noise, width = cloud.planes(spacing)
    off = np.abs(planes[:, 3])
    stray |= off > np.maximum(OFF * cloud.regions.median(off), 0.5 * FIRST * spacing)
    settled = cloud.settled(planes, width, stray)
    noise = cloud.regions.median(settled[:, 6])
    stray |= settled[:, 6] > np.maximum(OFF * noise, LOOSE * spacing)
    stray |= cloud.lonely(settled, spacing)
    kept = np.flatnonzero(~stray)
    strays = int(len(points) - cloud.points[kept, 3].sum())
    bend = float(np.quantile(planes[kept, 4] / spacing[kept], STRAIGHTER)) if len(kept) else 1.0
    return Samples(settled[kept, :3], settled[kept, 3:6], spacing[kept], noise[kept], width[kept], strays, bend)


@dataclass(frozen=True)
class _Cloud:
    """Points (p, 4), each with the number of points that it stands for, sorted into cubes."""

    points: Floats
    index: Index
    regions: _Regions
    threads: int
    progress: Progress

    @classmethod
    def of(cls, points: Floats, apart: float, threads: int, progress: Progress) -> _Cloud:
        index = Index.of(points[:, :3], SIGHT * apart)
        points = np.ascontiguousarray(points[index.order])
        return cls(points, index, _Regions.of(points[:, :3], REGION * apart, threads), threads, progress)

    def spacing(self) -> tuple[Floats, NDArray[np.bool_]]:
        """Return how far apart the points lie around each, and which are too far from all others."""
        spacing = np.empty(len(self.points))
        radius = float(self.index.frame[3])
        self._run(0, lambda a, b: local_spacing(self.points, *self._cells, radius, spacing, a, b))
        usual = self.regions.median(spacing)
        stray = spacing > np.minimum(LONELY * usual, SPARSE * float(np.median(spacing)))
        return np.where(stray, usual, np.sqrt(spacing * usual)), stray

    def planes(self, spacing: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the plane at each point, the noise about it, and the width of the quadratic that this asks for."""
        planes, width = np.zeros((len(self.points), 5)), FIRST * spacing
        used = width
        for stage in (1, 2):
            self._run(stage, partial(fit_planes, self.points, *self._cells, width, planes))
            used = np.where(width > 0, width, used)
            noise = self.regions.median(_noise(planes[:, 4], used))
            wide = _width(noise, spacing)
            width = np.where(0.5 * wide > WIDER * used, 0.5 * wide, 0.0)
            if not width.any():
                break
        return planes, noise, wide

    def settled(self, planes: Floats, width: Floats, stray: NDArray[np.bool_]) -> Floats:
        """Return position, normal and residual of each point on the surface that its neighbors describe, (p, 7)."""
        settled = np.empty((len(self.points), 7))
        self._run(3, lambda a, b: settle(self.points, planes, *self._cells, width, stray, settled, a, b))
        return settled

    def lonely(self, settled: Floats, spacing: Floats) -> NDArray[np.bool_]:
        """Tell which points with few others around have settled where there are none."""
        lonely = np.empty(len(settled), np.bool_)
        reach = np.where(spacing > DOUBTFUL * self.regions.median(spacing), EMPTY * spacing, 0.0)
        self._run(3, lambda a, b: find_lonely(self.points, *self._cells, settled, reach, SOME, lonely, a, b))
        return lonely

    @property
    def _cells(self) -> tuple[NDArray[np.int64], NDArray[np.int32], Floats]:
        return self.index.cells

    def _run(self, stage: int, work: Callable[[int, int], None]) -> None:
        count = len(self.points)
        done = stage * count
        in_blocks(
            work, count, block=BLOCK, threads=self.threads,
            done=lambda n: self.progress("samples", done + n, 4 * count),
        )  # fmt: skip


def _noise(rough: Floats, width: Floats) -> Floats:
    """Return the noise behind the roughness of planes: Gaussian weights of a width see s w / sqrt(s^2 + w^2) of s."""
    seen = np.minimum(rough, STEEPEST * width)
    return np.asarray(ROUGH * seen / np.sqrt(1 - (seen / width) ** 2))


def _merged(points: Floats, edge: float) -> Floats:
    """Replace the points (p, 4) in each cube by their mean."""
    index = Index.of(points[:, :3], edge)
    ordered = points[index.order]
    mass = np.add.reduceat(ordered[:, 3], index.groups[:-1])
    means = np.add.reduceat(ordered[:, :3] * ordered[:, 3:], index.groups[:-1], axis=0) / mass[:, None]
    return np.column_stack([means, mass])


def distinct(positions: Floats) -> Floats:
    """Return each position once, in the order of x, then y, then z."""
    order = np.argsort(positions[:, 0], kind="stable")
    along = positions[order, 0]
    again = along[1:] == along[:-1]
    tied = np.flatnonzero(np.append(again, False) | np.append(False, again))
    order[tied] = order[tied][np.lexsort(positions[order[tied]].T[::-1])]
    placed = positions[order]
    return np.asarray(placed[np.append(True, any_of(placed[1:] != placed[:-1]))])


def _width(noise: Floats, spacing: Floats) -> Floats:
    """Return the width of the quadratics for a noise."""
    return np.asarray(spacing * np.clip(MOST * (noise / (NOISY * spacing)) ** POWER, LEAST, MOST))


@dataclass(frozen=True)
class _Regions:
    """Cubes over which something is taken as even: large, so that edges and thin spots of a surface do not count."""

    index: Index
    threads: int

    @classmethod
    def of(cls, points: Floats, edge: float, threads: int) -> _Regions:
        return cls(Index.of(points, edge), threads)

    def median(self, values: Floats) -> Floats:
        """Return the median of the region of each point, (p,); that of all points where a region has few."""
        medians, values, usual = np.empty(len(values)), np.ascontiguousarray(values), float(np.median(values))
        order, groups = self.index.order, self.index.groups
        in_blocks(
            lambda begin, end: region_medians(values, order, groups, FEW, usual, medians, begin, end),
            len(groups) - 1,
            block=REGIONS,
            threads=self.threads,
        )
        return medians
