"""Components of a mask from the runs of its rows: their memory follows the mask's surface, and not its voxels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.isosurface.runs import count_in_runs, count_runs, fill_runs, join_runs, list_runs
from ..kernels.threads import in_blocks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Ints = NDArray[np.int32]
    Longs = NDArray[np.int64]
    Mask = NDArray[np.bool_]

LAYERS = 8
"""Slices looked at in one call: far below 100 ms. No result depends on it."""


@dataclass(frozen=True)
class Runs:
    """The runs of one value in the rows of a mask (K, J, I), and the component that each belongs to.

    Attributes
    ----------
    shape : (int, int, int)
        Of the mask.
    begin : (K J + 1,) int64 array
        The first run of each row.
    starts, stops : (r,) int32 array
        The first column of each run, and that behind its last.
    parts : (r,) int32 array
        Number of its component, in the order of their first voxels.

    Examples
    --------
    >>> mask = np.array([[[True, True, False], [False, False, True]]])
    >>> Runs.of(mask, corners=True).sizes.tolist(), Runs.of(mask).sizes.tolist()
    ([3], [2, 1])
    """

    shape: tuple[int, int, int]
    begin: Longs
    starts: Ints
    stops: Ints
    parts: Ints

    @classmethod
    def of(cls, mask: Mask, *, value: bool = True, corners: bool = False, threads: int = 0) -> Runs:
        """Find the components of what has a value, whose voxels touch along faces, or edges and corners too."""
        begin = np.zeros(mask.shape[0] * mask.shape[1] + 1, np.int64)

        def count(start: int, stop: int) -> None:
            count_runs(mask, value, begin[1:], start, stop)

        def listed(start: int, stop: int) -> None:
            list_runs(mask, value, begin, starts, stops, start, stop)

        in_blocks(count, len(mask), block=LAYERS, threads=threads)
        np.cumsum(begin, out=begin)
        starts, stops = np.empty((2, int(begin[-1])), np.int32)
        in_blocks(listed, len(mask), block=LAYERS, threads=threads)
        own = np.arange(len(starts), dtype=np.int32)
        roots = own.copy()
        join_runs(begin, starts, stops, mask.shape[1], int(corners), roots)
        number = np.cumsum(roots == own, dtype=np.int32) - np.int32(1)
        return cls((mask.shape[0], mask.shape[1], mask.shape[2]), begin, starts, stops, number[roots])

    @cached_property
    def sizes(self) -> Longs:
        """Voxels of each component, (c,)."""
        return self._summed(self.stops - self.starts)

    @cached_property
    def boxes(self) -> Longs:
        """First slice, row and column of each component, and those behind its last, (c, 2, 3)."""
        line = np.repeat(np.arange(len(self.begin) - 1), np.diff(self.begin))
        k, j = line // self.shape[1], line % self.shape[1]
        boxes = np.zeros((len(self.sizes), 2, 3), np.int64)
        boxes[:, 0] = self.shape
        np.minimum.at(boxes[:, 0], self.parts, np.column_stack([k, j, self.starts]))
        np.maximum.at(boxes[:, 1], self.parts, np.column_stack([k + 1, j + 1, self.stops]))
        return boxes

    @cached_property
    def bordering(self) -> Mask:
        """Whether a component reaches the border of the mask, (c,)."""
        count, rows, columns = self.shape
        ends = np.zeros((count, rows), np.bool_)
        ends[[0, -1]] = ends[:, [0, -1]] = True
        outer = np.repeat(ends.ravel(), np.diff(self.begin)) | (self.starts == 0) | (self.stops == columns)
        found = np.zeros(len(self.sizes), np.bool_)
        found[self.parts[outer]] = True
        return found

    def within(self, mask: Mask, threads: int = 0) -> Longs:
        """Count the voxels of another mask (K, J, I) in each component, (c,)."""
        found = np.empty(len(self.starts), np.int64)

        def count(start: int, stop: int) -> None:
            count_in_runs(mask, self.begin, self.starts, self.stops, found, start, stop)

        in_blocks(count, len(mask), block=LAYERS, threads=threads)
        return self._summed(found)

    def fill(self, mask: Mask, marked: Mask, value: bool, threads: int = 0) -> None:
        """Give the voxels of marked components (c,) a value, in place."""
        taken = marked[self.parts]

        def fill(start: int, stop: int) -> None:
            fill_runs(mask, self.begin, self.starts, self.stops, taken, value, start, stop)

        in_blocks(fill, len(mask), block=LAYERS, threads=threads)

    def _summed(self, values: NDArray[np.integer]) -> Longs:
        count = int(self.parts.max(initial=-1)) + 1
        return np.bincount(self.parts, values, count).astype(np.int64)
