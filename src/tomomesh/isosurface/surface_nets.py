"""A net of springs around the voxels of a mask: every vertex moves within a cell of its own (Gibson 1998)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..cuberille.neighbors import DIRECTIONS
from ..kernels.isosurface.voxels import link_cells, list_borders, list_faces, list_fans
from .means import means, over
from .well_composed import CORNERS, surface_cells

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .means import Span
    from .well_composed import Cells

OWNED = np.array([sum((case ^ case >> shift) & 1 for shift in (1, 2, 4)) for case in range(256)])
"""Faces that a cell owns: those between its lowest corner and the next along each axis."""


BELOW = np.full(3, -1, np.int32)
"""The first voxel of a mask that has a layer more than the study around it."""


def _linked() -> NDArray[np.bool_]:
    """Tell for every case which of the six neighbors share a side of a face with the cell: (256, 6)."""
    inside = np.arange(256)[:, None] >> np.arange(8) & 1
    beside = [inside[:, CORNERS[:, n // 2] == n % 2].sum(axis=1) for n in range(6)]
    return np.stack([(count > 0) & (count < 4) for count in beside], axis=1)


LINKED = _linked()


@dataclass(frozen=True)
class Net:
    """The surface of a mask: a vertex in every cell between eight voxels that are not alike.

    Attributes
    ----------
    low : (n, 3) int32 array
        Lowest corner of each vertex' cell, as voxel indices (x, y, z).
    links : (n, 6) int32 array
        Neighbors along the sides of squares, by direction; -1 where there is none.
    fans : (n, 6) int32 array
        The squares around each vertex, then -1.
    quads : (q, 4) int32 array
        The squares, counter-clockwise from outside in the space of the indices.
    twins : (q, 4) int32 array
        The square beyond the side from each corner to the next, times four, plus the number of its own side there.
    inner : (q, 3) int32 array
        The voxel behind each.
    directions : (q,) uint8 array
        The direction from it to the voxel outside.
    """

    low: NDArray[np.int32]
    links: NDArray[np.int32]
    fans: NDArray[np.int32]
    quads: NDArray[np.int32]
    twins: NDArray[np.int32]
    inner: NDArray[np.int32]
    directions: NDArray[np.uint8]

    @property
    def steps(self) -> NDArray[np.int32]:
        """Steps from the voxels inside to those outside, (q, 3)."""
        return steps_of(self.directions)

    @property
    def corners(self) -> NDArray[np.int32]:
        """The corners of each square that no other surface goes through, (q, 4): all of them."""
        return self.quads

    def goals(self, places: NDArray[np.float64], threads: int) -> NDArray[np.float64]:
        """Return where the vertices are drawn to whose squares are drawn to places (q, 3): to their mean."""
        return means(places, self.fans, threads)


def net_around(
    mask: NDArray[np.bool_], threads: int = 0, lowest: NDArray[np.int32] = BELOW, known: Cells | None = None
) -> Net:
    """Span a net around the voxels of a mask.

    Parameters
    ----------
    mask : (K, J, I) bool array
        Well composed, with one layer of background around it.
    threads : int
    lowest : (3,) int32 array
        The voxel (x, y, z) of the study that is its first.
    known : tuple of arrays, optional
        What `surface_cells` found of the mask.

    Returns
    -------
    Net
        Vertices in the order of their cells, by z, then y, then x.
    """
    cells, cases = surface_cells(mask, threads) if known is None else known
    return net_of(cells, cases, mask.shape[1:], lowest, threads)


def net_of(
    cells: NDArray[np.int32],
    cases: NDArray[np.uint8],
    shape: tuple[int, ...],
    lowest: NDArray[np.int32],
    threads: int = 0,
    exact: Span | None = None,
) -> Net:
    """Span a net between cells.

    Parameters
    ----------
    cells, cases
        Of `surface_cells`: all, or those of some layers.
    shape : (int, int)
        Rows and columns of the mask.
    lowest : (3,) int32 array
        As of `net_around`.
    threads : int
    exact : (int, int), optional
        The first of the cells whose squares, and behind the last of those whose fans and rings are wanted, where cells
        of other layers lie beyond them.
    """
    start, stop = exact or (0, len(cells))
    table = np.empty((len(cells), 6), np.int32)
    link_cells(cells, cases, LINKED, np.full((2, *shape), -1, np.int32), table)
    first, low = faces_before(cases), cells + lowest
    inner, directions = borders_of(low, cases, threads)
    quads, twins = np.zeros((2, len(inner), 4), np.int32)
    fans = np.zeros((len(cells), 6), np.int32)
    over(lambda a, b: list_faces(cases, table, first, quads, a, b), (start, len(cells)), threads)
    over(lambda a, b: list_fans(cases, table, first, fans, twins, a, b), (0, stop), threads)
    return Net(low, table, fans, quads, twins, inner, directions)


def faces_before(cases: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return how many faces are owned by the cells before each, (n,)."""
    owned = OWNED[cases]
    return np.asarray(np.cumsum(owned) - owned)


def borders_of(
    low: NDArray[np.int32], cases: NDArray[np.uint8], threads: int = 0
) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
    """Return the voxels (q, 3) behind the faces that cells own, and the directions (q,) to those outside.

    Parameters
    ----------
    low : (n, 3) int32 array
        Lowest corner of each cell, as voxel indices (x, y, z).
    cases : (n,) uint8 array
    threads : int
    """
    first, total = faces_before(cases), int(OWNED[cases].sum())
    inner, directions = np.empty((total, 3), np.int32), np.empty(total, np.uint8)
    over(lambda a, b: list_borders(low, cases, first, inner, directions, a, b), (0, len(cases)), threads)
    return inner, directions


def steps_of(directions: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Return the steps (q, 3) along directions (q,)."""
    return np.take(np.array(DIRECTIONS, np.int32), directions, axis=0)
