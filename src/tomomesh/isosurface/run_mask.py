"""A mask as the runs of its rows: memory follows its surface, and not its voxels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.isosurface.runs import count_in_runs, count_runs, fill_runs, list_runs
from ..kernels.threads import in_blocks

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from ..model.boxes import Box

    Ints = NDArray[np.int32]
    Longs = NDArray[np.int64]
    Mask = NDArray[np.bool_]

LAYERS = 8
"""Slices looked at in one call: far below 100 ms. No result depends on it."""


@dataclass(frozen=True)
class RunMask:
    """A mask (K, J, I) as the runs of its rows.

    Row ``J k + j`` is row j of slice k; its runs, which do not touch, are those from ``begin[row]`` to before
    ``begin[row + 1]``.

    Attributes
    ----------
    shape : (int, int, int)
    begin : (K J + 1,) int64 array
        The first run of each row.
    starts, stops : (r,) int32 array
        The first column of each run, and that behind its last.

    Examples
    --------
    >>> mask = np.array([[[True, True, False], [False, False, True]]])
    >>> runs = RunMask.of([mask])
    >>> runs.starts.tolist(), runs.stops.tolist(), runs.count
    ([0, 2], [2, 3], 3)
    >>> runs[0].tolist() == mask[0].tolist()
    True
    """

    shape: tuple[int, int, int]
    begin: Longs
    starts: Ints
    stops: Ints

    @classmethod
    def of(cls, slabs: Iterable[Mask], threads: int = 0) -> RunMask:
        """List the runs of consecutive slabs (n, J, I) of a mask, one slab at least; none is kept."""
        return cls.joined([cls._of_slab(slab, threads) for slab in slabs])

    @classmethod
    def _of_slab(cls, mask: Mask, threads: int) -> RunMask:
        begin = np.zeros(mask.shape[0] * mask.shape[1] + 1, np.int64)

        def count(start: int, stop: int) -> None:
            count_runs(mask, begin[1:], start, stop)

        def listed(start: int, stop: int) -> None:
            list_runs(mask, begin, starts, stops, start, stop)

        in_blocks(count, len(mask), block=LAYERS, threads=threads)
        np.cumsum(begin, out=begin)
        starts, stops = np.empty((2, int(begin[-1])), np.int32)
        in_blocks(listed, len(mask), block=LAYERS, threads=threads)
        return cls((mask.shape[0], mask.shape[1], mask.shape[2]), begin, starts, stops)

    @classmethod
    def joined(cls, slabs: Sequence[RunMask]) -> RunMask:
        """Put consecutive slabs, one at least, over one another."""
        if len(slabs) == 1:
            return slabs[0]
        first = np.cumsum([0, *(len(slab.starts) for slab in slabs)])
        begin = [slab.begin[:-1] + low for slab, low in zip(slabs, first.tolist(), strict=False)]
        return cls(
            (sum(slab.shape[0] for slab in slabs), *slabs[0].shape[1:]), np.concatenate([*begin, first[-1:]]),
            np.concatenate([slab.starts for slab in slabs]), np.concatenate([slab.stops for slab in slabs]),
        )  # fmt: skip

    @classmethod
    def none(cls, shape: tuple[int, int, int]) -> RunMask:
        """Return a mask that holds nothing."""
        return cls(shape, np.zeros(shape[0] * shape[1] + 1, np.int64), *np.empty((2, 0), np.int32))

    def __getitem__(self, slices: int | slice) -> Mask:
        """Draw a slice (J, I), or consecutive slices (n, J, I)."""
        if not isinstance(slices, slice):
            k = range(self.shape[0])[slices]
            return np.asarray(self.part(k, k + 1)[:][0])
        start, stop, _ = slices.indices(self.shape[0])
        part = self if (start, stop) == (0, self.shape[0]) else self.part(start, stop)
        drawn = np.zeros(part.shape, np.bool_)  # what is not written takes no memory
        part.fill(drawn, np.ones(len(part.starts), np.bool_), True)
        return drawn

    def part(self, start: int, stop: int) -> RunMask:
        """Return the runs of some slices alone; their columns are not copied."""
        rows = self.shape[1]
        begin = self.begin[start * rows : stop * rows + 1]
        held = slice(int(begin[0]), int(begin[-1]))
        return RunMask((stop - start, *self.shape[1:]), begin - begin[0], self.starts[held], self.stops[held])

    @property
    def rows(self) -> Longs:
        """The row that each run lies in, (r,)."""
        return np.repeat(np.arange(len(self.begin) - 1), np.diff(self.begin))

    @property
    def sizes(self) -> Ints:
        """Voxels of each run, (r,)."""
        return self.stops - self.starts

    @cached_property
    def count(self) -> int:
        """Voxels that it holds."""
        return int(self.sizes.sum(dtype=np.int64))

    @cached_property
    def dense(self) -> Mask:
        """All of it, drawn once: for what is small enough to be whole in memory."""
        return self[:]

    @cached_property
    def box(self) -> Box:
        """The box (K, J, I) of what it holds; empty where it holds nothing."""
        if not len(self.starts):
            return slice(0, 0), slice(0, 0), slice(0, 0)
        j = np.unique(self.rows % self.shape[1])
        first, last = (int(row) // self.shape[1] for row in self.rows[[0, -1]])
        columns = slice(int(self.starts.min()), int(self.stops.max()))
        return slice(first, last + 1), slice(int(j[0]), int(j[-1]) + 1), columns

    def areas(self, axis: int = 0) -> Longs:
        """Count its voxels on each plane across an axis of (K, J, I)."""
        if axis == 2:
            change = np.zeros(self.shape[2] + 1, np.int64)
            np.add.at(change, self.starts, 1)
            np.add.at(change, self.stops, -1)
            return np.cumsum(change)[:-1]
        plane = self.rows // self.shape[1] if axis == 0 else self.rows % self.shape[1]
        return np.bincount(plane, self.sizes, self.shape[axis]).astype(np.int64)

    def plane(self, axis: int, place: int) -> Mask:
        """Draw a plane across an axis of (K, J, I): (J, I), (K, I) or (K, J)."""
        if axis == 0:
            return self[place]
        if axis == 1:
            return np.asarray(
                self._of_rows(np.arange(self.shape[0]) * self.shape[1] + place, (self.shape[0], 1))[:][:, 0]
            )
        drawn = np.zeros(self.shape[:2], np.bool_)
        drawn.ravel()[self.rows[(self.starts <= place) & (place < self.stops)]] = True
        return drawn

    def sampled(self, every: Sequence[int]) -> Mask:
        """Draw every n-th voxel along each axis (K, J, I)."""
        k, j = (np.arange(0, size, step) for size, step in zip(self.shape[:2], every, strict=False))
        return self._of_rows(np.add.outer(k * self.shape[1], j).ravel(), (len(k), len(j)))[:][..., :: every[2]]

    def cropped(self, box: Box) -> RunMask:
        """Return what lies in a box of slices and rows, whose columns hold all of it."""
        k, j, i = (np.arange(side.start, side.stop) for side in box)
        part = self._of_rows(np.add.outer(k * self.shape[1], j).ravel(), (len(k), len(j)))
        shift = np.int32(box[2].start)
        return RunMask((*part.shape[:2], len(i)), part.begin, part.starts - shift, part.stops - shift)

    def placed(self, box: Box, shape: tuple[int, int, int]) -> RunMask:
        """Return a mask of a shape that holds this one in a box, and nothing around it."""
        count = np.zeros(shape[:2], np.int64)
        count[box[0], box[1]] = np.diff(self.begin).reshape(self.shape[:2])
        begin = np.concatenate([[0], np.cumsum(count)])
        return RunMask(shape, begin, self.starts + np.int32(box[2].start), self.stops + np.int32(box[2].start))

    def _of_rows(self, rows: Longs, shape: tuple[int, int]) -> RunMask:
        """Return some of its rows, rising, as those of a mask of so many slices and rows."""
        count = self.begin[rows + 1] - self.begin[rows]
        begin = np.concatenate([[0], np.cumsum(count)])
        held = np.arange(begin[-1]) + np.repeat(self.begin[rows] - begin[:-1], count)
        return RunMask((*shape, self.shape[2]), begin, self.starts[held], self.stops[held])

    def only(self, kept: Mask) -> RunMask:
        """Return the mask of some of its runs (r,)."""
        begin = np.concatenate([[0], np.cumsum(kept)])[self.begin]
        return replace(self, begin=begin, starts=self.starts[kept], stops=self.stops[kept])

    def __invert__(self) -> RunMask:
        """Return what it leaves out: before, between and behind the runs of each row."""
        count, rows = len(self.starts), np.arange(len(self.begin))
        before = np.arange(count) + self.rows  # every row has one gap more than it has runs, some of them empty
        starts = np.zeros(count + rows[-1], np.int32)
        stops = np.full(len(starts), self.shape[2], np.int32)
        starts[before + 1], stops[before] = self.stops, self.starts
        return RunMask(self.shape, self.begin + rows, starts, stops).only(starts < stops)

    def __or__(self, other: RunMask) -> RunMask:
        """Return what lies in either; runs that touch become one."""
        row = np.concatenate([self.rows, other.rows])
        start, stop = (np.concatenate(both) for both in ((self.starts, other.starts), (self.stops, other.stops)))
        width = self.shape[2] + 1  # no run reaches from one row into the next
        order = np.argsort(row * width + start, kind="stable")
        row, starts, ends = row[order], start[order], row[order] * width + stop[order]
        reach = np.maximum.accumulate(ends) if len(ends) else ends
        first = np.append(True, row[1:] * width + starts[1:] > reach[:-1])[: len(row)]
        last = np.flatnonzero(np.append(first[1:], True)[: len(row)])
        begin = np.concatenate([[0], np.cumsum(np.bincount(row[first], minlength=len(self.begin) - 1))])
        return RunMask(self.shape, begin, starts[first], (reach[last] - row[last] * width).astype(np.int32))

    def __and__(self, other: RunMask) -> RunMask:
        """Return what lies in both."""
        return ~(~self | ~other)

    def within(self, slabs: Iterable[Mask], threads: int = 0) -> Longs:
        """Count the voxels of another mask in each run, (r,); it is given as consecutive slabs (n, J, I)."""
        found = np.zeros(len(self.starts), np.int64)
        first = 0
        for slab in slabs:
            part = self.part(first, first + len(slab))
            held = slice(int(self.begin[first * self.shape[1]]), int(self.begin[(first + len(slab)) * self.shape[1]]))
            _count(slab, part, found[held], threads)
            first += len(slab)
        return found

    def fill(self, mask: Mask, marked: Mask, value: bool, threads: int = 0) -> None:
        """Give the voxels (K, J, I) of marked runs (r,) a value, in place."""

        def fill(start: int, stop: int) -> None:
            fill_runs(mask, self.begin, self.starts, self.stops, marked, value, start, stop)

        in_blocks(fill, len(mask), block=LAYERS, threads=threads)


def _count(mask: Mask, runs: RunMask, found: Longs, threads: int) -> None:
    def count(start: int, stop: int) -> None:
        count_in_runs(mask, runs.begin, runs.starts, runs.stops, found, start, stop)

    in_blocks(count, len(mask), block=LAYERS, threads=threads)
