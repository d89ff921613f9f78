"""A net of springs around the voxels of a mask: every vertex moves within a cell of its own (Gibson 1998)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..cuberille.neighbors import DIRECTIONS
from ..dynamics.iterate import iterate
from ..kernels.isosurface.surface_nets import lean, move_in_cells, pull_squares
from ..kernels.isosurface.voxels import link_cells, list_faces, list_fans
from ..kernels.threads import in_blocks
from ..model.trace import Motion
from ..progress import Progress, silent
from .means import BLOCK, means
from .thin import AFTER, given_back
from .well_composed import CORNERS, surface_cells

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.trace import Trace
    from ..settings import FitSettings
    from .crossings import LevelCrossings
    from .well_composed import Cells

    Floats = NDArray[np.float64]

MARGIN = 1e-3
"""Share of a cell that a vertex keeps from its faces, so that two vertices, each in a cell of its own, never meet.
Chosen: half and twice of it change the distance by 0.0 %."""
TENSION = 2.4
"""Stiffness of the springs at a setting of 1. Measured on a CT and an MR at the default setting: more would turn less
than marching cubes by more than a tenth, and lie farther from them than 0.06 and 0.09 voxel."""
SAFE = 0.95
"""Share of the longest step that never overshoots. Derived: at 1 a net that goes up and down would do so for ever."""

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
    low : (n, 3) float array
        Lowest corner of each vertex' cell, as voxel indices (x, y, z).
    links : (n, 6) int32 array
        Neighbors along the sides of squares, by direction; -1 where there is none.
    fans : (n, 6) int32 array
        The squares around each vertex, then -1.
    quads : (q, 4) int32 array
        The squares, counter-clockwise from outside in the space of the indices.
    inner : (q, 3) int32 array
        The voxel behind each.
    directions : (q,) uint8 array
        The direction from it to the voxel outside.
    """

    low: NDArray[np.float64]
    links: NDArray[np.int32]
    fans: NDArray[np.int32]
    quads: NDArray[np.int32]
    inner: NDArray[np.int32]
    directions: NDArray[np.uint8]

    @property
    def steps(self) -> NDArray[np.int32]:
        """Steps from the voxels inside to those outside, (q, 3)."""
        return np.array(DIRECTIONS, np.int32)[self.directions]


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
    table = np.empty((len(cells), 6), np.int32)
    link_cells(cells, cases, LINKED, np.empty((2, *mask.shape[1:]), np.int32), table)
    owned = OWNED[cases]
    first = np.cumsum(owned) - owned
    total = int(owned.sum())
    quads, directions = np.empty((total, 4), np.int32), np.empty(total, np.uint8)
    fans = np.empty((len(cells), 6), np.int32)

    def work(start: int, stop: int) -> None:
        list_faces(cases, table, first, quads, directions, start, stop)
        list_fans(cases, table, first, fans, start, stop)

    in_blocks(work, len(cells), block=BLOCK, threads=threads)
    low = cells + lowest
    backward = np.maximum(-np.array(DIRECTIONS, np.int32), 0)[directions]
    return Net(low.astype(np.float64), table, fans, quads, np.repeat(low, owned, axis=0) + backward, directions)


@dataclass(frozen=True)
class NetFit:
    """A net after the fit.

    Attributes
    ----------
    start, positions : (n, 3) float array
        The vertices before and after, as voxel indices (x, y, z).
    trace : Trace
        In voxels; `potential`, `distance_mm`, `clamped` and `unattracted` are not measured.
    """

    start: Floats
    positions: Floats
    trace: Trace


def settle(
    net: Net, crossings: LevelCrossings, settings: FitSettings, *, threads: int = 0, progress: Progress = silent
) -> NetFit:
    """Draw the middles of the squares to their crossings, while springs even the net out.

    At rest  mean(p - c) + s mean(x_j - x) = 0  for every vertex x: p are the crossings and c the middles of the
    squares around it, x_j its neighbors, s the stiffness. No vertex leaves its cell. Around the parts of thick voxels
    and around a mask the springs resist bends, with  b (l - mean l_j)  in place of  s l,  l = mean(x_j - x).

    Parameters
    ----------
    net : Net
    crossings : LevelCrossings
        One a square.
    settings : FitSettings
    threads : int
    progress : callable

    Returns
    -------
    NetFit
    """
    start = means(crossings.positions, net.fans, threads)
    steps = _NetSteps(net, crossings, start, settings, threads)
    state, trace = iterate(steps, settings.max_steps, progress)
    return NetFit(start, state.position, trace)


@dataclass(frozen=True)
class _NetState:
    """Where the vertices are and how far each moved last, (n, 3), and where the squares are drawn to, (q, 3)."""

    position: Floats
    moves: Floats
    pulls: Floats


@dataclass(frozen=True)
class _NetSteps:
    """The steps of a net without masses; each reads one state and writes the next, block by block."""

    net: Net
    crossings: LevelCrossings
    start: Floats
    settings: FitSettings
    threads: int

    def init(self) -> _NetState:
        """Return the net where it starts."""
        return _NetState(self.start, np.zeros_like(self.start), self.crossings.positions)

    def rested(self, motion: Motion, count: int) -> bool:
        """Tell whether all moves, and their changes from step to step, have fallen below the tolerance."""
        return motion.rests(self.settings.tolerance) and not (count < AFTER[-1] and self.crossings.thin.any())

    def step(self, state: _NetState, count: int) -> tuple[_NetState, Motion]:
        """Move every vertex by the forces on it; how far each moved last is changed in place."""
        pulls = self._pulls(state) if count in AFTER else state.pulls
        drawn = self._drawn(state.position, pulls)
        values, stiff, most = self._resisted(state.position)
        share = min(1.0, SAFE * 2 / (1 + most))
        moved, sums = np.empty_like(state.position), np.zeros((-(-len(state.position) // BLOCK), 3))

        def work(start: int, stop: int) -> None:
            move_in_cells(
                state.position, drawn, self.net.fans, values, self.net.links, stiff, share, self.net.low, MARGIN,
                state.moves, moved, sums[start // BLOCK], start, stop,
            )  # fmt: skip

        in_blocks(work, len(moved), block=BLOCK, threads=self.threads)
        speed, change = sums[:, :2].max(axis=0)
        return _NetState(moved, state.moves, pulls), Motion(speed, change, sums[:, 2].sum())

    def _pulls(self, state: _NetState) -> Floats:
        """Draw squares out where the mask is thin."""
        thin, places = self.crossings.thin, self.crossings.positions
        if not thin.any():
            return state.pulls
        middles = means(state.position, self.net.quads, self.threads)
        return given_back(self.net, thin, places, state.pulls, middles, self.threads)

    def _drawn(self, position: Floats, pulls: Floats) -> Floats:
        """Return how far each square is from where it is drawn to, (q, 3)."""
        quads, drawn = self.net.quads, np.empty_like(pulls)

        def work(start: int, stop: int) -> None:
            pull_squares(position, quads, pulls, drawn, start, stop)

        in_blocks(work, len(quads), block=BLOCK, threads=self.threads)
        return drawn

    def _resisted(self, position: Floats) -> tuple[Floats, float, float]:
        """Return what springs resist, see `move_in_cells`: values, how stiff, and the most it is of a vertex' distance.

        They resist being stretched by  s l,  or bends by  b (l - mean l_j).  A vertex is drawn by at most 1 + r times
        its distance from rest, r from the springs, and no step up to twice the inverse overshoots.
        """
        bending = self.crossings.bending * self.settings.stiffness
        if not bending:
            return position, TENSION * self.settings.stiffness, 2 * TENSION * self.settings.stiffness
        leaning = np.empty_like(position)
        in_blocks(
            lambda start, stop: lean(position, self.net.links, leaning, start, stop),
            len(position), block=BLOCK, threads=self.threads,
        )  # fmt: skip
        return leaning, -bending, 4 * bending
