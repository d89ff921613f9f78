"""The faces between the voxels of a window and those outside: how many, some of them, and the nearest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.isosurface.sides import list_sides, nearest_sides
from ..kernels.threads import in_blocks
from ..model.boxes import box_of
from ..model.columns import for_kernels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Mask = NDArray[np.bool_]

WORD, BLOCK = 8, 4
"""Voxels in a word, and along a block. See `tomomesh.kernels.isosurface.sides`."""
SOME = 500
"""Places handled at once. No result depends on it."""


@dataclass(frozen=True)
class WindowSides:
    """The faces of a mask, told from its voxels; `len` counts them.

    Attributes
    ----------
    low : (3,) int array
        Voxel (x, y, z) that is the first of `mask`.
    mask : (K, J, I) bool array
        The box of the window, with a layer outside around it; rows are of whole words.
    """

    low: NDArray[np.int64]
    mask: Mask

    @classmethod
    def of(cls, mask: Mask) -> WindowSides:
        """Look at the faces of a window (K, J, I)."""
        box = box_of(mask)
        k, j, i = (side.stop - side.start for side in box)
        framed = np.zeros((k + 2, j + 2, -(-(i + 2) // WORD) * WORD), np.bool_)
        framed[1:-1, 1:-1, 1 : i + 1] = mask[box]
        return cls(np.array([side.start - 1 for side in box[::-1]]), framed)

    def __len__(self) -> int:
        return self._counted[0]

    @cached_property
    def _counted(self) -> tuple[int, Mask]:
        """Their number, and the blocks that hold any."""
        layers, rows, columns = self.mask.shape
        held = np.zeros((-(-layers // BLOCK), -(-rows // BLOCK), columns // BLOCK), np.bool_)
        return int(list_sides(self.mask.view(np.uint64), 1, np.empty((0, 3)), held)), held

    def some(self, every: int = 1) -> Floats:
        """Return the middles of the first of every so many, (n, 3) as indices (x, y, z)."""
        count, held = self._counted
        places = np.empty((-(-count // every), 3))
        list_sides(self.mask.view(np.uint64), every, places, held)
        return places + self.low

    def distances(self, places: Floats, threads: int = 0) -> Floats:
        """Return the distance of places (p, 3), as indices (x, y, z), to the nearest; infinite where there is none."""
        held, squared = self._counted[1], np.empty(len(places))
        at = for_kernels(places - self.low, np.float64)
        in_blocks(
            lambda start, stop: nearest_sides(self.mask, held, at, squared, start, stop),
            len(at), block=SOME, threads=threads,
        )  # fmt: skip
        return np.asarray(np.sqrt(squared))
