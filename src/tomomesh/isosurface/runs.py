"""Components of a mask from the runs of its rows: their memory follows the mask's surface, and not its voxels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.isosurface.runs import join_runs
from .run_mask import RunMask

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    Ints = NDArray[np.int32]
    Longs = NDArray[np.int64]
    Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Runs:
    """A mask (K, J, I), and the component that each of its runs belongs to.

    Attributes
    ----------
    mask : RunMask
    parts : (r,) int32 array
        Number of its component, in the order of their first voxels.

    Examples
    --------
    >>> mask = np.array([[[True, True, False], [False, False, True]]])
    >>> Runs.of(mask, corners=True).sizes.tolist(), Runs.of(mask).sizes.tolist()
    ([3], [2, 1])
    """

    mask: RunMask
    parts: Ints

    @classmethod
    def of(cls, mask: Mask | RunMask, *, corners: bool = False, threads: int = 0) -> Runs:
        """Find the components of a mask, whose voxels touch along faces, or edges and corners too."""
        runs = mask if isinstance(mask, RunMask) else RunMask.of([mask], threads)
        own = np.arange(len(runs.starts), dtype=np.int32)
        roots = own.copy()
        join_runs(runs.begin, runs.starts, runs.stops, runs.shape[1], int(corners), roots)
        number = np.cumsum(roots == own, dtype=np.int32) - np.int32(1)
        return cls(runs, number[roots])

    @cached_property
    def sizes(self) -> Longs:
        """Voxels of each component, (c,)."""
        return self._summed(self.mask.sizes)

    @cached_property
    def boxes(self) -> Longs:
        """First slice, row and column of each component, and those behind its last, (c, 2, 3)."""
        k, j = np.divmod(self.mask.rows, self.mask.shape[1])
        boxes = np.zeros((len(self.sizes), 2, 3), np.int64)
        boxes[:, 0] = self.mask.shape
        np.minimum.at(boxes[:, 0], self.parts, np.column_stack([k, j, self.mask.starts]))
        np.maximum.at(boxes[:, 1], self.parts, np.column_stack([k + 1, j + 1, self.mask.stops]))
        return boxes

    @cached_property
    def bordering(self) -> Mask:
        """Whether a component reaches the border of the mask, (c,)."""
        count, rows, columns = self.mask.shape
        ends = np.zeros((count, rows), np.bool_)
        ends[[0, -1]] = ends[:, [0, -1]] = True
        outer = ends.ravel()[self.mask.rows] | (self.mask.starts == 0) | (self.mask.stops == columns)
        found = np.zeros(len(self.sizes), np.bool_)
        found[self.parts[outer]] = True
        return found

    def part_at(self, k: int, j: int, i: int) -> int:
        """Return the component of a voxel of the mask."""
        begin, end = self.mask.begin[k * self.mask.shape[1] + j :][:2]
        return int(self.parts[begin + np.searchsorted(self.mask.starts[begin:end], i, side="right") - 1])

    def within(self, slabs: Iterable[Mask], threads: int = 0) -> Longs:
        """Count the voxels of another mask, given as consecutive slabs (n, J, I), in each component, (c,)."""
        return self._summed(self.mask.within(slabs, threads))

    def only(self, marked: Mask) -> RunMask:
        """Return the mask of marked components (c,)."""
        return self.mask.only(marked[self.parts])

    def fill(self, mask: Mask, marked: Mask, value: bool, threads: int = 0) -> None:
        """Give the voxels of marked components (c,) a value, in place."""
        self.mask.fill(mask, marked[self.parts], value, threads)

    def _summed(self, values: NDArray[np.integer]) -> Longs:
        count = int(self.parts.max(initial=-1)) + 1
        return np.bincount(self.parts, values, count).astype(np.int64)
