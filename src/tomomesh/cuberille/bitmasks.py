"""Sets of cubes near a surface, kept as bits: 8 x 8 x 8 cubes to a block, and blocks only where they are needed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ResourceError
from ..kernels.cuberille.bitmasks import compose, flood, grow_along, list_cubes
from ..kernels.cuberille.cells import label_components
from ..kernels.threads import in_blocks
from ..model.cubes import SIDE, cells_of, keys_of
from .neighbors import FACE_COLUMNS, dilate, neighbor_table, once_each

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Bitmask = NDArray[np.uint64]

EDGE = 8
"""Cubes along a block: a row of them is a byte, a layer a word of 64 bits."""
SHARE = 4_096
"""Blocks worked on in one call: a few milliseconds."""
MOST = 4_000_000
"""Blocks over which no set is begun: their table alone takes half a gigabyte."""


@dataclass(frozen=True)
class Blocks:
    """The blocks around objects, and what is done with sets of their cubes.

    A set is a *bitmask*, (b + s, 8) uint64, of which the last rows stand for space without blocks: all that is
    outside the objects, and what is inside each (see `tomomesh.kernels.cuberille.bitmasks`).

    Attributes
    ----------
    keys : (b,) int64 array
        The blocks, rising (see `tomomesh.model.cubes.keys_of`).
    table : (b, 27) int32 array
        Rows of the neighbors of each block; b for space outside, b + 1 and more for space inside.
    spaces : int
        Pieces of space without blocks, s.
    threads : int
        Threads to work with; no result depends on them.
    """

    keys: NDArray[np.int64]
    table: NDArray[np.int32]
    spaces: int
    threads: int = 0

    @classmethod
    def around(cls, cells: NDArray[np.int64], margin: int, *, threads: int = 0) -> Blocks:
        """Take every block within some cubes of the given cells (x, y, z), (c, 3)."""
        keys = once_each(keys_of(cells // EDGE))
        for _ in range(-(-margin // EDGE)):
            keys = dilate(_few_enough(keys), 1)
        wide = dilate(_few_enough(keys), 1)
        inner = np.isin(wide, keys, assume_unique=True)
        table = neighbor_table(wide)
        rows = len(keys) + _spaces(wide, table, inner)
        rows[inner] = np.arange(len(keys))
        return cls(keys, rows[table[inner]].astype(np.int32), int(rows.max()) + 1 - len(keys), threads)

    def __len__(self) -> int:
        return len(self.keys)

    def empty(self) -> Bitmask:
        """Return a set without cubes."""
        return np.zeros((len(self) + self.spaces, EDGE), np.uint64)

    def beyond(self) -> Bitmask:
        """Return the set of the cubes outside the objects that have no blocks."""
        bitmask = self.empty()
        bitmask[len(self)] = ~bitmask[len(self)]
        return bitmask

    def bitmask_of(self, cells: NDArray[np.int64]) -> Bitmask:
        """Return the set of some cells (x, y, z), (c, 3), which all lie in the blocks."""
        bitmask = self.empty()
        word = EDGE * np.searchsorted(self.keys, keys_of(cells // EDGE)) + cells[:, 2] % EDGE
        bit = np.uint64(1) << (EDGE * (cells[:, 1] % EDGE) + cells[:, 0] % EDGE).astype(np.uint64)
        np.bitwise_or.at(bitmask.reshape(-1), word, bit)
        return bitmask

    def grown(self, bitmask: Bitmask, steps: int = 1) -> Bitmask:
        """Add every cube within some steps of a cube, corners included: one axis after the other."""
        for axis in (0, 1, 2) * steps:
            before, bitmask = bitmask, bitmask.copy()
            self.each(partial(grow_along, before, self.table, axis, bitmask))
        return bitmask

    def spread(self, bitmask: Bitmask, within: Bitmask, steps: int) -> Bitmask:
        """Walk some steps from a set through another, corners included; the start is part of the result."""
        for _ in range(steps):
            bitmask = bitmask | (self.grown(bitmask) & within)
        return bitmask

    def flood(self, open_: Bitmask, reached: Bitmask) -> None:
        """Walk over faces from the cubes that are reached to all open ones; what is reached is changed in place."""
        count = len(self)
        waiting, queue, line = np.ones(count, np.bool_), np.arange(count), np.array([0, count])
        while line[1]:
            flood(open_, self.table, reached, waiting, queue, line, SHARE)

    def composed(self, solid: Bitmask) -> tuple[Bitmask, int]:
        """Fill every contact along an edge or at a corner, once; return also how many cubes that took."""
        filled, near = solid.copy(), self.grown(solid) & ~solid
        added = np.zeros(-(-len(self) // SHARE), np.int64)

        def work(begin: int, end: int) -> None:
            added[begin // SHARE] = compose(solid, self.table, near, filled, begin, end)

        self.each(work)
        return filled, int(added.sum())

    def each(self, work: Callable[[int, int], None]) -> None:
        """Share the blocks among threads."""
        in_blocks(work, len(self), block=SHARE, threads=self.threads)

    def united(self, sets: Sequence[tuple[Blocks, Bitmask]], beyond: Bitmask) -> Bitmask:
        """Unite sets that lie in blocks of their own; space without blocks is as in another set of these blocks."""
        whole = self.empty()
        for blocks, bitmask in sets:
            rows = np.searchsorted(self.keys, blocks.keys)
            there = self.keys[np.minimum(rows, len(self) - 1)] == blocks.keys
            whole[rows[there]] |= bitmask[: len(blocks)][there]
        whole[len(self) :] = beyond[len(self) :]
        return whole

    def count(self, bitmask: Bitmask) -> NDArray[np.int64]:
        """Return how many cubes each word holds, (b, 8)."""
        return np.bitwise_count(bitmask[: len(self)]).astype(np.int64)

    def cells(self, bitmask: Bitmask) -> NDArray[np.int64]:
        """Return the positions (x, y, z) of the cubes of a set, block by block, (c, 3)."""
        count = self.count(bitmask)
        cells = np.empty((int(count.sum()), 3), np.int64)
        list_cubes(bitmask, cells_of(self.keys), before(count), cells)
        return cells


def before(count: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how many come before each entry, in an array of the same shape."""
    return np.asarray(np.cumsum(count.ravel()).reshape(count.shape) - count)


def _few_enough(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    if len(keys) > MOST:
        raise ResourceError(
            "the cubes around the points would not fit into memory",
            found=f"{len(keys)} blocks of {EDGE} x {EDGE} x {EDGE} cubes",
            expected=f"at most {MOST}",
            hint="a larger --cell-mm or a smaller --closing",
        )
    return keys


def _spaces(keys: NDArray[np.int64], table: NDArray[np.int32], inner: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Find the piece of space that each empty block around the inner ones belongs to: 0 is outside.

    The empty blocks fall apart into layers that are connected over faces: one around each object, one lining each
    cavity. What comes next below the lowest block of a layer tells: an object below the lining of a cavity; below
    the layer around an object nothing, or another layer, on the far side of the space that both lie in.
    """
    labels = np.full(len(inner), -1, np.int32)
    label_components(np.ascontiguousarray(table[:, FACE_COLUMNS]), ~inner, labels)
    empty = np.flatnonzero(~inner)
    layers, first = np.unique(labels[empty], return_index=True)
    below = _next_below(keys, empty[first])
    lining = (below >= 0) & inner[below]
    space = np.where((below < 0) | lining, layers, labels[below])
    while (space != space[space]).any():
        space = space[space]
    return np.asarray(np.append((np.cumsum(lining) * lining)[space], 0)[labels])


def _next_below(keys: NDArray[np.int64], rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the row of the next block below some blocks, however far; -1 where there is none."""
    columns = keys_of(cells_of(keys)[:, ::-1])
    order = np.argsort(columns)
    at = np.searchsorted(columns[order], columns[rows])
    below = order[at - 1]
    return np.where((at > 0) & (columns[below] // SIDE == columns[rows] // SIDE), below, -1)
