"""A label map whose labels are known: which there are, and the box of each, found in one pass over the voxels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EmptyError
from .labels import HIGHEST_LABEL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..model.boxes import Box
    from ..model.volume import Volume

    Ints = NDArray[np.int64]

NAMED = 24
"""Labels that are named where one is missing, at most. So that an error stays a line."""


@dataclass(frozen=True)
class Labelled:
    """A label map, its labels, and where they lie.

    Attributes
    ----------
    volume : Volume
        Of `tomomesh.segmentation.labels.whole`.
    numbers : (n,) int64 array
        Its labels in order, 0 among them where it has it.
    boxes : (n, 2, 3) int64 array
        First slice, row and column of each, and those behind its last.

    Examples
    --------
    >>> from tomomesh import Volume
    >>> found = Labelled.of(Volume.from_stored(np.array([[[0, 7, 7, 0, -2]]]), np.eye(4)))
    >>> found.numbers.tolist(), found.boxes[:, :, 2].tolist()
    ([-2, 0, 7], [[4, 5], [0, 4], [1, 3]])
    """

    volume: Volume
    numbers: Ints
    boxes: Ints

    @classmethod
    def of(cls, volume: Volume) -> Labelled:
        """Look at every voxel of a label map once."""
        voxels = volume.voxels
        low, high = voxels.min(), voxels.max()
        if float(high) - float(low) < HIGHEST_LABEL:
            boxes = _boxes(voxels, int(low), int(high) - int(low) + 1)
            found = np.flatnonzero(boxes[:, 1, 0])
            return cls(volume, found + int(low), boxes[found])
        numbers, places = np.unique(voxels, return_inverse=True)
        return cls(volume, numbers.astype(np.int64), _boxes(places.reshape(voxels.shape), 0, len(numbers)))

    def mask(self, wanted: Sequence[int]) -> tuple[NDArray[np.bool_], Box]:
        """Return the voxels of some labels (K, J, I), and the box that they lie in: no others are looked at.

        Raises
        ------
        EmptyError
            Where there is no such label; names those that there are.
        """
        missing = np.setdiff1d(wanted, self.numbers)
        if len(missing):
            named = ", ".join(map(str, self.numbers[:NAMED])) + (", ..." if len(self.numbers) > NAMED else "")
            raise EmptyError(
                "the label map has no such label", found=f"--select = {', '.join(map(str, missing))}",
                expected=f"labels among {named}",
            )  # fmt: skip
        boxes = self.boxes[np.isin(self.numbers, wanted)]
        low, high = boxes[:, 0].min(axis=0).tolist(), boxes[:, 1].max(axis=0).tolist()
        box = slice(low[0], high[0]), slice(low[1], high[1]), slice(low[2], high[2])
        mask = np.zeros(self.volume.shape, np.bool_)  # what is not written takes no memory
        mask[box] = np.isin(self.volume.voxels[box], wanted)
        return mask, box


def _boxes(voxels: NDArray[Any], low: int, count: int) -> Ints:
    """Return the boxes (count, 2, 3) of the numbers from a lowest on; empty, and all 0 at their end, where one is not.

    A run, the stretch of a row with one number, is all that is looked at of what lies inside.
    """
    boxes = np.zeros((count, 2, 3), np.int64)
    boxes[:, 0] = voxels.shape
    columns = voxels.shape[2]
    for k, plane in enumerate(voxels):
        flat = np.ascontiguousarray(plane).ravel()
        starts = np.flatnonzero(np.append(True, flat[1:] != flat[:-1]) | (np.arange(flat.size) % columns == 0))
        label = flat[starts].astype(np.int64) - low
        first = np.column_stack([np.full(len(starts), k), starts // columns, starts % columns])
        last = np.append(starts[1:], flat.size) - starts + first[:, 2]
        np.minimum.at(boxes[:, 0], label, first)
        np.maximum.at(boxes[:, 1], label, np.column_stack([first[:, :2] + 1, last]))
    return boxes
