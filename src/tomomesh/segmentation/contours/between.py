"""Slices between the slices: depths carried along the rings, parts that end closed half way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...kernels.threads import in_blocks
from ...model.lazy import LazyVoxels
from ...model.sliced import ranges, ranges_of, some_of, together
from ...progress import Progress, silent
from .gray import FullLevels
from .insides import RingFrame, insides_of
from .spaces import Spaces

if TYPE_CHECKING:
    from ...isosurface.crossings import Levels
    from ...model.contours import Contours
    from ...model.sliced import Sliced
    from ...model.volume import Volume
    from .insides import Depths

MOST_VOXELS = 60_000_000
"""Voxels over which fewer slices are laid between the slices: 240 MB of 32-bit depths."""


@dataclass(frozen=True)
class Between:
    """Slices between the slices of rings, about as far apart as pixels are wide, drawn as they are asked for.

    Along each track the rings pass from point to point, and carry the depths of both slices with them, which are
    blended there as they are elsewhere (Raya & Udupa 1990). So a sheet that slants by more than its own thickness from
    slice to slice stays one, and what branches, merges or opens does so by the depths alone: nothing crosses. What has
    nothing above or below ends half way to that slice, neither cut nor swollen, and what would be between two slices
    alone, in neither of them, is none.

    They are what is `Stored` of `LazyVoxels`: depths in mm inside of the rings, at most a pixel, over 0 inside.

    Attributes
    ----------
    contours : Contours
    mask : (K, J, I) bool array or slices of it
        The window.
    frame : RingFrame
    gray : FullLevels or None
        What tells of loops how near the surface is above and below.
    step : float
        Distance of the slices of rings, mm.
    times : int
        Slices that there are to be for one.
    threads : int
    """

    contours: Contours
    mask: Sliced
    frame: RingFrame
    gray: FullLevels | None
    step: float
    times: int
    threads: int = 0

    @classmethod
    def of(
        cls, contours: Contours, mask: Sliced, study: Volume, levels: Levels | None = None, threads: int = 0
    ) -> Between:
        """Look between the rings of a study, whose slices K are those of the contours.

        The gray levels and the window on them tell of loops how near the surface is above and below.
        """
        frame = RingFrame.of(contours, study.spacing_mm[:2])
        parts = (insides_of(contours, mask, frame, threads, *some) for some in ranges_of(frame))
        gray = FullLevels.of(levels if contours.kind == "loops" else None, mask, parts, threads)
        step = study.slice_distance_mm
        most = MOST_VOXELS // int(np.prod(frame.shape))
        times = max(min(round(step / float(frame.pixel.max())), most), 1)
        return cls(contours, mask, frame, gray, step, times, threads)

    @cached_property
    def ended(self) -> dict[tuple[str, int], list[int]]:
        """The tracks that something happens to, by what it is and the slice."""
        found: dict[tuple[str, int], list[int]] = {}
        for event in self.contours.events:
            found.setdefault((event.kind, event.slice - int(self.frame.low[2])), []).append(event.track)
        return found

    @cached_property
    def holes(self) -> set[int]:
        """The tracks of holes."""
        return {one.track for one in self.contours.contours if one.side % 2}

    @property
    def most(self) -> np.float32:
        """The greatest depth that is told."""
        return np.float32(self.frame.pixel.max())

    @property
    def around(self) -> int:
        """Slices before the first with a ring, and after the last."""
        return self.times // 2 + 1

    @property
    def shape(self) -> tuple[int, int, int]:
        """All slices, rows and columns."""
        count, rows, columns = self.frame.shape
        return (count - 1) * self.times + 1 + 2 * self.around, rows, columns

    @property
    def dtype(self) -> np.dtype[Any]:
        """Depths have 32 bits."""
        return np.dtype(np.float32)

    @property
    def chunks(self) -> tuple[int, int, int]:
        """Sizes of what is drawn together: all slices from one with rings to the next, whole."""
        return self.times, *self.shape[1:]

    def read(self, box: tuple[slice, ...]) -> Depths:
        """Return the depths in a box; slices are drawn whole."""
        start, stop, by = box[0].indices(self.shape[0])
        found = np.empty((stop - start, *self.shape[1:]), np.float32)
        low, high = ((n - self.around) // self.times for n in (start, stop - 1))
        spaces = Spaces.of(self, low, high + 1)

        def work(first: int, last: int) -> None:
            for k in range(low + first, low + last):
                begin = self.around + k * self.times
                within = slice(max(begin, start) - begin, min(begin + self.times, stop) - begin)
                found[begin + within.start - start : begin + within.stop - start] = spaces.filled(k)[within]

        in_blocks(work, high + 1 - low, block=1, threads=self.threads)
        return np.clip(found, -self.most, self.most, out=found)[(slice(None, None, by), *box[1:])]

    def over(self, study: Volume) -> Volume:
        """Place the slices in space, not drawn yet."""
        affine = study.affine.copy()
        affine[:3, 2] /= self.times
        low = self.frame.low * (1, 1, self.times) - (0, 0, self.around)
        affine[:3, 3] += affine[:3, :3] @ low
        voxels: Any = LazyVoxels.of(self)
        return replace(study, voxels=voxels, affine=affine)


def filled_between(
    contours: Contours, mask: Sliced, study: Volume, *, levels: Levels | None = None, threads: int = 0,
    progress: Progress = silent,
) -> Volume:  # fmt: skip
    """Draw all slices `Between` rings, some at a time: what they are made of is never there for all.

    Parameters
    ----------
    contours, mask, study, levels, threads
        As of `Between.of`.
    progress : callable
    """
    between = Between.of(contours, mask, study, levels, threads)
    volume, count, found = between.over(study), between.shape[0], np.empty(between.shape, between.dtype)
    for start, stop in ranges(0, count, together(between.frame) * between.times):
        found[start:stop] = some_of(volume.voxels, start, stop)
        progress("slices", stop, count)
    return replace(volume, voxels=found)
