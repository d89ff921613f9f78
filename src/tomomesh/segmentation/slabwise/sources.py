"""Voxels that are made once they are read: of others in the same place, or of a mask of runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...isosurface.run_mask import RunMask
    from ...model.boxes import Box
    from ...model.lazy import LazyVoxels

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

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Return the voxels of a part."""
        return self.work(self.voxels[box].read(), (box[0], box[1], box[2]))


@dataclass(frozen=True)
class Drawn:
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

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Draw a part of it."""
        slices = self.mask[box[0].start : box[0].stop]
        return np.asarray(slices[(slice(None, None, box[0].step), *box[1:])]).view(np.uint8)
