"""Labels of a label map as a window, and where each of them lies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EmptyError, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..isosurface.walls.walls import Walls
    from ..model.boxes import Box
    from ..model.volume import Volume

    Ints = NDArray[np.int64]

NAMED = 24
"""Labels that are named where one is missing, at most. So that an error stays a line."""
MOST = 4096
"""Labels over which a label map is doubted. A warning's threshold, chosen: maps at hand have 2 to 54."""
HIGHEST_LABEL = 2**16
"""A volume with higher levels is no label map. Label maps have 8 or 16 bits."""
EVEN = 0.8
"""Share of equal neighbors, among those that are both over 0, from which levels are labels. Measured: 0.86 to 1.00 in
label maps, 0.03 to 0.22 in images."""


NEARLY = 1e-3
"""How far from a whole number a label may be: what 32-bit floats lose of 3 by interpolation is 1e-5 and less, and half
a label would be a mixture of two."""


def whole(labels: Volume) -> Volume:
    """Round labels that are nearly whole, as other programs' resampling leaves them (3.0000458), with a note.

    Parameters
    ----------
    labels : Volume

    Raises
    ------
    UsageError
        Where the volume is no label map; it shows the number that is furthest from a whole one.
    """
    voxels = labels.voxels
    if voxels.ndim != 3:
        raise _no_labels(f"{voxels.dtype}, {voxels.ndim - 2} layer(s)")
    if voxels.dtype.kind != "f":
        return labels
    rounded = np.rint(voxels)
    with np.errstate(invalid="ignore"):  # what is infinite is NaN off
        off = np.abs(voxels - rounded)
    worst = np.unravel_index(int(off.argmax()), off.shape)
    if not off[worst] < NEARLY:
        raise _no_labels(f"{voxels[worst]:.9g} among {voxels.dtype} numbers")
    if not off[worst]:
        return labels
    told = f"labels that are nearly whole, rounded: {int(np.count_nonzero(off))} voxels, as {voxels[worst]:.9g}"
    return replace(labels, voxels=rounded, notes=(*labels.notes, told))


def _no_labels(found: str) -> UsageError:
    return UsageError("the labels are no whole numbers", found=found, expected="a label map of one layer")


@dataclass(frozen=True)
class Labelled:
    """A label map, its labels, and where they lie.

    Attributes
    ----------
    volume : Volume
        Of `whole`.
    numbers : (n,) int64 array
        Its labels in order, 0 among them where it has it.
    boxes : (n, 2, 3) int64 array
        First slice, row and column of each, and those behind its last.
    walls : Walls or None
        Between all of them, where neighbors share them.

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
    walls: Walls | None = None

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


def doubted(labels: Labelled) -> tuple[str, ...]:
    """Say why a volume may be no label map: a study's gray levels can be taken for labels."""
    count, kind = len(labels.numbers), labels.volume.voxels.dtype
    if labels.volume.unit == "HU":
        return ("labels were chosen in a study in Hounsfield units: --lower and --upper choose gray levels",)
    if kind.kind == "f":
        return (f"the label map holds {kind} numbers: it may be a study of gray levels",)
    return (f"the label map has {count} labels: it may be a study of gray levels",) if count > MOST else ()


def labels_in(voxels: NDArray[Any]) -> dict[str, int]:
    """Count the voxels of each label over 0; nothing where the levels do not look like labels.

    Labels are whole numbers in flat regions: neighbors over 0 are mostly equal, which those of an image are not.

    Parameters
    ----------
    voxels : (K, J, I[, L]) array
    """
    if not (voxels.ndim == 3 and voxels.min() > -NEARLY and voxels.max() < HIGHEST_LABEL):
        return {}
    if voxels.dtype.kind == "f":
        rounded = np.rint(voxels)
        if not np.abs(voxels - rounded).max() < NEARLY:
            return {}
        voxels = rounded
    left, right = voxels[..., :-1], voxels[..., 1:]
    inside = (left > 0) & (right > 0)
    pairs = int(np.count_nonzero(inside))
    if np.count_nonzero((left == right) & inside) < EVEN * pairs:
        return {}
    counts = np.bincount(voxels.ravel().astype(np.int64))
    return {str(label): int(counts[label]) for label in np.flatnonzero(counts) if label > 0}
