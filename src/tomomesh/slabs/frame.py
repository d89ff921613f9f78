"""The box of a mask within its volume, and what of both a slab is handed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..isosurface.crossings import Stretch
from ..isosurface.run_mask import RunMask

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

    @property
    def _box(self) -> tuple[slice, slice]:
        """Rows and columns of the volume that are its own, but for the background around them."""
        (_, y, x), (_, rows, columns) = self.low, self.shape
        return slice(y + 1, y + rows - 1), slice(x + 1, x + columns - 1)

    def framed(self, mask: RunMask) -> RunMask:
        """Return a mask of the volume in the frame."""
        box, (slices, rows, columns) = (slice(*self.mask_slices(0, self.shape[0])), *self._box), self.shape
        inner = slice(1, slices - 1), slice(1, rows - 1), slice(1, columns - 1)
        return mask.cropped(box).placed(inner, self.shape)

    def drawn(self, mask: Any, start: int, stop: int, threads: int = 1) -> Marks:
        """Draw some of its slices of a mask of those slices of the volume of `mask_slices`."""
        _, rows, columns = self.shape
        found, first = np.zeros((stop - start, rows, columns), np.bool_), max(start, 1) - start
        if isinstance(mask, RunMask):
            slices, inner = slice(0, mask.shape[0]), (slice(1, rows - 1), slice(1, columns - 1))
            own = mask.cropped((slices, *self._box)).placed((slices, *inner), (mask.shape[0], rows, columns))
            own.fill(found[first : first + mask.shape[0]], np.ones(len(own.starts), np.bool_), True, threads)
        else:
            found[first : first + len(mask), 1:-1, 1:-1] = mask[(slice(None), *self._box)]
        return found

    def stretch(self, held: Marks, voxels: Any, halo: Span) -> Stretch:
        """Return the levels around a slab: those of a volume, or of the mask that was drawn."""
        z, y, x = self.low
        if voxels is None:
            return Stretch(held, (z + halo[0], y, x), self.volume)
        dense = voxels.read() if hasattr(voxels, "read") else np.asarray(voxels)
        return Stretch(dense, (self.level_slices(*halo)[0], 0, 0), (*self.volume, *dense.shape[3:]))
