"""Levels that say something near a surface alone: drawn once, and kept as what they are there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..isosurface.run_mask import RunMask
from .keep import File, mapped

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from numpy.typing import NDArray

    Levels = NDArray[np.float32]


@dataclass(frozen=True)
class NearLevels:
    """Some slices of levels that are as high or as low as they can be but near a surface.

    Attributes
    ----------
    inside, near : RunMask
        Where they are over 0, and where they are between the highest and the lowest.
    levels : (n,) float32 array
        What they are there, in the order of the voxels; or what stands for them on a disk.
    most : float32
        The highest; the lowest is less than 0 by as much.
    """

    inside: RunMask
    near: RunMask
    levels: Any
    most: np.float32

    @classmethod
    def of(cls, levels: Levels, most: np.float32, file: File, threads: int = 0) -> NearLevels:
        """Keep levels (k, J, I); what they are near the surface goes into a file."""
        near = (-most < levels) & (levels < most)
        return cls(RunMask.of([levels > 0], threads), RunMask.of([near], threads), file.put(levels[near]), most)

    def part(self, start: int, stop: int) -> NearLevels:
        """Return some of the slices."""
        before, held = (self.near.begin[[0, self.near.shape[1] * k]] for k in (start, stop))
        first, last = (int(self.near.sizes[: int(one[1])].sum(dtype=np.int64)) for one in (before, held))
        some, near = mapped(self.levels)[first:last], self.near.part(start, stop)
        return replace(self, inside=self.inside.part(start, stop), near=near, levels=some)

    def draw(self, found: Levels) -> None:
        """Draw the levels (k, J, I)."""
        found.fill(-self.most)
        np.copyto(found, self.most, where=self.inside[:])
        found[self.near[:]] = mapped(self.levels)


@dataclass(frozen=True)
class NearSurface:
    """All slices of such levels, in parts, that are drawn as they are read.

    Attributes
    ----------
    parts : list of NearLevels
        Consecutive.
    """

    parts: list[NearLevels]

    dtype = np.dtype(np.float32)
    ndim = 3

    @classmethod
    def of(cls, parts: Iterable[Levels], most: np.float32, folder: Path, threads: int = 0) -> NearSurface:
        """Keep consecutive slices, one after the other, on a disk.

        Parameters
        ----------
        parts : iterable of (k, J, I) float32 arrays
        most : float32
            The highest that there can be, and the lowest below 0.
        folder : path
        threads : int
        """
        file = File(folder)
        keep = partial(NearLevels.of, most=most, file=file, threads=threads)
        return cls([*map(keep, parts)])  # which lets go of one before the next is drawn

    @property
    def shape(self) -> tuple[int, int, int]:
        """Slices, rows and columns."""
        return self.inside.shape

    @property
    def inside(self) -> RunMask:
        """Where levels are over 0."""
        return RunMask.joined([part.inside for part in self.parts])

    def __getitem__(self, slices: slice) -> NearSurface:
        """Return some of the slices, not drawn yet: what of these is on the disk stays there."""
        start, stop, _ = slices.indices(self.shape[0])
        ends = np.cumsum([part.inside.shape[0] for part in self.parts]).tolist()
        firsts = [0, *ends[:-1]]
        return NearSurface(
            [
                part.part(max(start - first, 0), min(stop, last) - first)
                for part, first, last in zip(self.parts, firsts, ends, strict=True)
                if max(start, first) < min(stop, last)
            ]
        )

    def read(self) -> Levels:
        """Draw them."""
        found, first = np.empty(self.shape, np.float32), 0
        for part in self.parts:
            last = first + part.inside.shape[0]
            part.draw(found[first:last])
            first = last
        return found
