"""Thick slices: their voxels divided, and what is in each moved to where its neighbors have theirs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from .averages import beside_border
from .content import content_of
from .crossings import Levels
from .parts import parts_within

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .content import Content

    Mask = NDArray[np.bool_]
    Values = NDArray[np.float32]
    Index = NDArray[np.int32]

THICK = 1.5
"""Slice distance over the width of a pixel from which voxels are divided. Derived: the number of parts
is that ratio, rounded, and from there on it is two."""
MOST_PARTS = 16
"""Parts of a voxel at most, so that the thin voxels of a window, a byte each, stay bounded. Chosen: slices of 4 mm on
pixels of .25 mm have as many; half leaves their parts twice as high as wide, twice changes thicker slices alone."""
AROUND = np.ones((3, 3, 3), np.bool_)
"""A voxel and those that touch it."""


@dataclass(frozen=True)
class Columns:
    """Voxels of which some are divided along an axis: it is indexed as the array of all thin voxels would be.

    Attributes
    ----------
    whole : (K, J, I) float32 array
        What the voxels hold; the first axis is the one that is divided.
    index : (K, J, I) int32 array
        The column of each voxel; -1 where it is not divided.
    parts : (m, n) float32 array
    axis : int
        Where the divided axis stands in the array that this stands for.
    """

    whole: Values
    index: Index
    parts: Values
    axis: int

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of the array of thin voxels."""
        sizes = [len(self.whole) * self.parts.shape[1], *self.whole.shape[1:]]
        sizes.insert(self.axis, sizes.pop(0))
        return tuple(sizes)

    def __getitem__(self, places: tuple[Index, Index, Index]) -> Values:
        """Return what thin voxels hold, given as indices along the three axes."""
        order = list(places)
        across = order.pop(self.axis)
        row, column = order
        whole, part = np.divmod(across, self.parts.shape[1])
        found = self.index[whole, row, column]
        return np.asarray(np.where(found >= 0, self.parts[found, part], self.whole[whole, row, column]))


@dataclass(frozen=True)
class Thinned:
    """What is found in thin voxels.

    Attributes
    ----------
    levels : Levels
    mask : (K, J, I) bool array
        The thin voxels that are kept.
    affine : (4, 4) float array
    parts : int
        Into how many each voxel was divided.
    of_mask : bool
        Whether the levels come from a mask.
    bending : float
        How stiff a net around them is against bends, over the stiffness that is set.
    """

    levels: Levels
    mask: Mask
    affine: NDArray[np.float64]
    parts: int
    of_mask: bool
    bending: float


def parts_of(affine: NDArray[np.float64]) -> tuple[int, int]:
    """Return the axis (0 for x) across which voxels are thick, and into how many parts they are divided: 1 for none.

    As many as make a part most like a cube, by the mean width of the two other axes.
    """
    spacing = np.sqrt((affine[:3, :3] ** 2).sum(axis=0))
    axis = int(np.argmax(spacing))
    ratio = float(spacing[axis] / np.sqrt(np.delete(spacing, axis).prod()))
    return axis, min(round(ratio), MOST_PARTS) if ratio >= THICK else 1


def thinned(levels: Levels, mask: Mask, affine: NDArray[np.float64], threads: int = 0) -> Thinned | None:
    """Divide the voxels of thick slices along the border of a window.

    A voxel of a thick slice holds the average of what lies in it. Which of its parts hold more is told by the voxels
    around it, above and below too: the parts follow the average of their neighbors, made as sharp as borders within a
    slice are, and keep the voxel's own average, round after round. A mask is first given the averages that it would
    have, if its borders went on to where they are in the next slices. Where all but all voxels hold one of two levels,
    what lies between them is of both: a voxel outside the window that holds enough of the inside to fill a part is
    divided too, so that sheets thinner than a slice stay whole.

    Parameters
    ----------
    levels : Levels
    mask : (K, J, I) bool array
        The voxels that are kept; those of the window that are not stay outside.
    affine : (4, 4) float array
    threads : int

    Returns
    -------
    Thinned or None
        None where no axis is thick, no voxel lies beside the border, or voxels have several layers.

    Notes
    -----
    After constrained auction dynamics (Jacobs, Merkurjev & Esedoglu 2018), where a smoothed indicator is cut off so
    that volumes stay: here the volume of each voxel does.
    """
    along, times = parts_of(affine)
    if times == 1 or len(levels.voxels.shape) > 3:
        return None
    axis = 2 - along
    turned = np.ascontiguousarray(np.moveaxis(mask, axis, 0))
    content = content_of(levels, mask, turned, axis, threads)
    whole, bounds = content.whole, content.bounds
    mixed = _mixed(turned, content, times)
    columns = _divided(turned, whole, mixed)
    if not len(columns):
        return None
    index = np.full(turned.shape, -1, np.int32)
    index[tuple(columns.T)] = np.arange(len(columns), dtype=np.int32)
    parts = parts_within(content, mixed, index, columns, times, threads)
    thin = Levels(Columns(whole, index, parts, axis), bounds.lower, bounds.upper)
    kept = np.moveaxis(_kept(content, turned, columns, parts), 0, axis)
    fine = finer(affine, along, times)
    return Thinned(thin, np.ascontiguousarray(kept), fine, times, content.of_mask, content.bending)


def _divided(mask: Mask, whole: Values, mixed: Mask) -> Index:
    """Return the voxels (m, 3) that are divided: mixed and beside the border, if all levels around are known."""
    beside, known = beside_border(mask) | mixed, np.isfinite(whole)
    if not known.all():
        beside &= known & ~beside_border(known)
    return np.ascontiguousarray(np.argwhere(beside), np.int32)


def _mixed(mask: Mask, content: Content, times: int) -> Mask:
    """Tell which voxels hold enough of both of two levels to fill a part, and hang together with those that are kept.

    What is three voxels thick holds a level of its own; what touches a voxel of the window that was left out belongs
    to that.
    """
    mixed = content.mixed(times)
    if not mixed.any():
        return mixed
    mixed &= ~scipy.ndimage.binary_opening(mixed, AROUND)
    left_out = content.bounds.kept(content.whole) & ~mask
    if left_out.any():
        mixed &= ~scipy.ndimage.binary_dilation(left_out, AROUND)
    pieces, count = scipy.ndimage.label(mask | mixed, AROUND)
    kept = np.zeros(count + 1, np.bool_)
    kept[pieces[mask]] = True
    return np.asarray(mixed & kept[pieces])


def _kept(content: Content, mask: Mask, columns: Index, parts: Values) -> Mask:
    """Tell which thin voxels are kept: of voxels that were left out, or filled, all parts as they were."""
    place = tuple(columns.T)
    inside = content.kept(parts)
    as_before = content.bounds.kept(content.whole[place]) != mask[place]
    inside[as_before] = mask[place][as_before][:, None]
    thin = np.repeat(mask[:, None], parts.shape[1], axis=1)
    k, j, i = place
    thin[k, :, j, i] = inside
    return thin.reshape(-1, *mask.shape[1:])


def finer(affine: NDArray[np.float64], along: int, times: int) -> NDArray[np.float64]:
    """Return where the parts of voxels are."""
    fine = affine.copy()
    fine[:3, along] /= times
    fine[:3, 3] -= 0.5 * (times - 1) * fine[:3, along]
    return fine
