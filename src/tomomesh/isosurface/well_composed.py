"""Make a mask well composed with the fewest, likeliest voxels, so that its surface is a 2-manifold.

Voxels that touch only along an edge or at a corner make edges with four faces, or corners where two sheets meet
(Latecki 1997). Of the voxels that would join them, those whose gray level is nearest to the window are added.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ResourceError
from ..kernels.isosurface.voxels import count_cells, list_cells
from ..kernels.threads import in_blocks

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    Cells = tuple[NDArray[np.int32], NDArray[np.uint8]]

LAYERS = 8
"""Slices scanned in one call: far below 100 ms."""
MOST_CELLS = 40_000_000
"""Cells over which a surface is refused: it would take some 16 gigabytes."""
PART = 200_000
"""Cells or voxels looked at together. No result depends on it."""
CORNERS = np.array([(n & 1, n >> 1 & 1, n >> 2) for n in range(8)], np.int32)
"""Steps (x, y, z) from the lowest corner of a cell to each of its eight."""


def _joining(case: int) -> int:
    """Return the corners, as bits, of which one would remove a contact; 0 for a case without one."""
    found = 0
    for axis, side in product(range(3), (0, 1)):
        a, b, c, d = (n for n in range(8) if CORNERS[n, axis] == side)
        for pair, between in (((a, d), 1 << b | 1 << c), ((b, c), 1 << a | 1 << d)):
            touching = all(case >> n & 1 for n in pair)
            found |= between if touching and not case & between else 0
    for n in range(4):
        opposite = 1 << n | 1 << 7 - n
        found |= {opposite: 255 - opposite, 255 - opposite: opposite}.get(case, 0)
    return found


JOINING = np.array([_joining(case) for case in range(256)], np.uint8)
MIXED = np.array([0 < case < 255 for case in range(256)])


def cells_where(
    mask: NDArray[np.bool_], wanted: NDArray[np.bool_], threads: int = 0
) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
    """Find the cells between eight voxels whose case is wanted.

    Parameters
    ----------
    mask : (K, J, I) bool array
    wanted : (256,) bool array
    threads : int

    Returns
    -------
    cells : (n, 3) int32 array
        The voxel (x, y, z) in the lowest corner of each cell, ordered by z, then y, then x.
    cases : (n,) uint8 array
        Bit n is set where corner n of `CORNERS` is inside.

    Raises
    ------
    ResourceError
        Where there are more than `MOST_CELLS`.
    """
    layers = len(mask) - 1
    count = np.empty(layers, np.int64)
    in_blocks(lambda a, b: count_cells(mask, wanted, count, a, b), layers, block=LAYERS, threads=threads)
    total = int(count.sum())
    if total > MOST_CELLS:
        raise ResourceError(
            "the window's boundary is too large",
            found=f"cells = {total}",
            expected=f"at most {MOST_CELLS}",
            hint="a window with less noise, a part of the study, or a network",
        )
    cells, cases = np.empty((total, 3), np.int32), np.empty(total, np.uint8)
    first = np.cumsum(count) - count
    in_blocks(lambda a, b: list_cells(mask, wanted, first, cells, cases, a, b), layers, block=LAYERS, threads=threads)
    return cells, cases


def surface_cells(mask: NDArray[np.bool_], threads: int = 0) -> Cells:
    """Find the cells between eight voxels that are not alike, as `cells_where` returns them."""
    return cells_where(mask, MIXED, threads)


def without_contacts(
    mask: NDArray[np.bool_],
    excess: Callable[[NDArray[np.int32]], NDArray[np.float64]],
    threads: int = 0,
    known: Cells | None = None,
) -> NDArray[np.bool_]:
    """Add voxels until no two touch along an edge only, or at a corner only.

    Where several voxels would remove a contact, those nearest to the window are added, all that are equally near:
    so the result is the same for mirrored masks.

    Parameters
    ----------
    mask : (K, J, I) bool array
        With one layer of background around it.
    excess : callable
        Told voxels (n, 3) as (x, y, z), returns how far each one's gray level is outside the window, (n,).
    threads : int
    known : tuple of arrays, optional
        What `surface_cells` found of the mask.

    Returns
    -------
    (K, J, I) bool array
        The mask itself where no voxel was added.
    """
    mask = np.ascontiguousarray(mask)
    found, cases = surface_cells(mask, threads) if known is None else known
    cells = found[JOINING[cases] > 0]
    joined = mask.copy() if len(cells) else mask
    for _ in joining(joined, cells, excess):
        pass
    return joined


def joining(
    mask: NDArray[np.bool_], cells: NDArray[np.int32], excess: Callable[[NDArray[np.int32]], NDArray[np.float64]]
) -> Iterator[NDArray[np.int32]]:
    """Add voxels to a mask, in place, round after round, until none touch along an edge or at a corner only.

    What is added at a place depends on what was within so many voxels around it as rounds have been made.

    Parameters
    ----------
    mask, excess
        As of `without_contacts`.
    cells : (n, 3) int32 array
        Those whose voxels do.

    Yields
    ------
    (m, 3) int32 array
        The voxels (x, y, z) that were added in a round.
    """
    while len(cells):
        voxels = _once_each([_nearest_to_window(part, mask, excess) for part in _parts(cells)], mask.shape)
        x, y, z = voxels.T
        mask[z, y, x] = True
        yield voxels
        cells = _once_each([_touching_around(part, mask) for part in _parts(voxels)], mask.shape)


def _parts(places: NDArray[np.int32]) -> Iterator[NDArray[np.int32]]:
    """Yield places (n, 3) part by part, which bounds the memory."""
    return (places[n : n + PART] for n in range(0, len(places), PART))


def _nearest_to_window(
    cells: NDArray[np.int32], mask: NDArray[np.bool_], excess: Callable[[NDArray[np.int32]], NDArray[np.float64]]
) -> NDArray[np.int32]:
    """Return the joining voxels of least excess in each cell."""
    joining = JOINING[_cases_of(mask, cells)]
    cell, corner = np.nonzero(joining[:, None] >> np.arange(8, dtype=np.uint8) & 1)
    voxels = cells[cell] + CORNERS[corner]
    far = excess(voxels)
    least = np.minimum.reduceat(far, np.flatnonzero(np.diff(cell, prepend=-1)))
    return np.asarray(voxels[far == least[cell]])


def _touching_around(voxels: NDArray[np.int32], mask: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return the cells with a contact that have one of the voxels as a corner, as far as the mask has their slices."""
    around = (voxels[:, None, :] - CORNERS).reshape(-1, 3)
    around = around[(around[:, 2] >= 0) & (around[:, 2] < len(mask) - 1)]
    return np.asarray(around[JOINING[_cases_of(mask, around)] > 0])


def _once_each(parts: list[NDArray[np.int32]], shape: tuple[int, ...]) -> NDArray[np.int32]:
    """Join voxels or cells (n, 3), order them by z, then y, then x, and drop repetitions."""
    numbers = [np.unique(np.ravel_multi_index(tuple(places.T[::-1]), shape)) for places in parts]
    kept = np.unique(np.concatenate(numbers))
    return np.stack(np.unravel_index(kept, shape)[::-1], axis=1).astype(np.int32)


def _cases_of(mask: NDArray[np.bool_], cells: NDArray[np.int32]) -> NDArray[np.uint8]:
    x, y, z = (cells[:, None, :] + CORNERS).transpose(2, 0, 1)
    return np.asarray(np.packbits(mask[z, y, x], axis=1, bitorder="little")[:, 0])
