"""Voxels of a slab that touch along edges or at corners alone are joined, as in the whole."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..isosurface.run_mask import RunMask
from ..isosurface.runs import Runs
from ..isosurface.well_composed import joining
from .parts import Part, gathered

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..isosurface.crossings import Levels
    from ..isosurface.means import Span

    Ints = NDArray[np.int32]
    Marks = NDArray[np.bool_]

AROUND = 8
"""Layers that a slab looks at on each side for that. Chosen: masks at hand take 1 to 5 rounds, for which it is enough;
noise takes up to 20, and slabs hand each other what they have joined every five."""
SURE = 3
"""Layers beside a slab's own of which the voxels have to be known: a mask is thin where it ends within so many."""
ROUNDS = AROUND - SURE
"""Rounds after which they are: what is added in a round depends on layers within as many as there have been rounds."""


def joined_in(mask: Marks, cells: Ints, levels: Levels, low: Ints, own: Span, rounds: float) -> tuple[Marks, bool]:
    """Join voxels round after round.

    Parameters
    ----------
    mask : (k, J, I) bool array
        What a slab and its halo have.
    cells : (n, 3) int32 array
        Those of it whose voxels touch so.
    levels : Levels
    low : (3,) int32 array
        The voxel (x, y, z) of the volume that is its first.
    own : (int, int)
        The slab's own slices among these.
    rounds : float
        At most so many.

    Returns
    -------
    joined : (k, J, I) bool array
        The mask itself where nothing is to be joined.
    unfinished : bool
        Whether one more round would add voxels of the slab's own.
    """
    joined = mask.copy() if len(cells) else mask
    for count, voxels in enumerate(joining(joined, cells, lambda voxels: levels.excess(voxels + low)), 1):
        if count > rounds:
            x, y, z = voxels.T
            joined[z, y, x] = False  # in the whole they may be others
            return joined, bool(((z >= own[0]) & (z < own[1])).any())
    return joined, False


def packed(mask: Marks, first: int) -> Part:
    """Return slices (k, J, I) as bits, which have a number in the whole."""
    return Part(first, (np.packbits(mask.reshape(len(mask), -1), axis=1),))


def drawn_from(parts: Sequence[Part], first: int, last: int, shape: tuple[int, ...]) -> Marks:
    """Draw slices of which there are bits; those of which there are none are empty."""
    (bits,) = gathered(parts, (first, last))
    size = shape[0] * shape[1]
    return np.unpackbits(bits, axis=1, count=size).view(np.bool_).reshape(len(bits), *shape)


def whole_of(slices: Sequence[RunMask]) -> RunMask:
    """Return the mask of a frame from those of its slabs; what lies behind the last slice is empty."""
    return RunMask.joined([*slices, RunMask.none((1, *slices[0].shape[1:]))])


def filled(mask: RunMask) -> RunMask:
    """Fill what the outside of a frame does not reach; a mask without contacts stays without them."""
    holes = Runs.of(~mask)
    return mask | holes.mask.only(~holes.bordering[holes.parts])


def cavities_in(mask: RunMask) -> int:
    """Count what the outside of a frame does not reach."""
    return int(np.count_nonzero(~Runs.of(~mask).bordering))
