"""Shells of cubes, what docs/theory.md says of them, and the same shell on a whole grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from conftest import contacts, size
from tomomesh.model.mesh import TriMesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.cuberille.faces import Faces

    Cells = NDArray[np.int64]
    Solid = NDArray[np.bool_]


RADIUS = size(14, 9)
EVERYWHERE = np.ones((3, 3, 3), bool)
TIGHT, SURE, DEBRIS, NEAR, POCKET, CLOSINGS, LEAKING = 0.45, 0.8, 0.05, 2, 0.005, range(9), 1
"""What docs/theory.md says: shares of two-sided cubes from which a shell is tight, and surely; of faces under which a
surface around nothing is debris; steps that are near; share of the cubes under which a space is a pocket; closings."""


def sphere_with_hole(width: float, radius: int = RADIUS) -> Cells:
    """Return a shell of cubes, one or two thick, with a round hole in its top `width` cubes wide."""
    cells = np.argwhere(np.ones([2 * radius + 5] * 3, bool)) - radius - 2
    shell = np.abs(np.linalg.norm(cells, axis=1) - radius) <= 0.9
    hole = (np.hypot(cells[:, 0], cells[:, 1]) < width / 2) & (cells[:, 2] > 0)
    return np.asarray(cells[shell & ~hole])


def mesh_of(found: Faces) -> TriMesh:
    return TriMesh(found.corners.astype(float), found.quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.int64))


def grown(grid: Solid, steps: int = 1) -> Solid:
    return np.asarray(ndimage.binary_dilation(grid, EVERYWHERE, iterations=steps)) if steps else grid


def spread(grid: Solid, within: Solid, steps: int) -> Solid:
    for _ in range(steps):
        grid = grid | (grown(grid) & within)
    return grid


def outside_of(grid: Solid) -> Solid:
    """Flood a whole grid from its corner."""
    labels, _ = ndimage.label(~grid)
    return np.asarray(labels == labels[0, 0, 0])


class Twin:
    """The same shell on a whole grid, from the definition."""

    def __init__(self, solid: Solid, steps: int) -> None:
        self.pad = 2 * steps + NEAR + 2
        self.occupied = np.pad(solid, self.pad)
        dilated = grown(self.occupied, steps)
        self.enclosed = ~dilated & ~outside_of(dilated)
        outside = spread(outside_of(dilated), dilated & ~self.occupied & ~grown(self.enclosed), steps)
        closed = ~outside
        self.solid = closed
        while (contacts(self.solid) & ~self.solid).any():
            self.solid = ~outside_of(self.solid | contacts(self.solid))
        self.added = int((self.solid & ~closed).sum())
        reached = grown(outside_of(self.solid)) & dilated
        labels, _ = ndimage.label(dilated)
        self.within = self.occupied & ~np.isin(labels, np.setdiff1d(labels[reached], 0))
        labels, _ = ndimage.label(self.enclosed)
        roomy = np.isin(labels, np.flatnonzero(np.bincount(labels.ravel()) >= POCKET * solid.sum())) & self.enclosed
        self.witnesses = self.occupied & spread(roomy, self.solid, 2 * steps + NEAR)
