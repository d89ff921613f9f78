"""Voxels that are made once they are read: of others in the same place or elsewhere, or of a mask of runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...model.lazy import LazyVoxels, in_memory

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...isosurface.run_mask import RunMask
    from ...model.boxes import Box

    Voxels = NDArray[Any] | LazyVoxels
    Making = Callable[[NDArray[Any], Box], NDArray[Any]]


@dataclass(frozen=True)
class Made:
    """Voxels, each made of the one in the same place.

    Attributes
    ----------
    voxels : LazyVoxels
    work : callable
        Takes the voxels of a box, and the box (K, J, I); as many are made. It can be pickled.
    dtype : dtype
        Of what is made.
    """

    voxels: LazyVoxels
    work: Making
    dtype: np.dtype[Any]

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of all axes."""
        return self.voxels.shape

    @property
    def chunks(self) -> tuple[int, ...]:
        """Those of the others."""
        return self.voxels.chunks

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Return the voxels of a part."""
        return self.work(self.voxels[box].read(), (box[0], box[1], box[2]))


@dataclass(frozen=True)
class MaskVoxels:
    """A mask of runs as voxels of 1 and 0."""

    mask: RunMask

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of all axes."""
        return self.mask.shape

    @property
    def dtype(self) -> np.dtype[Any]:
        """Eight bits."""
        return np.dtype(np.uint8)

    @property
    def chunks(self) -> tuple[int, ...]:
        """Whole slices are drawn."""
        return 1, *self.shape[1:]

    def part(self, start: int, stop: int) -> MaskVoxels:
        """Return some slices alone."""
        return MaskVoxels(self.mask.part(start, stop))

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Draw a part of it."""
        slices = self.mask[box[0].start : box[0].stop]
        return np.asarray(slices[(slice(None, None, box[0].step), *box[1:])]).view(np.uint8)


@dataclass(frozen=True)
class Placed:
    """Voxels in a larger lattice that holds 0 around them.

    Attributes
    ----------
    voxels : (k, j, i) array
        In memory, or read part by part.
    low : (int, int, int)
        Where the first of them lies.
    shape : (int, int, int)
        Of the lattice.
    """

    voxels: Voxels
    low: tuple[int, ...]
    shape: tuple[int, ...]

    @property
    def dtype(self) -> np.dtype[Any]:
        """That of the voxels."""
        return self.voxels.dtype

    @property
    def chunks(self) -> tuple[int, ...]:
        """Those of the voxels."""
        return self.voxels.chunks if isinstance(self.voxels, LazyVoxels) else self.shape

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Return the voxels of a part."""
        places = [range(self.shape[axis])[side] for axis, side in enumerate(box)]
        found = np.zeros(tuple(map(len, places)), self.dtype)
        sides = list(zip(places, self.low, self.voxels.shape, strict=True))
        held = [slice(_from(place, low), _from(place, low + size)) for place, low, size in sides]
        inner = [place[part] for place, part in zip(places, held, strict=True)]
        if all(map(len, inner)):
            own = (
                slice(one.start - low, one[-1] + 1 - low, one.step) for one, low in zip(inner, self.low, strict=True)
            )
            found[tuple(held)] = in_memory(self.voxels[tuple(own)])
        return found


def _from(places: range, low: int) -> int:
    """Return how many places lie before one."""
    return min(max(0, -((places.start - low) // places.step)), len(places))
