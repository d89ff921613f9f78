"""Close the gaps of a shell of cubes, and find what it keeps the outside from.

Topology comes from a coarser scale than geometry: the cubes are dilated until the outside no longer reaches the
inside, and what was added is taken away again from the outside only (a morphological closing).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.cuberille.cells import label_components
from ..model.cubes import keys_of
from .bitmasks import EDGE, Blocks
from .neighbors import FACE_COLUMNS, neighbor_table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .bitmasks import Bitmask

NEAR = 2
"""Steps, beyond twice the dilation, from enclosed space within which an occupied cube counts as near it: noise may
make a shell two cubes thick, and a dilation leaves little of what is enclosed."""
DEEP = 2
"""Cubes below the outside where few points of a surface lie: half of it takes noise for joints, and 3 misses a joint
with a sphere of a quarter of the radius (measured, see `parting.FEW`)."""
ROOM = 0.005
"""Cubes of a piece of enclosed space, over the occupied ones, under which it is a pocket: a sphere of radius 2 encloses
8 % of its own cubes, a wider one more."""


@dataclass(frozen=True)
class Shell:
    """A closed set of cubes, and what became of the space around it.

    Attributes
    ----------
    blocks : Blocks
    occupied : bitmask
        Cubes that hold points.
    solid : bitmask
        The objects, filled: all that the outside does not reach.
    witnesses : bitmask
        Occupied cubes that tell of an inside: near space that the dilation left empty and the outside does not
        reach.
    within : (c, 3) int64 array
        Occupied cubes inside the objects, that belong to nothing that the outside reaches: objects in cavities.
    closing : int
        Cubes by which the shell was dilated and eroded.
    added : int
        Cubes that were filled to make the solid well composed.
    """

    blocks: Blocks
    occupied: Bitmask
    solid: Bitmask
    witnesses: Bitmask
    within: NDArray[np.int64]
    closing: int
    added: int

    def buried(self, deep: int = DEEP) -> NDArray[np.int64]:
        """List the cubes with points that lie so many cubes and more below the outside, cavities aside, (d, 3)."""
        cells = self.blocks.cells(self.occupied & ~self.blocks.grown(~self.solid, deep))
        return cells[~np.isin(keys_of(cells), keys_of(self.within))]


def close_shell(cells: NDArray[np.int64], closing: int, *, threads: int = 0) -> Shell:
    """Dilate the shell, let the outside in, and take back from the outside what the dilation added.

    Parameters
    ----------
    cells : (c, 3) int64 array
        Positions (x, y, z) of the cubes that hold points, or that are known to lie on the surface.
    closing : int
        Cubes by which the shell is dilated.
    threads : int

    Returns
    -------
    Shell
        Its solid is well composed: no two of its cubes, nor two empty ones, touch along an edge or at a corner
        only, so that its surface is a 2-manifold.

    Notes
    -----
    The outside takes back no cube that lines enclosed space, or the erosion would open what the dilation closed.
    """
    blocks = Blocks.around(cells, closing + NEAR, threads=threads)
    occupied = blocks.bitmask_of(cells)
    dilated = blocks.grown(occupied, closing)
    outside = blocks.beyond()
    blocks.flood(~dilated, outside)
    enclosed = ~(dilated | outside)
    lining = blocks.grown(enclosed)
    outside = blocks.spread(outside, dilated & ~occupied & ~lining, closing)
    solid, added = _well_composed(blocks, ~outside)
    reached = blocks.grown(outside) & dilated
    blocks.flood(dilated, reached)
    within = blocks.cells(occupied & ~reached)
    near = blocks.spread(_roomy(blocks, enclosed, ROOM * len(cells)), solid, 2 * closing + NEAR)
    return Shell(blocks, occupied, solid, occupied & near, within, closing, added)


def shell_around(inside: NDArray[np.int64], cells: NDArray[np.int64], *, threads: int = 0) -> Shell:
    """Take a solid whose cubes are known.

    Parameters
    ----------
    inside : (i, 3) int64 array
        Positions (x, y, z) of the cubes inside.
    cells : (c, 3) int64 array
        Those of the cubes that hold points; where they face the outside they tell of an inside.
    threads : int

    Returns
    -------
    Shell
        Well composed, its pockets filled.
    """
    blocks = Blocks.around(inside, NEAR, threads=threads)
    outside = blocks.beyond()
    blocks.flood(~blocks.bitmask_of(inside), outside)
    solid, added = _well_composed(blocks, ~outside)
    known = np.isin(keys_of(cells // EDGE), blocks.keys)
    occupied = blocks.grown(blocks.bitmask_of(cells[known]))
    return Shell(blocks, occupied, solid, occupied, np.empty((0, 3), np.int64), 0, added)


def _roomy(blocks: Blocks, enclosed: Bitmask, least: float) -> Bitmask:
    """Leave out the small pieces of enclosed space: pockets in a thick shell tell of no inside."""
    large = blocks.empty()
    large[len(blocks) :] = enclosed[len(blocks) :]
    blocks.flood(enclosed, large)
    cells = blocks.cells(enclosed & ~large)
    if len(cells) == 0:
        return large
    keys = keys_of(cells)
    order = np.argsort(keys)
    labels = np.full(len(keys), -1, np.int32)
    table = np.ascontiguousarray(neighbor_table(keys[order])[:, FACE_COLUMNS])
    label_components(table, np.ones(len(keys), np.bool_), labels)
    kept = (np.bincount(labels) >= least)[labels]
    return large | blocks.bitmask_of(cells[order][kept])


def _well_composed(blocks: Blocks, solid: Bitmask) -> tuple[Bitmask, int]:
    """Fill contacts along edges and at corners until there are none; return how many cubes that took.

    What is filled may shut a pocket off from the outside, which then belongs to the solid.
    """
    total = 0
    while True:
        filled, added = blocks.composed(solid)
        if not added:
            return solid, total
        outside = blocks.beyond()
        blocks.flood(~filled, outside)
        solid, total = ~outside, total + added
