"""What a slab has of a mask: its cells, and what the levels say of the borders between its voxels."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..isosurface.crossings import BARELY, Levels
from ..isosurface.run_mask import RunMask
from ..isosurface.surface_nets import OWNED, borders_of, steps_of
from ..isosurface.thin import thin_squares
from ..isosurface.well_composed import JOINING, surface_cells
from .contacts import drawn_from, joined_in, packed
from .parts import Part

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..isosurface.crossings import Stretch
    from ..isosurface.means import Span
    from ..isosurface.well_composed import Cells
    from .frame import MaskFrame

    Ints = NDArray[np.int32]
    Marks = NDArray[np.bool_]

NOTHING = Part(0, (np.zeros(0, np.bool_),))
PART = 50_000
"""Squares whose levels are looked at together. No result depends on it."""


@dataclass(frozen=True)
class SlabMask:
    """What a slab has of a mask.

    Attributes
    ----------
    bits : Part
        Its own slices of the frame, joined.
    unfinished : bool
        Whether they are to be joined further; then there is nothing else.
    added : int
        Own voxels that were added.
    cells : Part
        Cells (n, 3) in the numbers of the frame, and their cases (n,).
    squares : Part
        Whether the mask is thin behind each (q,), whether the voxel behind it was added (q,), and the levels at the
        four places in line with it (q, 4, L).
    layers : (2, l) int64 array
        How many vertices, and how many squares, each of its own layers has.
    """

    bits: Part
    unfinished: bool
    added: int = 0
    cells: Part = NOTHING
    squares: Part = NOTHING
    layers: NDArray[np.int64] = field(default_factory=lambda: np.zeros((2, 0), np.int64))


def ground(
    mask: Any, voxels: Any, own: Span, halo: Span, bits: Sequence[Part], solid: Any, *, frame: MaskFrame,
    levels: Levels, rounds: float, threads: int = 1,
) -> SlabMask:  # fmt: skip
    """Look at a slab and its halo.

    Parameters
    ----------
    mask : (k, J, I) bool array, or RunMask
        The slices of the volume that are `MaskFrame.mask_slices` between those of the halo.
    voxels : (k, J, I[, L]) array, LazyVoxels or None
        The slices of the volume that are `MaskFrame.level_slices` around the halo; with None the mask is all there is.
    own, halo : (int, int)
        Layers of cells in the frame: those of the slab, and those and its halo. A layer's cells lie between the voxels
        of a slice with its number and those of the next.
    bits : sequence of Part
        What has been joined so far, of the slices of the halo; none at first.
    solid : (k, J, I) bool array, RunMask or None
        The slices of the frame whose boundary is wanted, where it is not that of what is joined.
    frame : MaskFrame
    levels : Levels
        The window; its voxels are not looked at.
    rounds : float
        Of joining, at most; 0 where it is done.
    threads : int
    """
    held, (_, *rows) = frame.drawn(mask, halo[0], halo[1] + 1, threads), frame.shape
    stretch, low = frame.stretch(held, voxels, halo), frame.lowest + np.array([0, 0, halo[0]], np.int32)
    known, inside = replace(levels, voxels=stretch), (own[0] - halo[0], own[1] - halo[0])
    begun = drawn_from(bits, halo[0], halo[1] + 1, tuple(rows)) if bits else held
    scanned = surface_cells(begun, threads)
    joined, unfinished = joined_in(begun, scanned[0][JOINING[scanned[1]] > 0], known, low, inside, rounds)
    slices = slice(*inside)
    found = SlabMask(packed(joined[slices], own[0]), unfinished)
    if unfinished:
        return found
    added = int(np.count_nonzero(joined[slices])) - int(np.count_nonzero(held[slices]))
    cells, cases = (
        _own(scanned, inside)
        if solid is None and joined is begun
        else _scanned(joined if solid is None else solid[:], inside, threads)
    )
    cells = cells + np.array([0, 0, halo[0]], np.int32)
    inner, directions = borders_of(cells + frame.lowest, cases, threads)
    x, y, z = (inner - low).T
    thin = thin_squares(joined, inner - low, steps_of(directions), threads)
    squares = thin, ~held[z, y, x], _lines(stretch, inner, directions, threads)
    layers = _counted(cells, cases, own)
    return replace(found, added=added, cells=Part(0, (cells, cases)), squares=Part(0, squares), layers=layers)


def _own(found: Cells, layers: Span) -> Cells:
    """Return the cells of some layers."""
    rows = slice(*np.searchsorted(found[0][:, 2], layers))
    return found[0][rows], found[1][rows].copy()


def _scanned(mask: Marks, layers: Span, threads: int) -> Cells:
    """Find the cells of some layers of a mask."""
    cells, cases = surface_cells(mask[layers[0] : layers[1] + 1], threads)
    return cells + np.array([0, 0, layers[0]], np.int32), cases


def _lines(stretch: Stretch, inner: Ints, directions: NDArray[np.uint8], threads: int) -> NDArray[Any]:
    """Return the levels (q, 4, L) in line with each border, see `Stretch.lines`."""
    parts = (slice(n, n + PART) for n in range(0, max(len(inner), 1), PART))
    return np.concatenate([stretch.lines(inner[one], directions[one], threads) for one in parts])


def _counted(cells: Ints, cases: NDArray[np.uint8], own: Span) -> NDArray[np.int64]:
    """Count the vertices and the squares of each own layer."""
    layer, count = cells[:, 2] - own[0], own[1] - own[0]
    return np.array([np.bincount(layer, minlength=count), np.bincount(layer, OWNED[cases], count)]).astype(np.int64)


class MaskCounts(NamedTuple):
    """What the driver asks of a slab; see `SlabMask`."""

    unfinished: bool
    added: int
    thin: bool
    layers: NDArray[np.int64]


def told_of(found: SlabMask) -> MaskCounts:
    """Return it; whether the mask is thin anywhere with it."""
    return MaskCounts(found.unfinished, found.added, bool(found.squares.arrays[0].any()), found.layers)


def bits_of(found: SlabMask) -> Part:
    """Return a slab's slices, joined."""
    return found.bits


def runs_of(found: SlabMask, *, shape: tuple[int, ...]) -> RunMask:
    """Return them as runs."""
    first = found.bits.first
    return RunMask.of([drawn_from([found.bits], first, first + len(found.bits), shape)])


def sample(first: int, every: int, found: SlabMask) -> NDArray[np.float64]:
    """Return the levels (m, 4, L) of the squares whose number in the whole is a multiple of some."""
    return found.squares.arrays[2][-first % every :: every].astype(np.float64)


def cells_from(first: int, found: SlabMask) -> Part:
    """Return a slab's cells, now that their numbers are known."""
    return replace(found.cells, first=first)


def squares_from(first: int, found: SlabMask, *, levels: Levels, even: bool, threads: int = 1) -> Part:
    """Return whether the mask is thin behind squares (q,), and how far to the next voxel each one's crossing is (q,).

    Parameters
    ----------
    first : int
        Number of the first in the whole.
    found : SlabMask
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
