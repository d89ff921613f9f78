"""Where the levels cross the bounds of a window, slab by slab."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..measure.tree import Tree
from .parts import Part, gathered
from .region import crossings_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .keep import Kept, Slabs
    from .place import Extent
    from .region import Region

    Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SlabCrossings:
    """Crossings as voxel indices, of all squares in their order; `len` counts them.

    Attributes
    ----------
    slabs : Slabs
    kept : list of Kept
        Those of each slab, (q, 3).
    first : (s + 1,) int64 array
        How many lie before each slab, and in all.
    """

    slabs: Slabs
    kept: list[Kept]
    first: NDArray[np.int64]

    def __len__(self) -> int:
        return int(self.first[-1])

    def some(self, every: int = 1) -> Floats:
        """Return the first of every so many, (n, 3)."""
        found = self.slabs.each(_some, self.kept, self.first[:-1].tolist(), [every] * len(self.kept))
        return np.concatenate(self.slabs.fetch(found))

    def distances(self, places: Floats, threads: int = 0) -> Floats:
        """Return the distance of places (p, 3) to the nearest, (p,)."""
        found = self.slabs.each(_distances, self.kept, [places] * len(self.kept), [threads] * len(self.kept))
        return np.asarray(np.min(self.slabs.fetch(found), axis=0))


def crossed(place: Extent, found: Region, squares: Sequence[Part]) -> Floats:
    """Return the crossings (q, 3) of a slab's own squares; see `tomomesh.slabs.triangles.chosen`."""
    (_, *shares) = gathered(squares, place.of_squares)
    return crossings_of(found.net, shares, slice(*place.own_squares()))


def _some(crossings: Floats, first: int, every: int) -> Floats:
    return crossings[-first % every :: every]


def _distances(crossings: Floats, places: Floats, threads: int) -> Any:
    if not len(crossings):
        return np.full(len(places), np.inf)
    return Tree.of_points(crossings, threads=threads).nearest(places, threads=threads)[0]
