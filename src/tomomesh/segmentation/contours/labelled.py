"""Label maps of which some slices alone are labelled: what lies between them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ...contours.slices import Slices
from ...contours.stack import solid_between
from ...errors import UsageError
from ...isosurface.run_mask import RunMask
from ...progress import Progress, silent
from .loops import trace

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...model.volume import Volume

    Mask = NDArray[np.bool_]

BLUNT = 0.6
"""Share of the area of the next slice that a slice has at least before a gap in a body: a ball's last slice has at most
half of it. Only what is told depends on it."""
NAMED = 6
"""Empty slices that are named at most, so that a note stays a line."""
ALONE = 0.05
"""Share of the voxels without a neighbor across an axis over which some labels are taken for drawn on slices alone.
Measured: 0.0001 to 0.004 of whole bodies, 0.1 where one of two bodies is drawn on every eighth slice."""
BESIDE = 2
"""Pixels around what was drawn on a slice within which what is not drawn is outside: curves are smoothed by less."""
WIDEST = 4.0
"""Depths beyond which nothing is told, in voxels: two more than what tells a border from a mask's."""


@dataclass(frozen=True)
class Gaps:
    """Empty slices between labelled ones.

    Attributes
    ----------
    axis : int
        Of the voxels (K, J, I), across which the slices lie.
    labelled : (s,) int64 array
        Slices that hold something.
    """

    axis: int
    labelled: NDArray[np.int64]

    @property
    def told(self) -> str:
        """What is to be said of them."""
        gone = np.setdiff1d(np.arange(self.labelled[0], self.labelled[-1]), self.labelled)
        named = ", ".join(map(str, gone[:NAMED].tolist())) + (", ..." if len(gone) > NAMED else "")
        across = ("slices", "rows", "columns")[self.axis]
        if not len(gone):
            return f"some of the labels lie on {across} alone, between {across} that hold none of theirs"
        return f"{len(gone)} {across} are empty between {len(self.labelled)} that hold labels ({named})"


def gaps_in(mask: RunMask) -> Gaps | None:
    """Find the empty slices of labels of which some slices alone were drawn; None where there are none.

    Either no two of the slices with labels are neighbors, for the most part, or a body is cut off on both sides of a
    gap: what is two bodies ends in slices that get smaller.

    Parameters
    ----------
    mask : RunMask
        The voxels of the labels that are wanted.
    """
    return next((gaps for axis in range(3) if (gaps := _gaps_across(mask, axis)) is not None), None)


def _gaps_across(mask: RunMask, axis: int) -> Gaps | None:
    areas = mask.areas(axis)
    labelled = np.flatnonzero(areas)
    runs = np.split(labelled, np.flatnonzero(np.diff(labelled) > 1) + 1)
    if len(runs) < 2:
        return None
    alone = np.median([len(run) for run in runs]) == 1
    cut = any(_is_cut(mask, axis, areas, int(a[-1]), int(b[0])) for a, b in pairwise(runs))
    return Gaps(axis, labelled) if alone or cut else None


def _is_cut(mask: RunMask, axis: int, areas: NDArray[np.int64], below: int, above: int) -> bool:
    """Tell whether the slices beside a gap lie over one another, and are about as large as those behind them."""
    beyond = (max(below - 1, 0), min(above + 1, len(areas) - 1))
    blunt = all(areas[one] >= BLUNT * areas[next_] for one, next_ in zip((below, above), beyond, strict=True))
    shared = np.count_nonzero(mask.plane(axis, below) & mask.plane(axis, above))
    return blunt and bool(2 * shared >= min(areas[below], areas[above]))


def filled_slices(mask: Mask, study: Volume, *, threads: int = 0, progress: Progress = silent) -> tuple[Volume, str]:
    """Interpolate the slices between labelled ones, as contours that were drawn on them.

    Parameters
    ----------
    mask : (K, J, I) bool array
        The voxels of the labels that are wanted.
    study : Volume
        Its voxels are not looked at.
    threads : int
    progress : callable

    Returns
    -------
    volume : Volume
        The study with depths in voxels, over 0 inside.
    told : str

    Raises
    ------
    UsageError
        Where no slice is empty between others, or the labels lie on one slice alone.
    """
    found = gaps_in(RunMask.of([mask])) or _likeliest_gaps(mask)
    if found is None:
        raise UsageError(
            "no slice without labels lies between others", found="--fill-slices",
            expected="labels on two slices at least, and empty ones between them", hint="the same without it",
        )  # fmt: skip
    planes = np.moveaxis(mask, found.axis, 0)
    columns, rows, across = _sizes(study.spacing_mm, found.axis)
    heights = np.asarray(across * np.arange(len(planes)), np.float64)
    rings = tuple(
        tuple(_ring(loop.middles, (columns, rows), k * across) for loop in trace(planes[k])) for k in found.labelled
    )
    slices = Slices(
        np.zeros(3), np.eye(3), heights[found.labelled], np.zeros(len(rings), np.int64), np.empty(0, np.int64),
        min(columns, rows), rings, sparse=True,
    )  # fmt: skip
    levels, low, edge = solid_between(slices, heights, threads=threads, progress=progress)
    depths = _resampled(levels, low, edge, (rows, columns), planes.shape)
    depths[found.labelled] = _as_drawn(depths[found.labelled], planes[found.labelled])
    return replace(study, voxels=np.moveaxis(depths, 0, found.axis)), f"{found.told}: they were interpolated"


def _as_drawn(depths: NDArray[np.float32], drawn: Mask) -> NDArray[np.float32]:
    """Give the pixels that are not on the side where they were drawn the depth that a pixel alone has.

    Those away from all that was drawn on their slice may be of a body that was drawn on others.
    """
    alone = np.where(drawn, np.float32(0.5), np.float32(-0.5))
    beside = scipy.ndimage.binary_dilation(drawn, np.ones((1, 3, 3), np.bool_), iterations=BESIDE)
    return np.where(beside & (drawn != (depths > 0)), alone, depths)


def _likeliest_gaps(mask: Mask) -> Gaps | None:
    """Find the axis across which most voxels have no neighbor; None where hardly any, and no slice, is alone."""
    alone = [_alone_across(mask, axis) for axis in range(mask.ndim)]
    axis = int(np.argmax(alone))
    labelled = np.flatnonzero(mask.any(axis=tuple(other for other in range(mask.ndim) if other != axis)))
    sparse = len(labelled) > 1 and alone[axis] > ALONE * np.count_nonzero(mask)
    return Gaps(axis, labelled) if sparse or (np.diff(labelled) > 1).any() else None


def _alone_across(mask: Mask, axis: int) -> int:
    planes = np.moveaxis(mask, axis, 0)
    beside = np.zeros_like(planes)
    beside[1:] |= planes[:-1]
    beside[:-1] |= planes[1:]
    return int(np.count_nonzero(planes & ~beside))


def _sizes(spacing: tuple[float, float, float], axis: int) -> tuple[float, float, float]:
    """Return the spacing along the columns, rows and slices of planes across an axis (K, J, I)."""
    sizes = list(spacing[::-1])
    across = sizes.pop(axis)
    return sizes[1], sizes[0], across


def _ring(middles: NDArray[np.float64], pixel: tuple[float, float], height: float) -> NDArray[np.float64]:
    return np.column_stack([middles * pixel, np.full(len(middles), height)])


def _resampled(
    levels: NDArray[np.float32],
    low: NDArray[np.float64],
    edge: float,
    pixel: tuple[float, float],
    shape: tuple[int, ...],
) -> NDArray[np.float32]:
    """Return depths at the middles of other pixels of the same layers, linear between their own."""
    scale, first = np.array([1.0, *pixel]), np.array([0.0, *low[::-1]])
    scale[1:] /= edge
    depths = scipy.ndimage.affine_transform(
        levels, scale, -first / edge, shape, output=np.float32, order=1, mode="constant", cval=-WIDEST
    )  # fmt: skip
    return np.asarray(np.clip(depths, -WIDEST, WIDEST, out=depths))
