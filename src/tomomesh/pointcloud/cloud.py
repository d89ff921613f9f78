"""Points sorted into cubes, and each step from them to samples of a surface: spacing, planes, noise, quadratics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.pointcloud.samples import fit_planes, settle
from ..kernels.pointcloud.spacing import find_lonely, local_spacing, region_medians
from ..kernels.threads import in_blocks
from ..model.columns import box
from .search import Index

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ..progress import Progress
    from .whole import Whole

    Floats = NDArray[np.float64]

BLOCK = 4_096
"""Points worked on in one call: below 100 ms. No result depends on it."""
SIGHT = 2.25
"""Radius, in sampling distances, within which neighbors are counted: about 16 of them. Chosen: half of it changes the
distance by -1.5 %, twice by +3.6 %."""
REGION = 12
"""Edge of the cubes over which spacing and noise are taken as even, sampling distances. Chosen: half of it changes the
distance by +1.6 %, twice by +2.9 %."""
REGIONS = 64
"""Of these cubes, those worked on in one call. No result depends on it."""
FEW = 8
"""Points under which a region has no say of its own. Chosen: half of it changes the distance by -0.2 %, twice by
-0.1 %."""
LEAST, MOST = 0.7, 3.4
"""Width of the quadratics where the points are exact and where they are noisy, sampling distances. Chosen: half
of the first changes the distance by +3.5 %, twice by +16.1 %; half of the other by +205.8 %, and twice leads to a
refusal."""
NOISY = 0.6
"""Noise, in sampling distances, from which the greatest width is taken. Chosen: half of it changes the distance by
-45.8 %, twice by +191.3 %."""
POWER = 0.8
"""Power of the noise with which the width grows: it balances what noise and curvature do to a quadratic. Chosen: half
of it changes the distance by -39.9 %, twice by +74.1 %."""
FIRST = 0.8
"""Width of the first planes, sampling distances. Chosen: half of it leads to a refusal, twice changes the distance by
+49.1 %."""
WIDER = 1.25
"""Growth of the width for which planes are fitted anew. Chosen: half of it changes the distance by +18.5 %, twice by
+99.7 %."""
SLAB = 1.25
"""Noise, in sampling distances, over which points fill a slab rather than a surface, and are merged. Chosen: half of it
leads to a refusal, twice nothing."""
COARSER = 1.4
"""Growth of the sampling distance where points are merged: about the root of two, so that half of them are left.
Chosen: half and twice of it change no case of benchmarks/constants.py."""
LEAST_POINTS = 16
"""Points under which there is no telling what surface they describe: they stay where they are. Chosen: half and twice
of it change no case of benchmarks/constants.py."""
ROUGH = 1.15
"""Noise over the roughness that a plane of few points leaves. Chosen: half of it changes the distance by +191.3 %,
twice leads to a refusal."""
STEEPEST = 0.95
"""Roughness, over the width of the weights, that is taken at most. Chosen: half of it changes the distance by +1.6 %,
twice nothing."""
LONELY = 1.7
"""Spacing over that of the region from which a point is a stray. Chosen: half of it leads to a refusal, twice changes
the distance by -1.4 %."""
DOUBTFUL = 1.1
"""Spacing over that of the region from which a point is looked at again where it has settled. Chosen: half of it
changes the distance by 0.0 %, twice by +5.4 %."""
EMPTY, SOME = 2.0, 2
"""Radius around that place, sampling distances, and how many others it must hold: 13 are usual. Chosen: half of
the radius leads to a refusal, twice changes the distance by +5.4 %; half of the others by -0.2 %, twice by -0.8 %."""
SPARSE = 8.0
"""Spacing over that of the whole cloud from which a point is a stray, whatever its region is like. Chosen: half and
twice of it change no case of benchmarks/constants.py."""


@dataclass(frozen=True)
class Cloud:
    """Points (p, 4), each with the number of points that it stands for, sorted into cubes.

    `merges` is how often points were merged, `apart` the distance of their neighbors; regions are the large cubes over
    which something is taken as even: edges and thin spots of a surface do not count there.
    """

    points: Floats
    index: Index
    regions: Index
    apart: float
    merges: int
    whole: Whole
    threads: int
    progress: Progress

    @classmethod
    def of(cls, points: Floats, apart: float, merges: int, whole: Whole, threads: int, progress: Progress) -> Cloud:
        """Sort points whose neighbors lie a distance apart."""
        origin = whole.get(f"corner {merges}", lambda: box(points[:, :3])[0])
        index = Index.of(points[:, :3], SIGHT * apart, origin)
        points = np.ascontiguousarray(points[index.order])
        regions = Index.of(points[:, :3], REGION * apart, origin)
        return cls(points, index, regions, apart, merges, whole, threads, progress)

    def median(self, name: str, values: Floats) -> float:
        """Return the median of all values of a name."""
        return float(self.whole.get(f"median {name} {self.merges}", lambda: float(np.median(values))))

    def around(self, name: str, values: Floats) -> Floats:
        """Return the median of the region of each point, (p,); that of all points where a region has few."""
        medians, values, usual = np.empty(len(values)), np.ascontiguousarray(values), self.median(name, values)
        order, groups = self.regions.order, self.regions.groups
        in_blocks(
            lambda begin, end: region_medians(values, order, groups, FEW, usual, medians, begin, end),
            len(groups) - 1,
            block=REGIONS,
            threads=self.threads,
        )
        return medians

    def is_slab(self, noise: Floats, spacing: Floats) -> bool:
        """Tell whether the points fill a slab rather than a surface."""
        count = self.whole.get(f"points {self.merges}", lambda: len(self.points))
        return bool(self.median("noise", noise) > SLAB * self.median("spacing", spacing) and count > LEAST_POINTS)

    def merged(self, stray: NDArray[np.bool_], spacing: Floats) -> Cloud:
        """Replace the points in each cube by their mean."""
        kept, edge = self.points[~stray], COARSER * self.median("spacing", spacing)
        index = Index.of(kept[:, :3], edge, self.whole.get(f"kept {self.merges}", lambda: box(kept[:, :3])[0]))
        ordered = kept[index.order]
        mass = np.add.reduceat(ordered[:, 3], index.groups[:-1])
        means = np.add.reduceat(ordered[:, :3] * ordered[:, 3:], index.groups[:-1], axis=0) / mass[:, None]
        points = np.column_stack([means, mass])
        return Cloud.of(points, edge, self.merges + 1, self.whole, self.threads, self.progress)

    def spacing(self) -> tuple[Floats, NDArray[np.bool_]]:
        """Return how far apart the points lie around each, and which are too far from all others."""
        spacing = np.empty(len(self.points))
        radius = float(self.index.frame[3])
        self._run(0, lambda a, b: local_spacing(self.points, *self._cells, radius, spacing, a, b))
        usual = self.around("spacing seen", spacing)
        stray = spacing > np.minimum(LONELY * usual, SPARSE * self.median("spacing seen", spacing))
        return np.where(stray, usual, np.sqrt(spacing * usual)), stray

    def planes(self, spacing: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the plane at each point, the noise about it, and the width of the quadratic that this asks for."""
        planes, width = np.zeros((len(self.points), 5)), FIRST * spacing
        used = width
        for stage in (1, 2):
            self._run(stage, partial(fit_planes, self.points, *self._cells, width, planes))
            used = np.where(width > 0, width, used)
            noise = self.around(f"roughness {stage}", _noise(planes[:, 4], used))
            wide = _width(noise, spacing)
            width = np.where(0.5 * wide > WIDER * used, 0.5 * wide, 0.0)
        return planes, noise, wide

    def settled(self, planes: Floats, width: Floats, stray: NDArray[np.bool_]) -> Floats:
        """Return position, normal, residual and rise of each point on the surface of its neighbors, (p, 8)."""
        settled = np.empty((len(self.points), 8))
        self._run(3, lambda a, b: settle(self.points, planes, *self._cells, width, stray, settled, a, b))
        return settled

    def lonely(self, settled: Floats, spacing: Floats) -> NDArray[np.bool_]:
        """Tell which points with few others around have settled where there are none."""
        lonely = np.empty(len(settled), np.bool_)
        reach = np.where(spacing > DOUBTFUL * self.around("spacing", spacing), EMPTY * spacing, 0.0)
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


def _width(noise: Floats, spacing: Floats) -> Floats:
    """Return the width of the quadratics for a noise."""
    return np.asarray(spacing * np.clip(MOST * (noise / (NOISY * spacing)) ** POWER, LEAST, MOST))
