"""Slices between the slices: depths carried along the rings, parts that end closed half way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ...kernels.contours.between import blend, carry_along
from ...kernels.threads import in_blocks
from ...model.contours import BIRTH, DEATH
from ...progress import Progress, silent
from .courses import courses_of
from .gray import tempered
from .insides import insides_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...isosurface.crossings import Levels
    from ...model.contours import Contours
    from ...model.volume import Volume
    from .courses import Course
    from .insides import Depths, Insides

    Floats = NDArray[np.float64]

MOST_VOXELS = 60_000_000
"""Voxels over which fewer slices are laid between the slices: 240 MB of 32-bit depths."""
TOUCHING = np.ones((3, 3, 3), bool)
"""Voxels that touch at a corner are of one piece."""


def filled_between(
    contours: Contours, mask: NDArray[np.bool_], study: Volume, *, levels: Levels | None = None, threads: int = 0,
    progress: Progress = silent,
) -> Volume:  # fmt: skip
    """Lay slices between the slices of rings, about as far apart as pixels are wide.

    Along each track the rings pass from point to point, and carry the depths of both slices with them, which are
    blended there as they are elsewhere (Raya & Udupa 1990). So a sheet that slants by more than its own thickness from
    slice to slice stays one, and what branches, merges or opens does so by the depths alone: nothing crosses. What has
    nothing above or below ends half way to that slice, neither cut nor swollen, and what would be between two slices
    alone, in neither of them, is none.

    Parameters
    ----------
    contours : Contours
    mask : (K, J, I) bool array
        The window.
    study : Volume
        Its slices K are those of the contours.
    levels : Levels, optional
        The gray levels and the window on them, which tell of loops how near the surface is above and below.
    threads : int
    progress : callable

    Returns
    -------
    Volume
        Depths in mm inside of the rings, at most a pixel, in 32 bits; over 0 inside.
    """
    insides = insides_of(contours, mask, study.spacing_mm[:2], threads)
    times = _times(insides, study.slice_distance_mm)
    courses = courses_of(insides, study.slice_distance_mm, threads)
    depths = tempered(insides, levels if contours.kind == "loops" else None, mask)
    spaces = _Spaces(insides, depths, courses, _ended(contours, insides), _holes(contours), times)
    filled = np.empty((spaces.layers, *insides.depths.shape[1:]), np.float32)

    def work(start: int, stop: int) -> None:
        for k in range(start, stop):
            spaces.fill(k - 1, filled)

    total = len(insides.curves) + 2
    in_blocks(work, total, block=1, threads=threads, done=lambda done: progress("slices", done, total))
    most = np.float32(insides.pixel.max())
    np.clip(filled, -most, most, out=filled)
    return replace(study, voxels=filled, affine=_affine(study, insides, times, spaces.around))


def _times(insides: Insides, step: float) -> int:
    """Return how many slices there are to be for one."""
    most = MOST_VOXELS // insides.depths.size
    return max(min(round(step / float(insides.pixel.max())), most), 1)


def _affine(study: Volume, insides: Insides, times: int, around: int) -> Floats:
    """Place the slices in space: `around` of them lie before the first with a ring."""
    affine = study.affine.copy()
    affine[:3, 2] /= times
    low = insides.low * (1, 1, times) - (0, 0, around)
    affine[:3, 3] += affine[:3, :3] @ low
    return affine


def _ended(contours: Contours, insides: Insides) -> dict[tuple[str, int], list[int]]:
    """Return the tracks that something happens to, by what it is and the slice."""
    found: dict[tuple[str, int], list[int]] = {}
    for event in contours.events:
        found.setdefault((event.kind, event.slice - int(insides.low[2])), []).append(event.track)
    return found


def _holes(contours: Contours) -> set[int]:
    return {one.track for one in contours.contours if one.side % 2}


@dataclass(frozen=True)
class _Spaces:
    """The space above each slice, that below the first, number -1, and that above what is above the last.

    Attributes
    ----------
    insides : Insides
    depths : (K, J, I) float32 array
        Those that are blended between the slices.
    courses : list of lists of Course
    ended : dict
        The tracks that are born on a slice, or die there.
    holes : set of int
        The tracks of holes.
    times : int
        Slices that there are to be for one.
    """

    insides: Insides
    depths: Depths
    courses: list[list[Course]]
    ended: dict[tuple[str, int], list[int]]
    holes: set[int]
    times: int

    @property
    def around(self) -> int:
        """Slices before the first with a ring, and after the last."""
        return self.times // 2 + 1

    @property
    def layers(self) -> int:
        """All slices."""
        return (len(self.insides.depths) - 1) * self.times + 1 + 2 * self.around

    def fill(self, k: int, levels: Depths) -> None:
        """Fill slice k and those up to the next."""
        first, depths = self.around + k * self.times, self.insides.depths
        below, above = self._closed(k)
        for n in range(max(-first, 0), min(self.times, self.layers - first)):
            if n or not 0 <= k < len(depths):
                self._blend(k, below, above, n / self.times, levels[first + n])
            else:
                levels[first] = depths[k]
        if 0 <= k < len(depths) - 1 and self.times > 1:
            _without_specks(levels[first : first + self.times], depths[k + 1])

    def _closed(self, k: int) -> tuple[Depths, Depths]:
        """Return the depths of slice k and the next, where what has nothing there lies as far outside as it is deep."""
        curves, depths = self.insides.curves, self.depths
        if k == len(curves):
            return -np.abs(depths[-1]), -np.abs(depths[-1])
        if k + 1 == len(curves) or not curves[k + 1]:
            return depths[k], -np.abs(depths[k])
        if k < 0 or not curves[k]:
            return -np.abs(depths[k + 1]), depths[k + 1]
        below, above = depths[k].copy(), depths[k + 1].copy()
        self._close(self.ended.get((DEATH, k), []), k, above)
        self._close(self.ended.get((BIRTH, k + 1), []), k + 1, below)
        return below, above

    def _close(self, tracks: list[int], k: int, beside: Depths) -> None:
        """Let rings of slice k that have nothing beside them go on for half of the way."""
        for track in tracks:
            curve, hole = self.insides.curves[k][track], track in self.holes
            low = np.maximum(np.floor(curve.min(axis=0)).astype(np.int64) - 1, 0)
            high = np.ceil(curve.max(axis=0)).astype(np.int64) + 2
            window = slice(low[1], high[1]), slice(low[0], high[0])
            own, other = self.depths[k][window], beside[window]
            within = np.empty(own.shape, np.float32)
            self.insides.draw([np.ascontiguousarray((curve[::-1] if hole else curve) - low)], within)
            if hole:
                np.minimum(other, -own, out=other, where=(within > 0) & (own < 0))
            else:
                np.maximum(other, -own, out=other, where=(within > 0) & (own > 0))

    def _blend(self, k: int, below: Depths, above: Depths, share: float, depths: Depths) -> None:
        """Blend the depths of two slices along the rings that pass between them."""
        passing = [course.at(share) for course in (self.courses[k] if 0 <= k < len(self.courses) else [])]
        points = np.concatenate([np.zeros((0, 2)), *(points for points, _ in passing)])
        ways = np.concatenate([np.zeros((0, 4)), *(ways for _, ways in passing)])
        away, carried = np.empty(depths.shape, np.float32), np.empty((*depths.shape, 4), np.float32)
        carry_along(points, ways, self.insides.pixel, self.insides.reach, away, carried)
        blend(below, above, away, carried, self.insides.reach, share, depths)


def _without_specks(levels: Depths, after: Depths) -> None:
    """Turn over what lies between two slices alone: `levels` are those from one on, `after` is the next."""
    inside = np.concatenate([levels, after[None]]) > 0
    for part, touching in ((inside, TOUCHING), (~inside, None)):
        labels, count = scipy.ndimage.label(part, touching)
        known = np.zeros(count + 1, bool)
        known[labels[0]] = known[labels[-1]] = known[0] = True
        np.negative(levels, out=levels, where=~known[labels[:-1]])
