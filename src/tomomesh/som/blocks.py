"""Inputs in blocks of near ones, each of which looks at few neurons."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.som.search import BLOCK, best_matching_units, sort_into_blocks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Blocks:
    """Inputs as `tomomesh.kernels.som.search.sort_into_blocks` lays them out.

    Attributes
    ----------
    count : int
        Inputs n; the last is repeated to fill the last block.
    order : (b * BLOCK,) int array
        Which input stands where.
    places : (d, b * BLOCK) float array
    boxes : (2, d, b) float array
    """

    count: int
    order: NDArray[np.uint32]
    places: Floats
    boxes: Floats

    @classmethod
    def of(cls, by_axis: Floats, box: Floats) -> Blocks:
        """Sort inputs (d, n), d > 1, that lie in a box (2, d)."""
        d, n = by_axis.shape
        blocks = -(-n // BLOCK)
        found = cls(n, np.empty(blocks * BLOCK, np.uint32), np.empty((d, blocks * BLOCK)), np.empty((2, d, blocks)))
        sort_into_blocks(by_axis, box, found.order, found.places, found.boxes)
        return found

    def match(self, codebook: Floats) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Return the winner of each input and the squared distance to it (eq. 1), for neurons (d, u)."""
        winners, squared = np.empty(len(self.order), np.int32), np.empty(len(self.order), np.float32)
        best_matching_units(codebook, self.places, self.boxes, winners, squared)
        found = np.empty(self.count, np.int32), np.empty(self.count, np.float32)
        for values, own in zip((winners, squared), found, strict=True):
            own[self.order] = values
        return found

    def filled(self, weights: Floats | None) -> Floats:
        """Return weights (n,), or 1 each, in the order of the blocks; what fills the last block has none."""
        shown = np.ones(len(self.order)) if weights is None else weights[self.order]
        shown[self.count :] = 0.0
        return shown
