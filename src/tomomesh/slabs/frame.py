"""The box of a mask within its volume, and what of both a slab is handed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..isosurface.crossings import Stretch

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..isosurface.means import Span

    Ints = NDArray[np.int32]
    Marks = NDArray[np.bool_]


@dataclass(frozen=True)
class MaskFrame:
    """The box of a mask with one layer of background around it, within a volume.

    Attributes
    ----------
    low : (int, int, int)
        The voxel (z, y, x) of the volume that is its first.
    shape : (int, int, int)
        Its slices, rows and columns.
    volume : (int, int, int)
        Those of the volume.
    """

    low: tuple[int, int, int]
    shape: tuple[int, int, int]
    volume: tuple[int, int, int]

    @property
    def lowest(self) -> Ints:
        """Its first voxel as (x, y, z)."""
        return np.array(self.low[::-1], np.int32)

    def mask_slices(self, start: int, stop: int) -> Span:
        """Return the slices of the volume that the mask can have something in, of some of its own."""
        return max(start, 1) + self.low[0], min(stop, self.shape[0] - 1) + self.low[0]

    def level_slices(self, start: int, stop: int) -> Span:
        """Return the slices of the volume around some of its layers: two behind the ends of the mask, to see beyond."""
        low, high = start - (start == 0), stop + 1 + (stop == self.shape[0] - 1)
        return max(low + self.low[0], 0), min(high + self.low[0], self.volume[0])

    def drawn(self, mask: Any, start: int, stop: int) -> Marks:
        """Draw some of its slices of a mask of those slices of the volume of `mask_slices`."""
        _, rows, columns = self.shape
        found, first = np.zeros((stop - start, rows, columns), np.bool_), max(start, 1) - start
        box = tuple(slice(low + 1, low + size - 1) for low, size in zip(self.low[1:], self.shape[1:], strict=True))
        dense = mask[:][(slice(None), *box)]
        found[first : first + len(dense), 1:-1, 1:-1] = dense
        return found

    def stretch(self, held: Marks, voxels: Any, halo: Span) -> Stretch:
        """Return the levels around a slab: those of a volume, or of the mask that was drawn."""
        z, y, x = self.low
        if voxels is None:
            return Stretch(held, (z + halo[0], y, x), self.volume)
        dense = voxels.read() if hasattr(voxels, "read") else np.asarray(voxels)
        return Stretch(dense, (self.level_slices(*halo)[0], 0, 0), (*self.volume, *dense.shape[3:]))
