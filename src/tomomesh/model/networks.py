"""The trained networks of a study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .contours import OUTER, Contour, Contours

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .lattice import Lattice


@dataclass(frozen=True)
class Networks:
    """One network for each slice that had pixels enough.

    Attributes
    ----------
    lattice : Lattice
        The topology, the same on every slice.
    slices : (s,) int32 array
        Slice number K of each network, rising.
    codebooks : (s, u, 2) float array
        Positions of the neurons as voxel indices (column i, row j) within their slice.
    bridged : (s, e) bool array
        Edges of the lattice that cross a gap in the pixels.
    outlined : bool
        Whether the networks saw the outline of the filled window, not the window's pixels.
    pixels : (s,) int64 array
        Pixels presented.
    strays : (s,) int64 array
        Pixels dropped by the trimmed re-fit.
    """

    lattice: Lattice
    slices: NDArray[np.int32]
    codebooks: NDArray[np.float64]
    bridged: NDArray[np.bool_]
    outlined: bool
    pixels: NDArray[np.int64]
    strays: NDArray[np.int64]

    def codebook_on(self, number: int) -> NDArray[np.float64]:
        """Return the neurons (u, 2) of a slice that has a network."""
        return np.asarray(self.codebooks[np.searchsorted(self.slices, number)])

    @property
    def lines(self) -> Contours:
        """The chains or rings as contours, one a slice and all on one track; none of other networks."""
        if self.lattice.name not in ("chain", "ring"):
            return Contours("one", ())
        each = zip(self.slices, self.codebooks, self.bridged, self.pixels, self.strays, strict=True)
        return Contours(
            "one",
            tuple(
                Contour(int(k), 0, OUTER, 0, codebook, np.asarray(bridged), self.outlined, int(pixels), int(strays))
                for k, codebook, bridged, pixels, strays in each
            ),
        )


@dataclass(frozen=True)
class SpaceNetwork:
    """One network in space.

    Attributes
    ----------
    lattice : Lattice
    codebook : (u, 3) float array
        Positions of the neurons in patient millimeters.
    outlined : bool
        Whether it saw the boundary of the window, not its voxels.
    inputs : int
        Places presented.
    strays : int
        Places dropped by the trimmed re-fit.
    """

    lattice: Lattice
    codebook: NDArray[np.float64]
    outlined: bool
    inputs: int
    strays: int
