"""Points -> samples of a surface: what lies under noise, and which way it faces.

From positions alone: how far apart the points are, how noisy, which ones are strays; and each point moved onto the
surface that its neighbors describe, with a normal there of either sign.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..cuberille.partition import sampling_distance
from ..model.columns import any_of
from ..progress import Progress, silent
from .cloud import FIRST, LEAST_POINTS, Cloud
from .search import Index
from .whole import Whole

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

LOOSE = 0.3
"""Least distance of the neighbors from the quadratic under a point, sampling distances, from which it is a stray.
Chosen: half and twice of it change no case of benchmarks/constants.py."""
STRAIGHTER = 0.9
"""Share of the points around which the surface bends less than it is said to. Chosen: half of it changes nothing, twice
leads to a refusal."""
OFF = 5.0
"""Distance from the surface under a point, over the region's, from which it is a stray. Chosen: half of it changes the
distance by +15.5 %, twice by -0.2 %."""
LEAST, SEEN = 0.1, 0.0078
"""Share of the points whose neighbors lie nearest to their quadratic, and the distance from it, sampling distances, at
which it is noise: that of noise of a fiftieth. It is .002 and less on 18 shapes without noise."""
SIDEWAYS = 0.5
"""Variance of the noise along one direction in the surface over that along its normal: where noise lies along rays from
all sides, of which an area meets as many as the cosine of their angle says, half of it is along the normal and a
quarter along each of the others. Chosen: none of it changes the distance of eleven scans' samples from the surface by
+1.0 %, twice by +.7 %."""

EDGE = 2.5
"""Edge of the cubes that samples are sorted into, sampling distances: as far as bridges and stars look. Chosen: 2.25 of
them changes the distance by +.3 % (torus) and 0 (bunny), as bridges then begin at their other ends."""


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
    whole : Whole
        What was taken over all points.
    offsets : (p, 3) float32 array, optional
        From there to where the surface goes through: all of the way back to the points where there is no noise, none of
        it, and no array, where it can be seen.
    """

    positions: Floats
    normals: Floats
    spacing: Floats
    noise: Floats
    width: Floats
    strays: int
    bend: float
    whole: Whole = field(default_factory=Whole)
    offsets: NDArray[np.float32] | None = None

    @cached_property
    def index(self) -> Index:
        """The samples sorted into cubes about as wide as neighbors are looked for."""
        return Index.of(self.positions, EDGE * float(np.median(self.spacing)))

    @property
    def rows(self) -> Floats:
        """Position, normal and spacing of each, in the order of `index`, (p, 7); not kept, for they are most of it."""
        found = np.empty((len(self.positions), 7))
        for at, columns in ((slice(0, 3), self.positions), (slice(3, 6), self.normals), (6, self.spacing)):
            found[:, at] = columns[self.index.order]
        return found


def settle_points(
    positions: Floats, *, whole: Whole | None = None, threads: int = 0, progress: Progress = silent
) -> Samples:
    """Move the points of a cloud onto the surface that they describe.

    Parameters
    ----------
    positions : (n, 3) float array
        Neither their order nor repetitions change anything.
    whole : Whole, optional
        Of a part of a cloud, that of the cloud: what has enough around it then settles as in the cloud, to the last
        bit. Found here where not given.
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
    is all but the fit to the points. Noise as large moves points along the surface, too, so that what
    stands where a surface bulges comes from the lower places around: the mean height there is too low by the variance
    of that noise times half of the Laplacian (an error in the variables; Fuller 1987), and each sample rises by it.

    What becomes of a point depends on `Whole`, and on the points within 37 sampling distances: those of its region
    (12), what these look at (2.5 widths of 3.4), the regions that tell the planes there (12), and what the points of
    these look at (4.5). Measured on tori of 20,000 points: parts with 20 around them differ in one of 6 places where
    the points are clean and in all where they are noisy, with 40 in none.
    """
    points, whole = distinct(positions), Whole() if whole is None else whole
    del positions
    apart = whole.get("sampling distance", lambda: sampling_distance(points, threads=threads))
    if whole.get("points 0", lambda: len(points)) < LEAST_POINTS:
        level = np.full(len(points), apart)
        return Samples(points, np.zeros_like(points), level, 0 * level, level, 0, 1.0, whole)
    cloud = Cloud.of(np.column_stack([points, np.ones(len(points))]), apart, 0, whole, threads, progress)
    points = cloud.points  # as many: the others are let go of
    spacing, stray = cloud.spacing()
    planes, noise, width = cloud.planes(spacing)
    while cloud.is_slab(noise, spacing):
        cloud = cloud.merged(stray, spacing)
        spacing, stray = np.full(len(cloud.points), cloud.apart), np.zeros(len(cloud.points), bool)
        planes, noise, width = cloud.planes(spacing)
    off = np.abs(planes[:, 3])
    stray |= off > np.maximum(OFF * cloud.around("distance", off), 0.5 * FIRST * spacing)
    settled = cloud.settled(planes, width, stray)
    noise = cloud.around("residual", settled[:, 6])
    stray |= settled[:, 6] > np.maximum(OFF * noise, LOOSE * spacing)
    stray |= cloud.lonely(settled, spacing)
    if cloud.merges:
        settled[:, :3] -= (SIDEWAYS * noise**2 * settled[:, 7])[:, None] * settled[:, 3:6]
    kept = np.flatnonzero(~stray)
    exact = 0.0 if cloud.merges else whole.get("exact", lambda: _exact(settled[:, 6] / spacing))
    back = (exact * (cloud.points[kept, :3] - settled[kept, :3])).astype(np.float32) if exact else None
    strays = int(len(points) - cloud.points[kept, 3].sum())
    bends = planes[kept, 4] / spacing[kept]
    bend = whole.get("bend", lambda: float(np.quantile(bends, STRAIGHTER)) if len(kept) else 1.0)
    return Samples(
        settled[kept, :3], settled[kept, 3:6], spacing[kept], noise[kept], width[kept], strays, bend, whole, back
    )


def _exact(residuals: Floats) -> float:
    """Return how exact points are, 0 to 1, from how far the neighbors of each lie off its quadratic.

    What bends leaves much at some points and next to nothing at others, noise leaves some at all: so those with the
    least tell. Distances are over the sampling distance.
    """
    return max(0.0, 1 - (float(np.quantile(residuals, LEAST)) / SEEN) ** 2)


def distinct(positions: Floats) -> Floats:
    """Return each position once, in the order of x, then y, then z."""
    order = np.argsort(positions[:, 0], kind="stable")
    along = positions[order, 0]
    again = along[1:] == along[:-1]
    tied = np.flatnonzero(np.append(again, False) | np.append(False, again))
    order[tied] = order[tied][np.lexsort(positions[order[tied]].T[::-1])]
    placed = positions[order]
    return np.asarray(placed[np.append(True, any_of(placed[1:] != placed[:-1]))])
