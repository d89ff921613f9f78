"""A net of springs around the voxels of a mask: every vertex moves within a cell of its own (Gibson 1998)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..cuberille.neighbors import DIRECTIONS
from ..dynamics.iterate import iterate
from ..kernels.isosurface.surface_nets import draw_out, move_in_cells
from ..kernels.isosurface.voxels import link_cells, list_faces, list_fans
from ..kernels.threads import in_blocks
from ..model.trace import Motion
from ..progress import Progress, silent
from .means import BLOCK, means
from .rings import SOFTEST, Rings, resistance
from .thin import GIVEN_BACK, given_back
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
    twins : (q, 4) int32 array
        The square beyond the side from each corner to the next, times four, plus the number of its own side there.
    inner : (q, 3) int32 array
        The voxel behind each.
    directions : (q,) uint8 array
        The direction from it to the voxel outside.
    """

    low: NDArray[np.float64]
    links: NDArray[np.int32]
    fans: NDArray[np.int32]
    quads: NDArray[np.int32]
    twins: NDArray[np.int32]
    inner: NDArray[np.int32]
    directions: NDArray[np.uint8]

    @property
    def steps(self) -> NDArray[np.int32]:
        """Steps from the voxels inside to those outside, (q, 3)."""
        return np.take(np.array(DIRECTIONS, np.int32), self.directions, axis=0)

    @property
    def corners(self) -> NDArray[np.int32]:
        """The corners of each square that no other surface goes through, (q, 4): all of them."""
        return self.quads

    def goals(self, places: Floats, threads: int) -> Floats:
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
    table = np.empty((len(cells), 6), np.int32)
    link_cells(cells, cases, LINKED, np.empty((2, *mask.shape[1:]), np.int32), table)
    owned = OWNED[cases]
    first = np.cumsum(owned) - owned
    total = int(owned.sum())
    quads, twins, inner = (np.empty((total, count), np.int32) for count in (4, 4, 3))
    fans, directions = np.empty((len(cells), 6), np.int32), np.empty(total, np.uint8)
    low = cells + lowest

    def work(start: int, stop: int) -> None:
        list_faces(low, cases, table, first, quads, inner, directions, start, stop)
        list_fans(cases, table, first, fans, twins, start, stop)

    in_blocks(work, len(cells), block=BLOCK, threads=threads)
    return Net(low.astype(np.float64), table, fans, quads, twins, inner, directions)


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
    start = net.goals(crossings.positions, threads)
    steps = _NetSteps(net, Rings.of(net, threads), crossings, start, settings, threads)
    state, trace = iterate(steps, settings.max_steps, progress)
    return NetFit(start, state.position, trace)


@dataclass(frozen=True)
class _NetState:
    """Where the vertices are and were before, and the means of where their squares are drawn to, (n, 3)."""

    position: Floats
    before: Floats
    goals: Floats


@dataclass(frozen=True)
class _NetSteps:
    """The steps of a net without masses; each reads one state and writes the next, block by block."""

    net: Net
    rings: Rings
    crossings: LevelCrossings
    start: Floats
    settings: FitSettings
    threads: int

    @property
    def bending(self) -> float:
        """How stiff the springs are against bends; 0 where they resist being stretched."""
        return self.crossings.bending * self.settings.stiffness

    @property
    def of_mask(self) -> bool:
        """Whether the net resists bends as one around a mask does, and rests far from where it starts.

        Around parts of thick voxels that hold levels a net rests after few steps, and 1 % nearer to a CT's levels.
        """
        return self.crossings.stepped and self.bending > 0

    def init(self) -> _NetState:
        """Return the net where it starts."""
        return _NetState(self.start.copy(), self.start.copy(), self.start)

    def rested(self, motion: Motion, count: int) -> bool:
        """Tell whether all moves, and their changes from step to step, have fallen below the tolerance."""
        return motion.rests(self.settings.tolerance)

    def step(self, state: _NetState, count: int) -> tuple[_NetState, Motion]:
        """Move every vertex by the forces on it; where they were is overwritten."""
        bends = self.bending > 0
        state = self._evened(state) if self.of_mask and count == 0 else state
        values = self.rings.lean(state.position) if bends else state.position
        moved, sums = state.before, np.zeros((-(-len(state.position) // BLOCK), 3))
        stiff = -self.bending if bends else TENSION * self.settings.stiffness
        share, momentum = self._pace()

        def work(start: int, stop: int) -> None:
            move_in_cells(
                state.position, state.goals, self.rings.beside, self.rings.aslant, self.rings.shares, values, bends,
                stiff, share, momentum, MARGIN, moved, sums[start // BLOCK], start, stop,
            )  # fmt: skip

        in_blocks(work, len(moved), block=BLOCK, threads=self.threads)
        speed, change = sums[:, :2].max(axis=0)
        return _NetState(moved, state.position, state.goals), Motion(speed, change, sums[:, 2].sum())

    def _pace(self) -> tuple[float, float]:
        """Return what part of the forces a vertex goes at each step, and of its last move.

        A vertex is drawn by at most 1 + r times its distance from rest, r from the springs, and no step up to twice
        the inverse overshoots. Around a mask r is large, and the net goes on by momentum (Golub & Varga 1961).
        """
        springs = 4 * self.bending if self.bending else 2 * TENSION * self.settings.stiffness
        if not self.of_mask:
            return min(1.0, SAFE * 2 / (1 + springs)), 0.0
        most, least = 1 + springs, float(resistance(np.linspace(0, 2, 201), max(self.bending, SOFTEST)).min())
        over = 2 / (1 + np.sqrt(1 - ((most - least) / (most + least)) ** 2))
        return over * 2 / (most + least), over - 1

    def _evened(self, state: _NetState) -> _NetState:
        """Let the net begin where it would rest but for its cells, drawn out where the mask is thin."""
        place, goals, weak = self._within(state.goals), state.goals.copy(), min(self.bending / SOFTEST, 1.0)
        for _ in range(GIVEN_BACK if self.crossings.thin.any() else 0):
            self._draw_out(goals, weak * given_back(self.net, self.crossings, place, self.threads))
            place = self._within(goals)
        return _NetState(place, place.copy(), goals)

    def _draw_out(self, goals: Floats, lengths: Floats) -> None:
        net, shares = self.net, self.rings.shares
        in_blocks(
            lambda start, stop: draw_out(lengths, net.directions, net.fans, shares, goals, start, stop),
            len(goals), block=BLOCK, threads=self.threads,
        )  # fmt: skip

    def _within(self, goals: Floats) -> Floats:
        """Return where the net would rest that is drawn to goals (n, 3), in its cells."""
        place = self.rings.evened(goals, max(self.bending, SOFTEST))
        return np.clip(place, self.net.low + MARGIN, self.net.low + (1 - MARGIN), out=place)
