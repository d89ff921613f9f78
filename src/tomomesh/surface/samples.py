"""Points -> samples of a surface: what lies under noise, and which way it faces.

From positions alone: how far apart the points are, how noisy, which ones are strays; and each point moved onto the
surface that its neighbors describe, with a normal there of either sign.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.samples import fit_planes, local_spacing, settle
from ..kernels.threads import in_blocks
from ..progress import Progress, silent
from .partition import sampling_distance
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
ROUGH = 1.4
"""Noise over the roughness that a plane of few points leaves."""
LONELY = 3.0
"""Spacing over that of the region from which a point is a stray."""
SPARSE = 8.0
"""Spacing over that of the whole cloud from which a point is a stray, whatever its region is like."""
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
    """

    positions: Floats
    normals: Floats
    spacing: Floats
    noise: Floats
    width: Floats
    strays: int


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
        In the order of their coordinates.

    Notes
    -----
    A quadratic over the local plane, with Gaussian weights whose width follows the noise (Levin 1998; Cheng et
    al. 2008). Two sheets are kept apart by the planes of their points.
    """
    points = distinct(positions)
    index = Index.of(points, SIGHT * sampling_distance(points))
    points = points[index.order]
    cells = (index.keys, index.start, index.frame)
    run = _Runner(len(points), threads, progress)
    spacing = np.empty(len(points))
    run(0, lambda a, b: local_spacing(points, *cells, index.frame[3], spacing, a, b))
    regions = _Regions.of(points, REGION * float(np.median(spacing)))
    usual = regions.median(spacing)
    stray = spacing > np.minimum(LONELY * usual, SPARSE * float(np.median(spacing)))
    spacing = np.where(stray, usual, np.sqrt(spacing * usual))
    planes, width = np.zeros((len(points), 5)), FIRST * spacing
    run(1, lambda a, b: fit_planes(points, *cells, width, planes, a, b))
    noise = ROUGH * regions.median(planes[:, 4])
    wide = _width(noise, spacing)
    again = np.where(0.5 * wide > 1.25 * width, 0.5 * wide, 0.0)
    run(2, lambda a, b: fit_planes(points, *cells, again, planes, a, b))
    off = np.abs(planes[:, 3])
    stray |= off > np.maximum(OFF * regions.median(off), 0.5 * FIRST * spacing)
    settled = np.empty((len(points), 7))
    run(3, lambda a, b: settle(points, planes, *cells, wide, stray, settled, a, b))
    noise = regions.median(settled[:, 6])
    kept = np.flatnonzero(~stray)
    return Samples(
        settled[kept, :3], settled[kept, 3:6], spacing[kept], noise[kept], wide[kept], len(points) - len(kept)
    )


def distinct(positions: Floats) -> Floats:
    """Return each position once, in the order of x, then y, then z."""
    placed = positions[np.lexsort(positions.T[::-1])]
    return placed[np.append(True, (placed[1:] != placed[:-1]).any(axis=1))]


def _width(noise: Floats, spacing: Floats) -> Floats:
    """Return the width of the quadratics for a noise."""
    return np.asarray(spacing * np.clip(MOST * (noise / (NOISY * spacing)) ** POWER, LEAST, MOST))


@dataclass(frozen=True)
class _Runner:
    """Run kernels over all points, and tell how far they are."""

    count: int
    threads: int
    progress: Progress

    def __call__(self, stage: int, work: Callable[[int, int], None]) -> None:
        done = stage * self.count
        in_blocks(
            work, self.count, block=BLOCK, threads=self.threads,
            done=lambda count: self.progress("samples", done + count, 4 * self.count),
        )  # fmt: skip


@dataclass(frozen=True)
class _Regions:
    """Cubes over which something is taken as even: large, so that edges and thin spots of a surface do not count."""

    labels: NDArray[np.int64]
    count: int

    @classmethod
    def of(cls, points: Floats, edge: float) -> _Regions:
        index = Index.of(points, edge)
        labels = np.empty(len(points), np.int64)
        labels[index.order] = np.repeat(np.arange(len(index.keys)), np.diff(index.start))
        return cls(labels, len(index.keys))

    def median(self, values: Floats) -> Floats:
        """Return the median of the region of each point, (p,); that of all points where a region has few."""
        order = np.lexsort((values, self.labels))
        size = np.bincount(self.labels, minlength=self.count)
        middle = np.cumsum(size) - size + size // 2
        medians = np.where(size < FEW, np.median(values), values[order][middle])
        return np.asarray(medians[self.labels])
