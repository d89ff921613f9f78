"""Where the gray levels cross the bounds of a window, between a voxel inside and its neighbor outside."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..kernels.isosurface.borders import leave_window, list_lines
from ..kernels.threads import in_blocks
from ..model.columns import any_of
from ..model.points import ADDED, BORDER, CROSSING
from ..model.sliced import some_of
from .means import BLOCK

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..model.sliced import Sliced
    from .thick_slices import Thinned

CLOSEST = 0.01
"""A crossing comes no nearer to a voxel's center than this share of the way to its neighbor. Chosen: half of it changes
nothing, twice the distance by +0.0 %."""
BARELY = 0.02
"""How far the surface lies outside the center of a voxel that was added: its gray level is all but in the window.
Chosen: half and twice of it change no case of benchmarks/constants.py."""
EVENED = 44.0
"""How stiff a net around a mask is against bends, over the stiffness that is set, so that it does not follow the steps
between voxels. Chosen: half leaves a ball's mask .070 of a voxel off in place of .055, twice .044, and takes a third
off a rod two voxels wide, which `thin` gives back; without a pull to the places half way between the voxels .36 of it
were left, and not .63."""
STEPPED, SAMPLES = 0.9, 5_000
"""Share of a border's height between two voxels over which the gray levels are those of a mask, and how many crossings
are looked at to tell. Measured: studies have 0.4 to 0.6, the built-in head 0.66."""


@dataclass(frozen=True)
class Stretch:
    """Voxels of a part of a volume, indexed as all would be; what lies beyond the part is as its nearest voxel.

    Attributes
    ----------
    stored : (k, j, i) or (k, j, i, L) array
    low : (int, int, int)
        Its first voxel.
    shape : tuple of int
        Of the volume.
    """

    stored: NDArray[Any]
    low: tuple[int, int, int]
    shape: tuple[int, ...]

    def __getitem__(self, places: tuple[NDArray[np.int32], ...]) -> NDArray[Any]:
        """Return what voxels hold, given as indices along the three axes."""
        sizes = self.stored.shape[:3]
        near = [np.clip(n - low, 0, size - 1) for n, low, size in zip(places, self.low, sizes, strict=True)]
        return np.asarray(self.stored[tuple(near)])

    def lines(self, inner: NDArray[np.int32], directions: NDArray[np.uint8], threads: int = 0) -> NDArray[Any]:
        """Return the levels (q, 4, L) at the places `IN_LINE` across borders, as `Levels.at` does, in few bytes each.

        Parameters
        ----------
        inner : (q, 3) int32 array
            Voxels inside, as (x, y, z).
        directions : (q,) uint8 array
            From each to its neighbor outside.
        threads : int
        """
        low, held, whole = (np.array(one[2::-1], np.int64) for one in (self.low, self.stored.shape, self.shape))
        places, beyond = np.empty((3, len(inner), 4), np.int64), np.empty((len(inner), 4), np.bool_)
        work = partial(list_lines, inner, directions, low, held, whole, places, beyond)
        in_blocks(work, len(inner), block=BLOCK, threads=threads)
        holds_nan = np.promote_types(self.stored.dtype, np.float16)
        layers = self.stored.shape[3:] or (1,)
        found = self.stored[tuple(places)].astype(holds_nan).reshape(*beyond.shape, *layers)
        found[beyond] = np.nan
        found[np.isinf(found)] = np.nan
        return np.asarray(found)


IN_LINE = (-1, 0, 1, 2)
"""Steps from the voxel inside to the four in a line across a border."""


@dataclass(frozen=True)
class Levels:
    """The gray levels of a study, and a window on them.

    Attributes
    ----------
    voxels : (K, J, I) or (K, J, I, L) array, slices that are read as they are asked for, Columns or Stretch
    lower, upper : float or (L,) float array
        A layer is in its window where lower < k <= upper.
    layers : {"all", "any"}
        A voxel is inside where all its layers are in their windows, or one at least.
    """

    voxels: NDArray[Any] | Sliced
    lower: float | NDArray[np.float64]
    upper: float | NDArray[np.float64]
    layers: str = "all"

    def on(self, *slices: int) -> Levels:
        """Return the levels of some slices alone, which are then numbered from 0."""
        return replace(self, voxels=np.stack([self.voxels[k] for k in slices]))

    def part(self, start: int, stop: int) -> Levels:
        """Return the levels of a range of slices alone, which are then numbered from 0; a view of an array."""
        return replace(self, voxels=some_of(self.voxels, start, stop))

    def nearest(self, places: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the voxels that are nearest to places (n, 3), which are (x, y, z) and may lie beyond the border."""
        return np.asarray(np.clip(places, 0, np.array(self.voxels.shape[2::-1], np.int32) - 1))

    def at(self, places: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return the levels (n, L) of voxels (n, 3); NaN beyond the border, and where they are not finite."""
        near = self.nearest(places)
        x, y, z = near.T
        levels = self.voxels[z, y, x].astype(np.float64)
        levels = levels[:, None] if levels.ndim == 1 else levels
        levels[any_of(near != places)] = np.nan
        levels[np.isinf(levels)] = np.nan
        return np.asarray(levels)

    def kept(self, levels: NDArray[Any]) -> NDArray[np.bool_]:
        """Tell which levels (n, L) lie in their layer's window."""
        return np.asarray((levels > self.lower) & (levels <= self.upper))

    def inside(self, levels: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which voxels are inside by their levels (n, L), (n,)."""
        kept = self.kept(levels)
        return np.asarray(kept.all(axis=1) if self.layers == "all" else kept.any(axis=1))

    def excess(self, places: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return how far the level of each voxel is outside the window, (n,); infinite where it is unknown."""
        levels = self.at(places)
        beyond = np.nan_to_num(np.maximum(self.lower - levels, levels - self.upper), nan=np.inf)
        return np.asarray(beyond.max(axis=1) if self.layers == "all" else beyond.min(axis=1))

    def crossed(self, inner: NDArray[np.int32], outer: NDArray[np.int32], threads: int = 0) -> NDArray[np.float64]:
        """Return the share of the way from voxels inside to their neighbors outside where a bound is crossed, (n,).

        Levels are interpolated linearly. Of several layers the first to leave its window counts; where one inside is
        enough, the last of those that were. Where a level is not known the border is half way.
        """
        return self.left(self.at(inner), self.at(outer), threads)

    def left(self, inside: NDArray[np.float64], outside: NDArray[np.float64], threads: int = 0) -> NDArray[np.float64]:
        """Return those shares by the levels (n, L) inside and outside, see `crossed`."""
        lower, upper = (np.full(inside.shape[1], bound, np.float64) for bound in (self.lower, self.upper))
        leaves = np.empty(len(inside))
        in_blocks(
            lambda start, stop: leave_window(
                inside, outside, lower, upper, self.layers == "all", leaves, start, stop
            ), len(leaves), block=BLOCK, threads=threads,
        )  # fmt: skip
        return np.where(np.abs(leaves) <= 1, np.clip(leaves, CLOSEST, 1 - CLOSEST), 0.5)

    def stepped(self, inner: NDArray[np.int32], steps: NDArray[np.int32]) -> bool:
        """Tell whether the levels are those of a mask, and so say nothing about where between voxels the border is.

        They are where one level is all that lies inside of the border, and another all that lies outside. Else looks
        at four voxels in a line, two inside and two outside, where all four are in the volume. Sampled by anything that
        has an extent, a border takes about half of its height between the middle two; in a mask it takes all of it.
        """
        every = sampled(len(inner))
        inner, steps = inner[::every], steps[::every]
        return self.are_stepped([self.at(inner + n * steps) for n in IN_LINE])

    def are_stepped(self, lines: Sequence[NDArray[np.float64]]) -> bool:
        """Tell that by the levels (n, L) at the four places `IN_LINE` across a border, see `stepped`."""
        if _are_two(lines[1], lines[2]) and _are_two_alone(lines):
            return True
        whole, step, clear = self._heights(*lines)
        known, shares = np.isfinite(whole + step), step[clear] / whole[clear]
        return bool(2 * len(shares) > np.count_nonzero(known) and np.median(shares) > STEPPED)

    def are_two(self, inner: NDArray[np.int32], outer: NDArray[np.int32]) -> bool:
        """Tell whether voxels inside (n, 3) all have one level, and those outside another, as those of a mask do."""
        return _are_two(self.at(inner), self.at(outer))

    def _heights(
        self,
        before: NDArray[np.float64],
        inside: NDArray[np.float64],
        outside: NDArray[np.float64],
        after: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
        """Return the height of a border between four voxels and between two, and where the outer are clear of it."""
        whole, step = (np.abs(one - other).sum(axis=1) for one, other in ((before, after), (inside, outside)))
        return whole, step, self.inside(before) & ~self.inside(after) & (whole > 0)


def sampled(count: int) -> int:
    """Return every how many of so many crossings one is looked at."""
    return -(-count // SAMPLES) or 1


def _are_two(inside: NDArray[np.float64], outside: NDArray[np.float64]) -> bool:
    """Tell whether levels inside (n, L) are one, and those outside another, as those of a mask are."""
    sides = [levels[np.isfinite(levels).all(axis=1)] for levels in (inside, outside)]
    return all(len(levels) and not np.ptp(levels, axis=0).any() for levels in sides)


def _are_two_alone(lines: Sequence[NDArray[np.float64]]) -> bool:
    """Tell whether voxels in a line (n, L) have two levels alone: distances from a box are two beside it alone."""
    levels = np.concatenate(lines)
    return len(np.unique(levels[np.isfinite(levels).all(axis=1)], axis=0)) <= 2


@dataclass(frozen=True)
class LevelCrossings:
    """Where a surface crosses the lines between voxels.

    Attributes
    ----------
    positions : (q, 3) float array
        As voxel indices (x, y, z).
    kinds : (q,) uint8 array
        ``CROSSING`` where gray levels were interpolated, ``BORDER`` on the border of the volume, ``ADDED`` elsewhere
        beside a voxel that is not in the window.
    stepped : bool
        Whether the gray levels are those of a mask.
    bending : float
        How stiff a net that is drawn to them is against bends, over the stiffness that is set; 0 for one that resists
        being stretched.
    thin : (q,) bool array
        Where the mask behind them is thin, and the net may not take its volume away.
    """

    positions: NDArray[np.float64]
    kinds: NDArray[np.uint8]
    stepped: bool
    bending: float = 0.0
    thin: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))

    @property
    def cut_off(self) -> NDArray[np.bool_]:
        """Which faces (q,) the volume is cut off over."""
        return np.asarray(self.kinds == BORDER)


def kinds_of(added: NDArray[np.bool_], beyond: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return what crossings are, by which lie beside a voxel that is not in the window, and which beyond the border."""
    return np.where(beyond, BORDER, np.where(added, ADDED, CROSSING)).astype(np.uint8)


def beyond_border(inner: NDArray[np.int32], steps: NDArray[np.int32], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Tell which faces (q,) a volume of a shape (K, J, I) is cut off over: their neighbors outside lie beyond it."""
    outer, most = inner + steps, np.array(shape[2::-1], np.int32)
    return any_of(np.asarray((outer < 0) | (outer >= most)))


def crossings(
    levels: Levels, inner: NDArray[np.int32], steps: NDArray[np.int32], added: NDArray[np.bool_],
    thin: Thinned | None = None, threads: int = 0,
) -> LevelCrossings:  # fmt: skip
    """Find where the boundary of a window crosses the lines between voxels.

    Parameters
    ----------
    levels : Levels
    inner : (q, 3) int32 array
        Voxels inside, as (x, y, z).
    steps : (q, 3) int32 array
        From each to its neighbor outside.
    added : (q,) bool array
        Inner voxels that are not in the window.
    thin : Thinned, optional
        What the levels are of, where the voxels are parts of thick ones.
    threads : int

    Returns
    -------
    LevelCrossings
    """
    outer, even = inner + steps, thin is None and levels.stepped(inner, steps)
    share = np.full(len(inner), 0.5) if even else np.where(added, BARELY, levels.crossed(inner, outer, threads))
    kinds = kinds_of(added, beyond_border(inner, steps, levels.voxels.shape))
    positions = inner + share[:, None] * steps
    if thin is None:
        return LevelCrossings(positions, kinds, even, EVENED if even else 0.0)
    return LevelCrossings(positions, kinds, thin.of_mask, thin.bending)
