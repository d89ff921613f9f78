"""A study's voxels, cut into slabs of slices: what is asked of each slab, by whom, and what is made of each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ...isosurface.run_mask import RunMask
from ...model.lazy import LazyVoxels, in_memory
from .levels import LevelCounts, gathered
from .sources import Made

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from ...model.boxes import Box
    from ...slabs.keep import Slabs
    from .levels import Levels, Looked
    from .sources import Making, Voxels

TOGETHER = 2**21
"""Voxels of a slab where the study is in memory: what is made of each stays in the cache of a core, and bounds what is
made besides. No result depends on it. Measured on 512 x 512 x 200 voxels: half of it takes as long, twice 1.1 to 1.6
times as long."""
AT_ONCE = 32
"""Slabs of which what was found is brought here at once: 16 MiB of counts of levels. No result depends on it."""


def thin_cuts(shape: tuple[int, ...]) -> list[int]:
    """Cut a study in memory into slabs of `TOGETHER` voxels, or of one slice."""
    step = max(1, TOGETHER // max(1, int(np.prod(shape[1:]))))
    return [*range(0, shape[0], step), shape[0]]


@dataclass(frozen=True)
class Cutting:
    """How studies are cut into slabs, and who works on them.

    Attributes
    ----------
    cuts : callable
        Takes the shape of an array, and hands over rising slice numbers from 0 to their count.
    slabs : Slabs or None
        Who works on slabs (`tomomesh.slabs.keep`); None for here and now, one after the other.
    """

    cuts: Callable[[tuple[int, ...]], Sequence[int]] = thin_cuts
    slabs: Slabs | None = None

    def of(self, voxels: Voxels) -> Cut:
        """Cut an array."""
        return Cut(voxels, tuple(self.cuts(voxels.shape)), self.slabs)


HERE = Cutting()
"""For studies in memory."""


@dataclass(frozen=True)
class Cut:
    """An array of voxels in slabs.

    Attributes
    ----------
    voxels : (K, J, I) or (K, J, I, L) array
        In memory, or read when it is asked for.
    cuts : tuple of int
        Where slabs begin and end, from 0 to K.
    slabs : Slabs or None
        As of `Cutting`.
    """

    voxels: Any
    cuts: tuple[int, ...]
    slabs: Slabs | None = None

    @property
    def shape(self) -> tuple[int, int, int]:
        """Sizes K, J, I."""
        return self.voxels.shape[0], self.voxels.shape[1], self.voxels.shape[2]

    @property
    def boxes(self) -> list[Box]:
        """The box of each slab."""
        return [(slice(a, b), slice(0, self.shape[1]), slice(0, self.shape[2])) for a, b in pairwise(self.cuts)]

    def within(self, box: Box) -> Cut:
        """Return the voxels of a box, cut in the same places."""
        start, stop = box[0].start, box[0].stop
        inner = [place - start for place in self.cuts if start < place < stop]
        return replace(self, voxels=self.voxels[box], cuts=(0, *inner, stop - start))

    def each(self, work: Callable[..., Any], *columns: Iterable[Any]) -> Iterator[Any]:
        """Hand over what is found in each slab, one after the other.

        Parameters
        ----------
        work : callable
            Of a module, or a partial of one, without side effects: takes the voxels of a slab, its box, and one value
            of each column.
        *columns : iterable
            One value a slab.
        """
        boxes = self.boxes
        parts = [self.voxels[box[0]] for box in boxes]
        if self.slabs is None:
            yield from (work(in_memory(part), *rest) for part, *rest in zip(parts, boxes, *columns, strict=True))
            return
        kept = self.slabs.each(partial(_read_first, work), parts, boxes, *map(list, columns))
        for first in range(0, len(kept), AT_ONCE):
            yield from self.slabs.fetch(kept[first : first + AT_ONCE])

    def sum(self, work: Callable[..., Any], *columns: Iterable[Any]) -> Any:
        """Add up what is found in all slabs: numbers or arrays; parameters are those of `each`."""
        return reduce(np.add, self.each(work, *columns))

    def runs(self, work: Callable[..., RunMask], *columns: Iterable[Any]) -> RunMask:
        """Put the masks that are found in all slabs over one another; parameters are those of `each`."""
        return RunMask.joined(list(self.each(work, *columns)))

    def over(self, mask: RunMask) -> list[RunMask]:
        """Return what lies of a mask in each slab: a column."""
        return [mask.part(a, b) for a, b in pairwise(self.cuts)]

    def made(self, work: Making, dtype: Any) -> Cut:
        """Return other voxels, each made of those in the same place: here where these are, else once they are read.

        Parameters
        ----------
        work : callable
            As of `Made`.
        dtype : dtype
            Of what it makes.
        """
        if isinstance(self.voxels, LazyVoxels):
            return replace(self, voxels=LazyVoxels.of(Made(self.voxels, work, np.dtype(dtype))))
        found = np.empty(self.voxels.shape, dtype)
        for box in self.boxes:
            found[box[0]] = work(self.voxels[box[0]], box)
        return replace(self, voxels=found)

    def sampled(self, *every: Sequence[int]) -> list[NDArray[Any]]:
        """Return every n-th voxel along each axis (K, J, I), brought here, for one or several choices of n."""
        return [np.concatenate(parts) for parts in zip(*self.each(partial(_every, every=every)), strict=True)]

    @cached_property
    def levels(self) -> Levels:
        """What percentiles and histograms of all gray levels follow from."""
        return self.layer(None)

    def layer(self, number: int | None) -> Levels:
        """Return the same of one layer of a study in color."""
        return gathered(lambda work: self.sum(partial(_alone, work, number)), self.voxels.dtype)

    @cached_property
    def ends(self) -> tuple[float, float]:
        """The lowest and the highest level, NaN where any is NaN."""
        if isinstance(self.levels, LevelCounts):
            return self.levels.ends
        lows, highs = zip(*self.each(_ends), strict=True)
        return float(np.minimum.reduce(lows)), float(np.maximum.reduce(highs))


def _read_first(work: Callable[..., Any], part: Voxels, *rest: Any) -> Any:
    return work(in_memory(part), *rest)


def _every(levels: NDArray[Any], box: Box, *, every: Sequence[Sequence[int]]) -> list[NDArray[Any]]:
    return [np.array(levels[-box[0].start % k :: k, ::j, ::i]) for k, j, i in every]


def _alone(work: Looked, layer: int | None, levels: NDArray[Any], box: Box) -> Any:
    return work(levels if layer is None else levels[..., layer])


def _ends(levels: NDArray[Any], box: Box) -> tuple[Any, Any]:
    return levels.min(), levels.max()
