"""What the voxels of thick slices hold, and what the borders in them are like."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .averages import averages_of, beside_border
from .crossings import EVENED, SAMPLES, STEPPED, Levels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Mask = NDArray[np.bool_]
    Values = NDArray[np.float32]
    Index = NDArray[np.int32]
    Floats = NDArray[np.float64]

RAMP, SHARPEST = 1 / 3, 5.0
"""Share of a border's height between two pixels where it is a ramp over four, the least sharp that can be told; and
the greatest sharpness. Chosen: half of the latter changes the distance of partial volumes by +7 %, twice by -0.6 %, and
turns 7 % more."""
OF_MASK = 2.0
"""Sharpness of what comes from a mask, which tells nothing of it. Chosen: half changes the distance by +11 %, twice by
-0.8 % with 5 % more turns."""
OF_LEVELS = 12.0
"""How stiff a net is against bends around thin voxels, over the stiffness that is set. Chosen where faces turn as much
as after a windowed sinc filter: half changes the distance by -1 % and the turns by +7 %, twice by +3 and -5 %. Where
there are two levels, it is as stiff as around a mask, whose steps it shall not follow either."""
SPREAD, FEWEST = 0.01, 100
"""Share of a border's height by which the middle half of its ends may differ where there are two levels, and at how
many places at least. Measured: partial volumes of labels differ by 0, a CT's skin by .04, other studies by .1 and
more. Chosen: half and twice change nothing; at .05 a CT's skin has 671 pieces in place of 4, of foam and sinuses."""
UPRIGHT = 90
"""Percentile of the shares that tells how sharp borders are: where they slant, pixels hold a part of both sides, and
look less sharp than they are. Chosen: 75 and 95 change the distance by 1 % at most; 75 turns 16 % more on partial
volumes."""


@dataclass(frozen=True)
class Content:
    """What the voxels of thick slices hold, and what the borders in them are like.

    Attributes
    ----------
    whole : (K, J, I) float32 array
        The first axis runs across the slices.
    bounds : Levels
        The window on that.
    sharpness : float
        Of the borders.
    bending : float
        How stiff a net is against bends, over the stiffness that is set.
    inner, outer : float
        The two levels that all but all voxels hold, inside and outside; NaN where there are more.
    of_mask : bool
        Whether it comes from a mask.
    """

    whole: Values
    bounds: Levels
    sharpness: float
    bending: float
    inner: float = np.nan
    outer: float = np.nan
    of_mask: bool = False

    @property
    def bound(self) -> float:
        """The level between the two."""
        return float(self.bounds.lower if self.inner > self.outer else self.bounds.upper)

    def mixed(self, times: int) -> Mask:
        """Tell which voxels hold enough of both of two levels to fill one of so many parts, (K, J, I)."""
        share, least = ((of - self.outer) / (self.inner - self.outer) for of in (self.whole, self.bound))
        return np.asarray((times * share >= least) & (times * (1 - share) >= 1 - least))

    def is_mixed(self, mask: Mask) -> bool:
        """Tell whether voxels beside the border hold something of both of two levels, as those of a mask do not."""
        mixed = self.mixed(round(1 / SPREAD))
        return bool(mixed.any()) and bool(np.mean(mixed[beside_border(mask)]) > SPREAD)

    def kept(self, parts: Values) -> Mask:
        """Tell which parts are kept: those in the window, and of two levels those that hold just half of each.

        A level sheet as thick as one part fills the middle two of an even number by half.
        """
        halved = np.abs(parts - self.bound) <= SPREAD * abs(self.inner - self.outer)
        return np.asarray(self.bounds.kept(parts) | halved)


def content_of(levels: Levels, mask: Mask, turned: Mask, axis: int, threads: int = 0) -> Content:
    """Return the gray levels, or the averages that a mask would have.

    Parameters
    ----------
    levels : Levels
    mask, turned : (K, J, I) bool array
        The voxels that are kept, as the levels lie, and with the axis across the slices first.
    axis : int
        That axis.
    threads : int

    Returns
    -------
    Content
    """
    voxels, (shares, least, most) = np.asarray(levels.voxels), _borders(levels, mask, axis)
    whole = np.ascontiguousarray(np.moveaxis(voxels, axis, 0), np.float32)
    high = float(np.percentile(shares, UPRIGHT)) if len(shares) else 1.0
    sharpness = min(1 + max(high - RAMP, 0) / max(2 * (1 - high), 1e-9), SHARPEST)
    two = _two_levels(levels, least, most)
    held = Content(whole, levels, sharpness, *((OF_LEVELS,) if two is None else (EVENED, *two)))
    steps = len(shares) > 0 and np.median(shares) > STEPPED
    if (steps and not held.is_mixed(turned)) or _are_two(levels, mask):
        half = Levels(voxels, 0.5, np.inf)
        return Content(averages_of(turned, threads), half, OF_MASK, EVENED, 1.0, 0.0, of_mask=True)
    return held


def _two_levels(levels: Levels, least: Floats, most: Floats) -> tuple[float, float] | None:
    """Return the levels inside and outside of most borders, where those are alike."""
    if len(least) < FEWEST:
        return None
    low, high = (np.percentile(ends, (25, 50, 75)) for ends in (least, most))
    if max(np.ptp(low), np.ptp(high)) > SPREAD * (high[1] - low[1]):
        return None
    within = [bool(levels.kept(np.array([[end]]))[0, 0]) for end in (low[1], high[1])]
    inner, outer = (float(low[1]), float(high[1])) if within[0] else (float(high[1]), float(low[1]))
    return None if within[0] == within[1] else (inner, outer)


def _borders(levels: Levels, mask: Mask, axis: int) -> Floats:
    """Return what share of a border's height lies between two pixels of a slice, and its ends, at some places: (3, n).

    The height is that between four pixels in a line, two inside and two outside, and those of the next slices beside
    the middle two: where a border slants, these have the whole of it.
    """
    across = np.zeros(3, np.int32)
    across[2 - axis] = 1
    found = [_heights(levels, *_faces_across(mask, other), across) for other in range(3) if other != axis]
    return np.concatenate(found, axis=1)


def _heights(levels: Levels, inner: Index, steps: Index, across: Index) -> Floats:
    places = [inner - steps, inner + 2 * steps, inner, inner + steps]
    places += [place + side for place in places[2:] for side in (across, -across)]
    before, after, *seen = (levels.at(place)[:, 0] for place in places)
    least, most = (ends.reduce([before, after, *seen]) for ends in (np.fmin, np.fmax))
    clear = levels.inside(before[:, None]) & ~levels.inside(after[:, None]) & (most > least)
    clear &= np.isfinite(seen[0] - seen[1])
    shares = np.abs(seen[0] - seen[1])[clear] / (most - least)[clear]
    return np.stack([shares, least[clear], most[clear]])


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


def _are_two(levels: Levels, mask: Mask) -> bool:
    """Tell whether the levels on both sides of the border are those of a mask, however thin what it holds is."""
    faces = [_faces_across(mask, axis) for axis in range(3)]
    inner, steps = (np.concatenate(each) for each in zip(*faces, strict=True))
    return levels.are_two(inner, inner + steps)
