"""A net comes to rest on the crossings of a boundary, while springs even it out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..dynamics.iterate import iterate
from ..kernels.isosurface.surface_nets import draw_out, move_in_cells
from ..model.trace import Motion
from ..progress import Progress, silent
from .means import BLOCK, over, whole
from .rings import SOFTEST, Rings, resistance
from .thin import GIVEN_BACK, given_back

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.trace import Trace
    from ..settings import FitSettings
    from .crossings import LevelCrossings
    from .means import Rows, Span
    from .surface_nets import Net

    Floats = NDArray[np.float64]

MARGIN = 1e-3
"""Share of a cell that a vertex keeps from its faces, so that two vertices, each in a cell of its own, never meet.
Chosen: half and twice of it change the distance by 0.0 %."""
TENSION = 2.4
"""Stiffness of the springs at a setting of 1. Measured on a CT and an MR at the default setting: more would turn less
than marching cubes by more than a tenth, and lie farther from them than 0.06 and 0.09 voxel."""
SAFE = 0.95
"""Share of the longest step that never overshoots. Derived: at 1 a net that goes up and down would do so for ever."""


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
class Springs:
    """What draws the vertices of a net, and how fast they follow.

    Attributes
    ----------
    bending : float
        How stiff the springs are against bends; 0 where they resist being stretched.
    stiff : float
        How many times the sum of what they resist is added to the pull of the squares.
    evens : bool
        Whether the net begins where it would rest but for its cells: around a mask, where it rests far from its start.
        Around parts of thick voxels that hold levels a net rests after few steps, and 1 % nearer to a CT's levels.
    share, momentum : float
        What part of the forces a vertex goes at each step, and of its last move.
    """

    bending: float
    stiff: float
    evens: bool
    share: float
    momentum: float

    @classmethod
    def of(cls, bending: float, of_mask: bool, stiffness: float) -> Springs:
        """Choose them by how a net is to bend (`LevelCrossings.bending`) and whether it is one around a mask.

        A vertex is drawn by at most 1 + r times its distance from rest, r from the springs, and no step up to twice
        the inverse overshoots. Around a mask r is large, and the net goes on by momentum (Golub & Varga 1961).
        """
        bending *= stiffness
        stiff, evens = -bending if bending else TENSION * stiffness, of_mask and bending > 0
        springs = 4 * bending if bending else 2 * TENSION * stiffness
        if not evens:
            return cls(bending, stiff, evens, min(1.0, SAFE * 2 / (1 + springs)), 0.0)
        most, least = 1 + springs, float(resistance(np.linspace(0, 2, 201), max(bending, SOFTEST)).min())
        faster = 2 / (1 + np.sqrt(1 - ((most - least) / (most + least)) ** 2))
        return cls(bending, stiff, evens, faster * 2 / (most + least), faster - 1)

    @property
    def reach(self) -> int:
        """How many layers of vertices away a step looks."""
        return 2 if self.bending > 0 else 1


@dataclass(frozen=True)
class NetState:
    """Where the vertices are and were before, and the means of where their squares are drawn to, (n, 3)."""

    position: Floats
    before: Floats
    goals: Floats


def moved(state: NetState, rings: Rings, springs: Springs, rows: Rows) -> tuple[NetState, Motion]:
    """Move vertices by the forces on them; where they were is overwritten.

    Parameters
    ----------
    state : NetState
    rings : Rings
    springs : Springs
    rows : callable
        The vertices to move.

    Returns
    -------
    state : NetState
    motion : Motion
        Of those that were moved.
    """
    span, bends = rows(0), springs.bending > 0
    values = rings.lean(state.position, rows(1)) if bends else state.position
    after, sums = state.before, np.zeros((-(-(span[1] - span[0]) // BLOCK), 3))

    def work(start: int, stop: int) -> None:
        move_in_cells(
            state.position, state.goals, rings.beside, rings.aslant, rings.shares, values, bends, springs.stiff,
            springs.share, springs.momentum, MARGIN, after, sums[(start - span[0]) // BLOCK], start, stop,
        )  # fmt: skip

    over(work, span, rings.threads)
    speed, change = sums[:, :2].max(axis=0, initial=0.0)
    return NetState(after, state.position, state.goals), Motion(speed, change, sums[:, 2].sum())


def evened(goals: Floats, low: NDArray[np.int32], rings: Rings, springs: Springs, rows: Rows) -> Floats:
    """Return where a net would rest that is drawn to goals (n, 3), within its cells (n, 3)."""
    place = rings.evened(goals, max(springs.bending, SOFTEST), rows)
    return np.clip(place, low + MARGIN, low + (1 - MARGIN), out=place)


def drawn_out(goals: Floats, lengths: Floats, net: Net, rings: Rings, springs: Springs, span: Span) -> Floats:
    """Return goals (n, 3) that are drawn out with the squares around them, which have gone so far (q,)."""
    weak = min(springs.bending / SOFTEST, 1.0)
    goals, lengths = goals.copy(), weak * lengths
    over(
        lambda start, stop: draw_out(lengths, net.directions, net.fans, rings.shares, goals, start, stop),
        span, rings.threads,
    )  # fmt: skip
    return goals


@dataclass(frozen=True)
class _NetSteps:
    """The steps of a net without masses; each reads one state and writes the next, block by block."""

    net: Net
    rings: Rings
    crossings: LevelCrossings
    start: Floats
    settings: FitSettings
    threads: int

    @cached_property
    def springs(self) -> Springs:
        """What draws it."""
        return Springs.of(self.crossings.bending, self.crossings.stepped, self.settings.stiffness)

    def init(self) -> NetState:
        """Return the net where it starts."""
        return NetState(self.start.copy(), self.start.copy(), self.start)

    def rested(self, motion: Motion, count: int) -> bool:
        """Tell whether all moves, and their changes from step to step, have fallen below the tolerance."""
        return motion.rests(self.settings.tolerance)

    def step(self, state: NetState, count: int) -> tuple[NetState, Motion]:
        """Move every vertex by the forces on it; where they were is overwritten."""
        state = self._evened(state) if self.springs.evens and count == 0 else state
        return moved(state, self.rings, self.springs, whole(len(self.start)))

    def _evened(self, state: NetState) -> NetState:
        """Let the net begin where it would rest but for its cells, drawn out where the mask is thin."""
        net, rings, springs, found = self.net, self.rings, self.springs, self.crossings
        vertices, squares = whole(len(net.low)), whole(len(net.quads))
        goals, place = state.goals, evened(state.goals, net.low, rings, springs, vertices)
        for _ in range(GIVEN_BACK if found.thin.any() else 0):
            lengths = given_back(net, found.positions, found.thin, place, vertices, squares, self.threads)
            goals = drawn_out(goals, lengths, net, rings, springs, vertices(0))
            place = evened(goals, net.low, rings, springs, vertices)
        return NetState(place, place.copy(), goals)
