"""What a slab has of a mask: its cells, and what the levels say of the borders between its voxels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..isosurface.crossings import BARELY, IN_LINE, Levels, Stretch
from ..isosurface.surface_nets import OWNED, borders_of, steps_of
from ..isosurface.thin import thin_squares
from ..isosurface.well_composed import JOINING, cells_where, joining, surface_cells
from .parts import Part

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..isosurface.means import Span

    Ints = NDArray[np.int32]
    Marks = NDArray[np.bool_]

SURE = 3
"""Layers beside a slab's own of which the voxels have to be known: a mask is thin where it ends within so many."""
FEWEST = 8
"""Layers of a mask that a slab looks at on each side at first, for rounds of joining. Chosen: masks at hand take 1 to 5
rounds, noise 6 to 10, for which slabs are looked at again with twice as many."""
PART = 200_000
"""Squares whose levels are looked at together. No result depends on it."""


@dataclass(frozen=True)
class Frame:
    """The box of a mask with one layer of background around it, within a volume.

    Attributes
    ----------
    low : (int, int, int)
        The voxel (z, y, x) of the volume that is its first.
    shape : (int, int, int)
        Its slices, rows and columns.
    volume : (int, int, int)
        Those of the volume.
    """

    low: tuple[int, int, int]
    shape: tuple[int, int, int]
    volume: tuple[int, int, int]

    @property
    def lowest(self) -> Ints:
        """Its first voxel as (x, y, z)."""
        return np.array(self.low[::-1], np.int32)

    def held(self, start: int, stop: int) -> Span:
        """Return the slices of the volume that the mask can have something in, of some of its own."""
        return max(start, 1) + self.low[0], min(stop, self.shape[0] - 1) + self.low[0]

    def drawn(self, mask: Any, start: int, stop: int) -> Marks:
        """Draw some of its slices of a mask of those slices of the volume that are `held`."""
        _, rows, columns = self.shape
        found, first = np.zeros((stop - start, rows, columns), np.bool_), max(start, 1) - start
        box = tuple(slice(low + 1, low + size - 1) for low, size in zip(self.low[1:], self.shape[1:], strict=True))
        dense = mask[:][(slice(None), *box)]
        found[first : first + len(dense), 1:-1, 1:-1] = dense
        return found


@dataclass(frozen=True)
class Ground:
    """What a slab has of a mask.

    Attributes
    ----------
    cells : Part
        Cells (n, 3) in the numbers of the frame, and their cases (n,).
    squares : Part
        Whether the mask is thin behind each (q,), whether the voxel behind it was added (q,), and the levels at the
        four places in line with it (q, 4, L).
    rounds : int
        The last round of joining in which one of its own voxels was added, as far as can be told.
    added : int
        Own voxels that were added.
    layers : (2, l) int64 array
        How many vertices, and how many squares, each of its own layers has.
    """

    cells: Part
    squares: Part
    rounds: int
    added: int
    layers: NDArray[np.int64]


def ground(mask: Any, voxels: Any, own: Span, halo: Span, *, frame: Frame, levels: Levels, threads: int = 1) -> Ground:
    """Look at a slab and its halo.

    Parameters
    ----------
    mask : (k, J, I) bool array, or RunMask
        The slices of the volume that are `Frame.held` between those of the halo.
    voxels : (k, J, I[, L]) array, LazyVoxels or None
        The slices of the volume that lie between those of the halo; with None the mask itself is what the levels are.
    own, halo : (int, int)
        Layers of cells in the frame: those of the slab, and those and its halo. A layer's cells lie between the voxels
        of a slice with its number and those of the next.
    frame : Frame
    levels : Levels
        The window; its voxels are not looked at.
    threads : int
    """
    held = frame.drawn(mask, halo[0], halo[1] + 1)
    stretch = _stretch(held, voxels, halo, frame)
    known = replace(levels, voxels=stretch)
    low = frame.lowest + np.array([0, 0, halo[0]], np.int32)
    joined, rounds = _joined(held, known, low, own, halo, frame.shape[0] - 1, threads)
    inside = slice(own[0] - halo[0], own[1] - halo[0] + 1)
    cells, cases = surface_cells(joined[inside], threads)
    cells += np.array([0, 0, own[0]], np.int32)
    added = int(np.count_nonzero(joined[inside][:-1])) - int(np.count_nonzero(held[inside][:-1]))
    inner, directions = borders_of(cells + frame.lowest, cases, threads)
    steps, stored = steps_of(directions), np.promote_types(stretch.stored.dtype, np.float16)  # the latter holds NaN
    x, y, z = (inner - low).T
    squares = thin_squares(joined, inner - low, steps, threads), ~held[z, y, x], _lines(known, inner, steps, stored)
    return Ground(Part(0, (cells, cases)), Part(0, squares), rounds, added, _counted(cells, cases, own))


def _stretch(held: Marks, voxels: Any, halo: Span, frame: Frame) -> Stretch:
    """Return the levels around a slab: those of a volume, or of the mask."""
    z, y, x = frame.low
    if voxels is None:
        return Stretch(held, (z + halo[0], y, x), frame.volume)
    dense = voxels.read() if hasattr(voxels, "read") else np.asarray(voxels)
    return Stretch(dense, (max(z + halo[0], 0), 0, 0), (*frame.volume, *dense.shape[3:]))


def _joined(
    held: Marks, levels: Levels, low: Ints, own: Span, halo: Span, layers: int, threads: int
) -> tuple[Marks, int]:
    """Join what touches along edges or at corners alone, and tell the last round that reached its own layers.

    After the rounds that are exact there is one more, which tells whether they were enough.
    """
    cells, _ = cells_where(held, JOINING > 0, threads)
    joined, last, reach = held.copy() if len(cells) else held, 0, _exact_rounds(own, halo, layers)
    for count, voxels in enumerate(joining(joined, cells, lambda voxels: levels.excess(voxels + low)), 1):
        z = voxels[:, 2] + halo[0]
        last = count if ((z >= own[0]) & (z < own[1])).any() else last
        if count > reach:
            break
    return joined, last


def _exact_rounds(own: Span, halo: Span, layers: int) -> float:
    """Return after how many rounds a slab's own voxels, and those within `SURE` layers, are what they are in the whole.

    A voxel that is added in a round depends on layers within as many as there have been rounds.
    """
    below = own[0] - halo[0] if halo[0] > 0 else np.inf
    above = halo[1] - own[1] if halo[1] < layers else np.inf
    return float(min(below, above) - SURE)


def _lines(levels: Levels, inner: Ints, steps: Ints, stored: np.dtype[Any]) -> NDArray[Any]:
    """Return the levels (q, 4, L) at the four places in line with each border."""
    parts = (slice(n, n + PART) for n in range(0, max(len(inner), 1), PART))
    found = [
        np.stack([levels.at(inner[one] + n * steps[one]).astype(stored) for n in IN_LINE], axis=1) for one in parts
    ]
    return np.concatenate(found)


def _counted(cells: Ints, cases: NDArray[np.uint8], own: Span) -> NDArray[np.int64]:
    """Count the vertices and the squares of each own layer."""
    layer, count = cells[:, 2] - own[0], own[1] - own[0]
    return np.array([np.bincount(layer, minlength=count), np.bincount(layer, OWNED[cases], count)]).astype(np.int64)


def told(found: Ground) -> tuple[int, int, bool, NDArray[np.int64]]:
    """Return what the driver asks: rounds, voxels added, whether anything is thin, counts."""
    return found.rounds, found.added, bool(found.squares.arrays[0].any()), found.layers


def sample(first: int, every: int, found: Ground) -> NDArray[np.float64]:
    """Return the levels (m, 4, L) of the squares whose number in the whole is a multiple of some."""
    return found.squares.arrays[2][-first % every :: every].astype(np.float64)


def cells_from(first: int, found: Ground) -> Part:
    """Return a slab's cells, now that their numbers are known."""
    return replace(found.cells, first=first)


def squares_from(first: int, found: Ground, *, levels: Levels, even: bool, threads: int = 1) -> Part:
    """Return whether the mask is thin behind squares (q,), and how far to the next voxel each one's crossing is (q,).

    Parameters
    ----------
    first : int
        Number of the first in the whole.
    found : Ground
    levels : Levels
    even : bool
        Whether the levels are those of a mask, so that all crossings are half way: then the second is left out.
    threads : int
    """
    thin, added, lines = found.squares.arrays
    if even:
        return Part(first, (thin,))
    inside, outside = (np.ascontiguousarray(lines[:, n], np.float64) for n in (1, 2))
    return Part(first, (thin, np.where(added, BARELY, levels.left(inside, outside, threads))))
