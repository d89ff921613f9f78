"""A net of springs over the walls between all labels (after Frisken 2022).

A vertex lies in every cell between voxels of different labels, and a square between any two of them. A wall between two
labels is a net as the one around a mask (`tomomesh.isosurface.surface_nets`). Where three walls or more meet its border
is a curve, and a net of one dimension less: the middle between two vertices that follow one another is drawn to where
the corners of the voxels meet, and springs along the curve alone resist bends. It does not feel the walls, and they end
at it. Where curves meet a vertex feels all of these.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...cuberille.neighbors import DIRECTIONS
from ...kernels.isosurface.voxels import link_cells
from ...kernels.isosurface.walls import end_within, list_sheets, list_squares
from ...kernels.threads import in_blocks
from ...model.points import CROSSING
from ..crossings import CLOSEST, EVENED, LevelCrossings
from ..means import BLOCK
from ..surface_nets import Net
from ..thin import DEPTH
from .block import mixed_cells

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .block import LabelBlock

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]
    Marks = NDArray[np.bool_]


def _differing() -> NDArray[np.int64]:
    """Count for every code's edges which differ in each of the six sides of a cell: (4096, 6)."""
    edges = np.arange(4096)[:, None] >> np.arange(12) & 1
    found = np.zeros((4096, 6), np.int64)
    for edge in range(12):
        axis, up, on = edge >> 2, edge & 1, edge >> 1 & 1
        for direction in (2 * ((axis + 1) % 3) + up, 2 * ((axis + 2) % 3) + on):
            found[:, direction] += edges[:, edge]
    return found


BITS = 1 << np.arange(6)
CROSSED = ((_differing() > 0) @ BITS).astype(np.uint8)
"""Sides of a cell, as bits, in which walls run on to the next one, by its code's edges."""
MEETING = ((_differing() > 2) @ BITS).astype(np.uint8)
"""Those in which three walls or more meet: of two labels alone no voxels touch across a side's corner."""
OWNED = (np.arange(4096) & 1) + (np.arange(4096) >> 4 & 1) + (np.arange(4096) >> 8 & 1)
"""Squares that a cell owns, by its code's edges: those before the edges at its lowest corner."""
SIDES = (np.arange(256)[:, None] & BITS) > 0


@dataclass(frozen=True)
class WallNet(Net):
    """The walls between all labels; `links` and `fans` are those that a vertex feels.

    Attributes
    ----------
    labels : (q, 2) uint16 array
        What stands for the labels behind each square, the larger one, and before it (`LabelBlock.labels`).
    junctions : (n,) uint8 array
        Bit n is set where three walls or more meet between a vertex and the next one in direction n.
    """

    labels: NDArray[np.uint16]
    junctions: NDArray[np.uint8]

    @cached_property
    def corners(self) -> Ints:
        """The corners of each square that lie in no other wall, (q, 4), and -1."""
        return np.where(self.junctions[self.quads] > 0, np.int32(-1), self.quads)

    def goals(self, places: Floats, threads: int) -> Floats:
        """Return where the vertices are drawn to; those where walls meet are drawn to the middles of their sides."""
        goals, meeting = super().goals(places, threads), np.flatnonzero(self.junctions)
        sides = SIDES[self.junctions[meeting], :6].astype(np.float64)
        steps = sides @ np.array(DIRECTIONS, np.float64) / sides.sum(axis=1, keepdims=True)
        goals[meeting] = self.low[meeting] + 0.5 + 0.5 * steps
        return goals


def net_between(block: LabelBlock, threads: int = 0) -> WallNet:
    """Span a net between the voxels of a label map.

    Parameters
    ----------
    block : LabelBlock
    threads : int

    Returns
    -------
    WallNet
        Vertices in the order of their cells, by z, then y, then x; of a map of one label to the byte the net around it.
    """
    cells, codes = mixed_cells(block.labels, threads)
    edges = codes & 4095
    sides, junctions, owned = CROSSED[edges], MEETING[edges], OWNED[edges]
    table = np.empty((len(cells), 6), np.int32)
    link_cells(cells, sides, SIDES, np.empty((2, *block.labels.shape[1:]), np.int32), table)
    first, total = np.cumsum(owned) - owned, int(owned.sum())
    quads, inner, twins = (np.full((total, count), -1, np.int32) for count in (4, 3, 4))
    fans, directions = np.empty((len(cells), 6), np.int32), np.empty(total, np.uint8)

    def work(start: int, stop: int) -> None:
        list_squares(cells, codes, table, first, quads, inner, directions, start, stop)
        list_sheets(codes, table, first, junctions, fans, twins, start, stop)

    in_blocks(work, len(cells), block=BLOCK, threads=threads)
    felt = np.where((junctions[:, None] > 0) & ~SIDES[junctions], np.int32(-1), table)
    outer = inner + np.take(np.array(DIRECTIONS, np.int32), directions, axis=0)
    labels = np.stack([block.labels[tuple(voxels.T[::-1])] for voxels in (inner, outer)], axis=1)
    low, inner = cells + block.low, inner + block.low
    return WallNet(low, felt, fans, quads, twins, inner, directions, labels, junctions)


def places_between(net: WallNet, block: LabelBlock, threads: int = 0) -> LevelCrossings:
    """Return where squares are drawn to, and where a label is thin on either side of them."""
    thin = _ends(block, net.inner - block.low, -net.steps, threads)
    ahead = np.flatnonzero(net.labels[:, 1])
    thin[ahead] |= _ends(block, (net.inner + net.steps - block.low)[ahead], net.steps[ahead], threads)
    kinds = np.full(len(thin), CROSSING, np.uint8)
    places = net.inner + _ways(net, block)[:, None] * net.steps
    return LevelCrossings(places, kinds, stepped=True, bending=EVENED, thin=thin)


def _ways(net: WallNet, block: LabelBlock) -> Floats:
    """Return at which share of the way between its voxels each square's two labels have equal shares, (q,).

    Half way, where voxels were not divided, beyond the map, and where a label has less than half of its own voxel. Two
    labels are taken to be all that there are: what one does not have is the other's.
    """
    if block.shares is None:
        return np.full(len(net.quads), 0.5)
    inner = net.inner - block.low
    mine, other = (
        block.shares[tuple(voxels.T[::-1])].astype(np.float64) - 0.5 for voxels in (inner, inner + net.steps)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        ways = mine / (mine + other)
    return np.where((mine >= 0) & (other >= 0) & np.isfinite(ways), np.clip(ways, CLOSEST, 1 - CLOSEST), 0.5)


def _ends(block: LabelBlock, places: Ints, steps: Ints, threads: int) -> Marks:
    """Tell which voxels (q, 3) of the block have one of another label within a few steps."""
    found = np.empty(len(places), np.bool_)
    in_blocks(
        lambda start, stop: end_within(block.labels, places, steps, DEPTH, found, start, stop), len(found), block=BLOCK,
        threads=threads,
    )  # fmt: skip
    return found
