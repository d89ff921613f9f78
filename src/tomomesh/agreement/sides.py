"""The boundary of a window as it stands in its voxels: the faces between those inside and those outside, in slabs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ..model.volume import Volume

    Floats = NDArray[np.float64]

SLAB_VOXELS = 2**20
"""Voxels that are looked at together, one slice at least, so that memory follows the slice and not the study. No result
depends on it."""
CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
"""The corners of a square face from its middle, along the two axes that it spans."""


@dataclass(frozen=True)
class Sides:
    """Faces across one axis within a slab of slices.

    Attributes
    ----------
    axis : int
        The axis that they lie across: 0 along columns, 1 along rows, 2 along slices.
    first, last : float
        The lowest and the highest slice index that they reach.
    middles : (n, 3) float array
        As voxel indices (x, y, z).
    """

    axis: int
    first: float
    last: float
    middles: Floats

    @property
    def spanned(self) -> list[int]:
        """The two axes that each face spans."""
        return [axis for axis in range(3) if axis != self.axis]

    def taking(self, some: NDArray[np.bool_]) -> Sides:
        """Return some of the faces (n,)."""
        return replace(self, middles=self.middles[some])

    def triangles(self) -> tuple[Floats, NDArray[np.int32]]:
        """Return the corners (4n, 3) as indices, and two triangles a face (2n, 3)."""
        corners = np.repeat(self.middles[:, None], 4, axis=1)
        corners[:, :, self.spanned] += CORNERS
        first = 4 * np.arange(len(self.middles), dtype=np.int32)[:, None]
        halves = [first + np.array(half, np.int32) for half in ((0, 1, 2), (0, 2, 3))]
        return corners.reshape(-1, 3), np.concatenate(halves)


def sides_in_slabs(mask: NDArray[np.bool_]) -> Iterator[Sides]:
    """Yield the faces of a window (K, J, I), each once, slab after slab and axis after axis."""
    kept = np.flatnonzero(mask.any(axis=(1, 2)))
    if not len(kept):
        return
    step = max(1, SLAB_VOXELS // mask[0].size)
    for start in range(kept[0], kept[-1] + 2, step):
        stop = min(start + step, kept[-1] + 2)
        within = mask[start:stop]
        above = mask[start - 1 : stop] if start else np.concatenate([np.zeros_like(mask[:1]), mask[:stop]])
        if stop > len(mask):
            above = np.concatenate([above, np.zeros_like(mask[:1])])
        yield Sides(2, start - 0.5, stop - 1.5, _places(np.diff(above, axis=0), (start - 0.5, 0, 0)))
        for axis, along in ((1, 1), (0, 2)):
            framed = np.pad(within, [(int(n == along),) * 2 for n in range(3)])
            shift = (start, -0.5 if along == 1 else 0, -0.5 if along == 2 else 0)
            yield Sides(axis, start - 0.5, stop - 0.5, _places(np.diff(framed, axis=along), shift))


def _places(there: NDArray[np.bool_], shift: tuple[float, float, float]) -> Floats:
    """Return the indices (x, y, z) of what is there, (n, 3), from where the array begins as (k, j, i)."""
    return np.asarray((np.argwhere(there) + np.array(shift))[:, ::-1], np.float64)


def areas_of(volume: Volume) -> Floats:
    """Return the area of a face across each axis, columns first, (3,), mm^2."""
    x, y, z = volume.affine[:3, :3].T
    return np.asarray(np.linalg.norm([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1))


def samples_of(mask: NDArray[np.bool_], volume: Volume, count: int) -> Floats:
    """Draw places evenly by area from the boundary of a window, (count, 3), in millimeters; the same every time."""
    areas, rng = areas_of(volume), np.random.default_rng(0)
    each = np.array([len(sides.middles) * areas[sides.axis] for sides in sides_in_slabs(mask)])
    wanted, found, done = (np.arange(count) + 0.5) * each.sum() / count, [], 0.0
    for sides, area in zip(sides_in_slabs(mask), each, strict=True):
        own = wanted[(wanted >= done) & (wanted < done + area)]
        number = ((own - done) / areas[sides.axis]).astype(np.int64).clip(0, max(len(sides.middles) - 1, 0))
        places = sides.middles[number]
        places[:, sides.spanned] += rng.random((len(own), 2)) - 0.5
        found.append(places)
        done += area
    return volume.to_mm(np.concatenate(found))
