"""What the slices of a window are: pieces, holes, how thick they are, and how they go on from slice to slice.

Counted on runs, stretches of a row that lie in the window or outside of it: their number grows with the outlines, not
with the area that these bound.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from ..isosurface.run_mask import RunMask
from ..kernels.measure.edges import join_pairs
from ..model.sliced import ranges
from .signal import SOLID

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Ints = NDArray[np.int64]
    Floats = NDArray[np.float64]

FRAME = 2
"""Pixels without the window around each slice: one for the outside to go around it, one so that a run that is widened
by a corner stays in its row."""
SIDES = np.pi / 4
"""Length of a line over that of the pixel sides along it, in the mean over all directions (Cauchy; Crofton 1868)."""

DUST = 0.01
"""Share of a slice's area that pieces beside the largest, and holes, may have without being seen. Chosen: half and
twice of it change the way of none of 42 windows, studies and shapes (docs/ways.md)."""
WINDING = 1.25
"""Length of an outline over that of the circle of the same area, over which a ring cuts across its bays. Chosen: an
ellipse three times as long as it is wide has 1.15, and goes with half of what 1.25 has over 1; twice changes none."""


@dataclass(frozen=True)
class Outlines:
    """What each slice of a window is.

    Attributes
    ----------
    pieces : (K,) int array
        Pieces of the window: pixels that touch at sides or corners.
    area, largest : (K,) float array
        Pixels of the window and of its largest piece.
    holes : (K,) int array
        Places that the window surrounds.
    hollow, largest_hole : (K,) float array
        Pixels of the holes and of the largest of them.
    length : (K,) float array
        Of all outlines, mm.
    ellipse : (K,) float array
        Pixels of the ellipse that has the second moments of the window.
    shared : (K - 1,) float array
        Pixels that a slice shares with the next.
    bodies : int
        Pieces in space: what hangs together through the pixels that slices share.
    largest_body : float
        Share of the window's pixels that the largest of these has.
    forks : int
        Pieces that share pixels with several pieces of the next slice, or of the one before.
    pixel_mm : (float, float)
    """

    pieces: Ints
    area: Floats
    largest: Floats
    holes: Ints
    hollow: Floats
    largest_hole: Floats
    length: Floats
    ellipse: Floats
    shared: Floats
    bodies: int
    largest_body: float
    forks: int
    pixel_mm: tuple[float, float]

    @property
    def pixel_mm2(self) -> float:
        """Area of a pixel."""
        return self.pixel_mm[0] * self.pixel_mm[1]

    @property
    def filled(self) -> NDArray[np.bool_]:
        """The slices (K,) that hold something of the window."""
        return self.area > 0

    def share(self, slices: NDArray[np.bool_]) -> float:
        """Return the share that some (K,) have of the slices that hold something."""
        return float(np.count_nonzero(slices)) / max(int(np.count_nonzero(self.filled)), 1)

    @property
    def wall(self) -> bool:
        """Whether it is a wall, and not a solid: see `signal.fills_most`."""
        return bool(self.area.sum() <= SOLID * self.ellipse.sum())

    @property
    def thickness_mm(self) -> float:
        """Twice the area over the length of its outlines: how thick a wall is, and the radius of a disc."""
        return float(2 * self.area.sum() * self.pixel_mm2 / max(self.length.sum(), np.finfo(float).tiny))

    @property
    def single(self) -> NDArray[np.bool_]:
        """The slices (K,) with one piece, which has no hole; one in a wall. What is under `DUST` does not count."""
        others = self.hollow - self.largest_hole if self.wall else self.hollow
        one = self.largest >= (1 - DUST) * self.area
        return one & (others <= DUST * (self.area + self.hollow)) & self.filled

    @property
    def ringed(self) -> bool:
        """Whether most slices have a hole, so that a wall goes around something and is no bent or branched solid."""
        return bool(2 * np.count_nonzero(self.holes) > np.count_nonzero(self.filled))

    @property
    def round(self) -> NDArray[np.bool_]:
        """The slices (K,) whose outline does not wind: no longer than `WINDING` times the circle of their area."""
        circle = 2 * np.sqrt(np.pi * self.area * self.pixel_mm2)
        return (self.length <= WINDING * circle) & self.filled

    @property
    def jump(self) -> float:
        """The greatest part of the window that lies in one slice and not in the next, or before; of an end, all."""
        ends = np.pad(self.area, 1)
        apart = ends[1:] + ends[:-1] - 2 * np.pad(self.shared, 1)
        return float(apart.max() / max(self.area.sum(), 1.0))


@dataclass(frozen=True)
class _Runs:
    """Stretches of rows: their row (n,) through all slices, and their first pixel and the one after the last."""

    row: Ints
    start: Ints
    stop: Ints
    slice: Ints
    width: int

    @property
    def size(self) -> Ints:
        return self.stop - self.start

    def meeting(self, apart: int, corner: int = 0) -> tuple[Ints, Ints]:
        """Return the pairs of runs that meet, the second `apart` rows after the first; also at corners, where 1."""
        at = (self.row + apart) * self.width
        starts, stops = self.row * self.width + self.start, self.row * self.width + self.stop
        low = np.searchsorted(stops, at + self.start - corner, "right")
        count = np.maximum(np.searchsorted(starts, at + self.stop + corner, "left") - low, 0)
        first = np.repeat(np.arange(len(count)), count)
        within = np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)
        return first, low[first] + within

    def of(self, held: NDArray[np.bool_]) -> _Runs:
        """Return some of them."""
        return _Runs(self.row[held], self.start[held], self.stop[held], self.slice[held], self.width)

    def joined(self, *pairs: tuple[Ints, Ints]) -> Ints:
        """Return the part that each run belongs to, by the number of its first run."""
        roots = np.arange(len(self.row), dtype=np.int32)
        for one, other in pairs:
            join_pairs(one, other, roots)
        return roots.astype(np.int64)


def outlines_of(mask: NDArray[np.bool_] | RunMask, pixel_mm: tuple[float, float] = (1.0, 1.0)) -> Outlines:
    """Tell what each slice of a window is.

    Parameters
    ----------
    mask : (K, J, I) bool array or RunMask
    pixel_mm : (float, float)
        Distance of the columns and of the rows.
    """
    boxed = _boxed(mask if isinstance(mask, RunMask) else RunMask.of([mask]))
    count = boxed.shape[0]
    parts = [
        _Part.of(boxed.part(start, min(stop + 1, count)), stop - start, pixel_mm) for start, stop in ranges(0, count)
    ]
    each = zip(fields(Outlines), zip(*(part.columns for part in parts), strict=True), strict=False)
    columns: dict[str, Any] = {entry.name: np.concatenate(found) for entry, found in each}
    bodies, forks = _bodies(parts), sum(part.forks for part in parts)
    largest = float(bodies.max(initial=0.0) / max(bodies.sum(), 1.0))
    columns["shared"] = columns["shared"][:-1]
    return Outlines(**columns, bodies=len(bodies), largest_body=largest, forks=forks, pixel_mm=pixel_mm)


@dataclass(frozen=True)
class _Part:
    """What some slices are, by the columns of `Outlines`, and the pixels (p,) of their pieces, slice after slice.

    Links (2, q) are pieces that share pixels with those of the next slice, as far as the one that follows the last.
    """

    columns: list[NDArray[Any]]
    sizes: Floats
    links: Ints
    forks: int

    @classmethod
    def of(cls, mask: RunMask, own: int, pixel_mm: tuple[float, float]) -> _Part:
        """Look at some slices, of which the one that follows their `own` only tells how these go on."""
        inside, outside = _runs(mask)
        count, rows = mask.shape[0], mask.shape[1] + 2 * FRAME
        beside, above = inside.meeting(1, 1), inside.meeting(rows)
        pieces, gaps = inside.joined(beside), outside.joined(outside.meeting(1))
        held = gaps != gaps[0]  # the outside of all slices is one, through their frames
        columns = [
            *_parts(inside, pieces, count), *_parts(outside.of(held), gaps[held], count),
            _lengths(inside, beside, count, pixel_mm), _ellipses(inside, rows, count),
            _sum(inside.slice, _shared(inside, above), count),
        ]  # fmt: skip
        first, pieces = np.unique(pieces, return_inverse=True)
        links = np.stack(np.divmod(np.unique(pieces[above[0]] * len(first) + pieces[above[1]]), max(len(first), 1)))
        known = np.count_nonzero(inside.slice[first] < own)
        return cls([one[:own] for one in columns], _sum(pieces, inside.size)[:known], links, _forks(links))


def _bodies(parts: list[_Part]) -> Floats:
    """Return the pixels of the pieces in space."""
    sizes = np.concatenate([part.sizes for part in parts])
    first = np.cumsum([0, *(len(part.sizes) for part in parts)])
    roots = np.arange(len(sizes), dtype=np.int32)
    for part, before in zip(parts, first.tolist(), strict=False):
        one, other = part.links + before
        join_pairs(one, other, roots)
    found = _sum(roots.astype(np.int64), sizes)
    return found[found > 0]


def _boxed(mask: RunMask) -> RunMask:
    """Leave out the rows and columns that hold nothing of a window; all slices stay."""
    _, j, i = mask.box
    return mask.cropped((slice(0, mask.shape[0]), j, i)) if mask.count else mask


def _runs(mask: RunMask) -> tuple[_Runs, _Runs]:
    """Part the rows of slices in a frame into what lies in the window and what lies outside, before and after each."""
    count, rows, columns = mask.shape[0], mask.shape[1] + 2 * FRAME, mask.shape[2] + 2 * FRAME
    k, j = np.divmod(mask.rows, mask.shape[1])
    row, start, stop = k * rows + j + FRAME, mask.starts + np.int64(FRAME), mask.stops + np.int64(FRAME)
    gap = np.arange(len(row)) + row  # the stretch outside before each inside: every row has one more than insides
    around = np.repeat(np.arange(count * rows), np.bincount(row, minlength=count * rows) + 1)
    after, before = np.zeros_like(around), np.full_like(around, columns)
    after[gap + 1], before[gap] = stop, start
    width = columns + 2 * FRAME
    return _Runs(row, start, stop, row // rows, width), _Runs(around, after, before, around // rows, width)


def _sum(where: Ints, values: NDArray[Any], count: int = 0) -> Floats:
    """Add up values by their places."""
    return np.asarray(np.bincount(where, values, count), np.float64)


def _parts(runs: _Runs, parts: Ints, count: int) -> tuple[Ints, Floats, Floats]:
    """Count the parts of each slice, their pixels, and those of the largest."""
    sizes, largest = _sum(parts, runs.size), np.zeros(count)
    where = np.zeros(len(sizes), np.int64)
    where[parts] = runs.slice
    real = sizes > 0
    np.maximum.at(largest, where[real], sizes[real])
    return np.bincount(where[real], minlength=count), _sum(runs.slice, runs.size, count), largest


def _shared(runs: _Runs, pairs: tuple[Ints, Ints]) -> Floats:
    """Return how many pixels each run shares with its partners, all together."""
    one, other = pairs
    shared = np.minimum(runs.stop[one], runs.stop[other]) - np.maximum(runs.start[one], runs.start[other])
    return _sum(one, np.maximum(shared, 0), len(runs.row))


def _lengths(runs: _Runs, beside: tuple[Ints, Ints], count: int, pixel_mm: tuple[float, float]) -> Floats:
    """Return the length of all outlines of each slice: the sides of pixels, less what they have too much."""
    along_rows = 2.0 * (runs.size - _shared(runs, beside))
    return SIDES * _sum(runs.slice, along_rows * pixel_mm[0] + 2.0 * pixel_mm[1], count)


def _ellipses(runs: _Runs, rows: int, count: int) -> Floats:
    """Return the area of the ellipse with the second moments of each slice's pixels, each pixel a square."""
    n, y = runs.size.astype(np.float64), (runs.row % rows).astype(np.float64)
    x = (runs.start + runs.stop - 1) / 2
    moments = (n, n * x, n * y, n * (x * x + (n * n - 1) / 12), n * y * y, n * x * y)
    area, *sums = (_sum(runs.slice, moment, count) for moment in moments)
    mx, my, xx, yy, xy = (one / np.maximum(area, 1.0) for one in sums)
    spread = (xx - mx * mx + 1 / 12) * (yy - my * my + 1 / 12) - (xy - mx * my) ** 2
    return np.where(area > 0, 4 * np.pi * np.sqrt(spread), 0.0)


def _forks(links: Ints) -> int:
    """Count the pieces that go on as several, or come of several."""
    return sum(int(np.count_nonzero(np.bincount(ends) > 1)) for ends in links) if links.size else 0
