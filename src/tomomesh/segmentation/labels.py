"""Labels of a label map as a window, and where each of them lies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EmptyError, GeometryError, UsageError
from ..isosurface.run_mask import RunMask
from .grid import onto_grid
from .slabwise.cut import HERE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..isosurface.walls.walls import Walls
    from ..model.boxes import Box
    from ..model.volume import Volume
    from .slabwise.cut import Cut, Cutting

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


def whole(labels: Volume, cutting: Cutting = HERE) -> Volume:
    """Round labels that are nearly whole, as other programs' resampling leaves them (3.0000458), with a note.

    Parameters
    ----------
    labels : Volume
    cutting : Cutting, optional
        Who looks at them.

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
    cut = cutting.of(voxels)
    off, worst, counts = zip(*cut.each(_off), strict=True)
    first = int(np.argmax(off))  # of NaN the first
    if not off[first] < NEARLY:
        raise _no_labels(f"{worst[first]:.9g} among {voxels.dtype} numbers")
    if not off[first]:
        return labels
    told = f"labels that are nearly whole, rounded: {sum(counts)} voxels, as {worst[first]:.9g}"
    return replace(labels, voxels=cut.made(_rounded, voxels.dtype).voxels, notes=(*labels.notes, told))


def _off(levels: NDArray[Any], box: Box) -> tuple[Any, Any, int]:
    """Tell how far the worst label is off, which it is, and how many are."""
    with np.errstate(invalid="ignore"):  # what is infinite is NaN off
        off = np.abs(levels - np.rint(levels))
    worst = np.unravel_index(int(off.argmax()), off.shape)
    return off[worst], levels[worst], int(np.count_nonzero(off))


def _rounded(levels: NDArray[Any], box: Box) -> NDArray[Any]:
    return np.asarray(np.rint(levels))


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
    cut : Cut
        The voxels in slabs.
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
    cut: Cut
    walls: Walls | None = None

    @classmethod
    def of(cls, volume: Volume, cutting: Cutting = HERE) -> Labelled:
        """Look at every voxel of a label map once."""
        cut = cutting.of(volume.voxels)
        every, boxes = zip(*cut.each(_labels_of), strict=True)
        numbers, places = np.unique(np.concatenate(every), return_inverse=True)
        found = _none(len(numbers), volume.shape)
        np.minimum.at(found[:, 0], places, np.concatenate(boxes)[:, 0])
        np.maximum.at(found[:, 1], places, np.concatenate(boxes)[:, 1])
        return cls(volume, numbers, found, cut)

    def mask(self, wanted: Sequence[int]) -> RunMask:
        """Return the voxels of some labels: outside of their box none are looked at.

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
        return self.cut.within(box).runs(partial(_chosen, wanted=tuple(wanted))).placed(box, self.volume.shape)


def _chosen(labels: NDArray[Any], box: Box, *, wanted: tuple[int, ...]) -> RunMask:
    return RunMask.of([np.isin(labels, wanted)])


def _labels_of(labels: NDArray[Any], box: Box) -> tuple[Ints, Ints]:
    """Return the labels of a slab, rising, and the box of each in the map."""
    low, high = labels.min(), labels.max()
    if float(high) - float(low) < HIGHEST_LABEL:
        boxes = _boxes(labels, int(low), int(high) - int(low) + 1)
        found = np.flatnonzero(boxes[:, 1, 0])
        numbers, boxes = found + int(low), boxes[found]
    else:
        every, places = np.unique(labels, return_inverse=True)
        numbers, boxes = every.astype(np.int64), _boxes(places.reshape(labels.shape), 0, len(every))
    boxes[:, :, 0] += box[0].start
    return numbers, boxes


def _none(count: int, shape: tuple[int, ...]) -> Ints:
    """Return boxes (count, 2, 3) that hold nothing of a shape: their first voxels behind all, their ends at 0."""
    boxes = np.zeros((count, 2, 3), np.int64)
    boxes[:, 0] = shape
    return boxes


def _boxes(voxels: NDArray[Any], low: int, count: int) -> Ints:
    """Return the boxes (count, 2, 3) of the numbers from a lowest on; empty, and all 0 at their end, where one is not.

    A run, the stretch of a row with one number, is all that is looked at of what lies inside.
    """
    boxes, columns = _none(count, voxels.shape), voxels.shape[2]
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
    return labels_counted(HERE.of(voxels))


def labels_counted(cut: Cut) -> dict[str, int]:
    """Count the labels of a study in slabs: see `labels_in`."""
    if cut.voxels.ndim != 3:
        return {}
    pairs, equal = np.zeros(2, np.int64)
    for found in cut.each(_neighbors):
        if found is None:  # as of most studies the first slab tells
            return {}
        pairs, equal = pairs + found[0], equal + found[1]
    if equal < EVEN * pairs:
        return {}
    counts = cut.sum(_number)
    return {str(label): int(counts[label]) for label in np.flatnonzero(counts) if label > 0}


def _neighbors(levels: NDArray[Any], box: Box) -> tuple[int, int] | None:
    """Count neighbors in rows that are both over 0, and equal ones of them; None where levels are no labels."""
    if not (levels.min() > -NEARLY and levels.max() < HIGHEST_LABEL):
        return None
    if levels.dtype.kind == "f":
        rounded = np.rint(levels)
        if not np.abs(levels - rounded).max() < NEARLY:
            return None
        levels = rounded
    left, right = levels[..., :-1], levels[..., 1:]
    inside = (left > 0) & (right > 0)
    return int(np.count_nonzero(inside)), int(np.count_nonzero((left == right) & inside))


def _number(levels: NDArray[Any], box: Box) -> Ints:
    return np.bincount(np.rint(levels).ravel().astype(np.int64), minlength=HIGHEST_LABEL)


def fitting(labels: Volume, volume: Volume, cutting: Cutting = HERE) -> Volume:
    """Lay a label map onto the study's grid; errors are those of `onto_grid`, with the option that helps."""
    labels = whole(labels, cutting)
    try:
        return onto_grid(labels, volume, cutting)
    except GeometryError as fault:
        if option := volume.other_frame or labels.other_frame:
            whose = "study" if volume.other_frame else "label map"
            fault.args = (f"{fault} Or: {option}, for the {whose} holds two frames that disagree.",)
            fault.flags += (option.split()[0],)
        raise
