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
from ..model.sliced import some_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.boxes import Box
    from ..model.sliced import Sliced

    Floats = NDArray[np.float64]
    Mask = NDArray[np.bool_]

WORD, BLOCK = 8, 4
"""Voxels in a word, and along a block. See `tomomesh.kernels.isosurface.sides`."""
SOME = 500
"""Places handled at once. No result depends on it."""
LAYERS = 32
"""Slices looked at together, whole blocks. Only memory and time depend on it: a place may have its nearest face in the
next ones. Half and twice of it take as long, within a tenth."""


@dataclass(frozen=True)
class WindowSides:
    """The faces of a mask, told from its voxels, some slices at a time; `len` counts them.

    Slices, rows and columns are counted from a layer outside around the mask's box.

    Attributes
    ----------
    mask : (K, J, I) bool array or slices of it
    box : box
        Of what it holds.
    """

    mask: Sliced
    box: Box

    @classmethod
    def of(cls, mask: Sliced) -> WindowSides:
        """Look at the faces of a window (K, J, I)."""
        return cls(mask, box_of(mask))

    def __len__(self) -> int:
        return self._count

    @cached_property
    def _count(self) -> int:
        return self._listed(1, np.empty((0, 3)))

    @property
    def low(self) -> NDArray[np.int64]:
        """The voxel (x, y, z) that is the first of the layer around the box."""
        return np.array([side.start - 1 for side in self.box[::-1]])

    @property
    def layers(self) -> int:
        """Slices of the box and of the layer around it."""
        return int(self.box[0].stop - self.box[0].start) + 2

    def some(self, every: int = 1) -> Floats:
        """Return the middles of the first of every so many, (n, 3) as indices (x, y, z)."""
        places = np.empty((-(-len(self) // every), 3))
        self._listed(every, places)
        return places + self.low

    def _listed(self, every: int, places: Floats) -> int:
        """List the first of every so many, as long as there is room; return the number of all."""
        found = 0
        for first in range(0, self.layers, LAYERS):
            words = self._drawn(first).view(np.uint64)
            found = int(list_sides(words, every, places, _blocks(words), first, found))
        return found

    def _drawn(self, first: int) -> Mask:
        """Draw some layers, and the one that follows them; rows are of whole words."""
        k, j, i = self.box
        start, stop = k.start - 1 + first, min(k.start + first + LAYERS, k.stop + 1)
        low, high = max(start, k.start), min(stop, k.stop)
        rows, columns = j.stop - j.start, i.stop - i.start
        framed = np.zeros((stop - start, rows + 2, -(-(columns + 2) // WORD) * WORD), np.bool_)
        framed[low - start : high - start, 1:-1, 1 : columns + 1] = some_of(self.mask, low, high)[:, j, i]
        return framed

    def distances(self, places: Floats, threads: int = 0) -> Floats:
        """Return the distance of places (p, 3), as indices (x, y, z), to the nearest; infinite where there is none.

        First each place looks among the layers that it lies in, then among others that are no farther than what it
        has found.
        """
        at, squared = for_kernels(places - self.low, np.float64), np.full(len(places), np.inf)
        starts = np.arange(0, self.layers, LAYERS)
        away = np.maximum(np.maximum(starts - at[:, 2:], at[:, 2:] - starts - LAYERS), 0.0)
        own = np.argmin(away, axis=1)
        for nearby in (True, False):
            for n, first in enumerate(starts.tolist()):
                wanted = (own == n) == nearby
                if not nearby:
                    wanted &= away[:, n] ** 2 < squared
                if wanted.any():
                    squared[wanted] = self._nearest(first, at[wanted], squared[wanted], threads)
        return np.asarray(np.sqrt(squared))

    def _nearest(self, first: int, at: Floats, squared: Floats, threads: int) -> Floats:
        """Return the squared distances of places to the nearest face of some layers, where that is less."""
        mask = self._drawn(first)
        words = mask.view(np.uint64)
        blocks = _blocks(words)
        list_sides(words, 1, np.empty((0, 3)), blocks, first, 0)
        in_blocks(
            lambda start, stop: nearest_sides(mask, blocks, first, at, squared, start, stop),
            len(at), block=SOME, threads=threads,
        )  # fmt: skip
        return squared


def _blocks(words: NDArray[np.uint64]) -> Mask:
    """Return a place for every block of some layers."""
    layers, rows, columns = words.shape
    return np.zeros((-(-layers // BLOCK), -(-rows // BLOCK), columns * WORD // BLOCK), np.bool_)
