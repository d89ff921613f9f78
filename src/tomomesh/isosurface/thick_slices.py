"""Thick slices: their voxels divided, and what is in each moved to where its neighbors have theirs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.isosurface.columns import move_within_columns, ranges_around
from ..kernels.threads import in_blocks
from .averages import averages_of, beside_border
from .crossings import EVENED, SAMPLES, STEPPED, Levels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Mask = NDArray[np.bool_]
    Values = NDArray[np.float32]
    Index = NDArray[np.int32]

THICK = 1.5
"""Slice distance over the width of a pixel from which voxels are divided. Derived: the number of parts
is that ratio, rounded, and from there on it is two."""
MOST_PARTS = 16
"""Parts of a voxel at most, so that the thin voxels of a window, a byte each, stay bounded. Chosen: slices of 4 mm on
pixels of .25 mm have as many; half leaves their parts twice as high as wide, twice changes thicker slices alone."""
ROUNDS = 2
"""Times that the parts follow their neighbors. Chosen on slabs of a label head and of an MR, as all numbers below: half
changes the distance to the thin study by +0.8 to +3.4 %, twice by less than 1 %."""
BLOCK = 4_000
"""Columns handled in one call: far below 100 ms."""
RAMP, SHARPEST = 1 / 3, 5.0
"""Share of a border's height between two pixels where it is a ramp over four, the least sharp that can be told; and
the greatest sharpness. Chosen: half of the latter changes the distance of partial volumes by +4 %, twice by -0.5 %, and
turns 7 % more."""
OF_MASK = 2.0
"""Sharpness of what comes from a mask, which tells nothing of it. Chosen: half changes the distance by +11 %, twice by
-0.8 % with 5 % more turns."""
OF_LEVELS, OF_STEPS = 12.0, 22.0
"""How stiff a net is against bends, over the stiffness that is set, around thin voxels, and around those that are all
but wholly in or out, whose steps it shall not follow. Chosen where faces turn as much as after a windowed sinc filter:
half of the first changes the distance by -1 % and the turns by +7 %, twice by +3 and -5 %; half of the second by -12
and +33 %, twice by +11 and -22 %."""
UPRIGHT = 90
"""Percentile of the shares that tells how sharp borders are: where they slant, pixels hold a part of both sides, and
look less sharp than they are. Chosen: 75 and 95 change the distance by 1 % at most; 75 turns 16 % more on partial
volumes."""


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
    have, if its borders went on to where they are in the next slices.

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
    content = _content_of(levels, mask, turned, axis, threads)
    whole, bounds = content.whole, content.bounds
    columns = _divided(turned, whole)
    if not len(columns):
        return None
    index = np.full(turned.shape, -1, np.int32)
    index[tuple(columns.T)] = np.arange(len(columns), dtype=np.int32)
    parts = _moved(whole, index, columns, times, content.sharpness, threads)
    thin = Levels(Columns(whole, index, parts, axis), bounds.lower, bounds.upper)
    kept = np.moveaxis(_kept(bounds, turned, whole, columns, parts), 0, axis)
    fine = _finer(affine, along, times)
    return Thinned(thin, np.ascontiguousarray(kept), fine, times, content.of_mask, content.bending)


@dataclass(frozen=True)
class Content:
    """What voxels hold, the first axis across the slices, the window on that, and what its borders are like."""

    whole: Values
    bounds: Levels
    sharpness: float
    bending: float
    of_mask: bool = False


def _content_of(levels: Levels, mask: Mask, turned: Mask, axis: int, threads: int) -> Content:
    """Return the gray levels, or the averages that a mask would have."""
    voxels = np.asarray(levels.voxels)
    shares = _shares(levels, mask, axis)
    if _are_steps(shares) or _are_two(levels, mask):
        return Content(averages_of(turned, threads), Levels(voxels, 0.5, np.inf), OF_MASK, EVENED, of_mask=True)
    whole = np.ascontiguousarray(np.moveaxis(voxels, axis, 0), np.float32)
    high = float(np.percentile(shares, UPRIGHT)) if len(shares) else 1.0
    sharpness = min(1 + max(high - RAMP, 0) / max(2 * (1 - high), 1e-9), SHARPEST)
    return Content(whole, levels, sharpness, OF_STEPS if high > STEPPED else OF_LEVELS)


def _shares(levels: Levels, mask: Mask, axis: int) -> NDArray[np.float64]:
    """Return what share of a border's height lies between two pixels of a slice, at some of its places.

    The height is that between four pixels in a line, two inside and two outside, and those of the next slices beside
    the middle two: where a border slants, these have the whole of it.
    """
    across = np.zeros(3, np.int32)
    across[2 - axis] = 1
    found = [_shares_of(levels, *_faces_across(mask, other), across) for other in range(3) if other != axis]
    return np.concatenate(found)


def _shares_of(levels: Levels, inner: Index, steps: Index, across: Index) -> NDArray[np.float64]:
    places = [inner - steps, inner + 2 * steps, inner, inner + steps]
    places += [place + side for place in places[2:] for side in (across, -across)]
    before, after, *seen = (levels.at(place)[:, 0] for place in places)
    height = np.fmax.reduce([before, after, *seen]) - np.fmin.reduce([before, after, *seen])
    clear = levels.inside(before[:, None]) & ~levels.inside(after[:, None]) & (height > 0)
    shares = np.abs(seen[0] - seen[1])[clear] / height[clear]
    return np.asarray(shares[np.isfinite(shares)])


def _faces_across(mask: Mask, axis: int) -> tuple[Index, Index]:
    """Return some voxels (q, 3) inside whose next along an axis is outside, as (x, y, z), and the steps to those."""
    before, after = (np.moveaxis(mask, axis, 0)[side] for side in (slice(None, -1), slice(1, None)))
    places = np.flatnonzero(before != after)
    places = places[:: -(-len(places) // SAMPLES) or 1]
    low = np.stack(np.unravel_index(places, before.shape), axis=1).astype(np.int32)
    inward = after.reshape(-1)[places] if after.flags.c_contiguous else after[tuple(low.T)]
    low[:, 0] += inward
    step = np.zeros_like(low)
    step[:, 0] = np.where(inward, -1, 1)
    order = np.argsort([axis, *(other for other in range(3) if other != axis)])
    return low[:, order[::-1]], step[:, order[::-1]]


def _are_steps(shares: NDArray[np.float64]) -> bool:
    return len(shares) > 0 and bool(np.median(shares) > STEPPED)


def _are_two(levels: Levels, mask: Mask) -> bool:
    """Tell whether the levels on both sides of the border are those of a mask, however thin what it holds is."""
    faces = [_faces_across(mask, axis) for axis in range(3)]
    inner, steps = (np.concatenate(each) for each in zip(*faces, strict=True))
    return levels.are_two(inner, inner + steps)


def _divided(mask: Mask, whole: Values) -> Index:
    """Return the voxels (m, 3) that are divided: those beside the border, if all levels around are known."""
    beside, known = beside_border(mask), np.isfinite(whole)
    if not known.all():
        beside &= known & ~beside_border(known)
    return np.ascontiguousarray(np.argwhere(beside), np.int32)


def _kept(bounds: Levels, mask: Mask, whole: Values, columns: Index, parts: Values) -> Mask:
    """Tell which thin voxels are kept: of voxels that were left out, or filled, all parts as they were."""
    place = tuple(columns.T)
    inside = bounds.kept(parts)
    as_before = bounds.kept(whole[place]) != mask[place]
    inside[as_before] = mask[place][as_before][:, None]
    thin = np.repeat(mask[:, None], parts.shape[1], axis=1)
    k, j, i = place
    thin[k, :, j, i] = inside
    return thin.reshape(-1, *mask.shape[1:])


def _finer(affine: NDArray[np.float64], along: int, times: int) -> NDArray[np.float64]:
    """Return where the parts of voxels are."""
    fine = affine.copy()
    fine[:3, along] /= times
    fine[:3, 3] -= 0.5 * (times - 1) * fine[:3, along]
    return fine


def _interpolated(whole: Values, columns: Index, times: int) -> Values:
    """Return what lies on the way from each voxel to the next slices (m, n)."""
    k, j, i = columns.T
    below, middle, above = (whole[np.clip(k + s, 0, len(whole) - 1), j, i][:, None] for s in (-1, 0, 1))
    way = (np.arange(times, dtype=np.float32) + np.float32(0.5)) / times - np.float32(0.5)
    return np.asarray(middle + np.where(way < 0, way * (middle - below), way * (above - middle)), np.float32)


def _moved(whole: Values, index: Index, columns: Index, times: int, sharpness: float, threads: int) -> Values:
    """Move what is in the parts of the columns to where their neighbors have theirs."""
    low, high = np.empty(len(columns), np.float32), np.empty(len(columns), np.float32)
    in_blocks(
        lambda a, b: ranges_around(whole, columns, low, high, a, b), len(columns), block=BLOCK, threads=threads
    )  # fmt: skip
    parts = _interpolated(whole, columns, times)
    for _ in range(ROUNDS):
        moved = np.empty_like(parts)
        given = (whole, index, columns, low, high, parts, sharpness, moved)
        in_blocks(partial(move_within_columns, *given), len(columns), block=BLOCK, threads=threads)
        parts = moved
    return parts
