"""The dynamic mesh: masses on springs, drawn to the points (eq. 5-7).

mu_i x_i'' + gamma_i x_i' + sum_j k (x_i - x_j) + k_d (x_i - x_d) = 0, natural lengths zero, explicit Euler.

With masses mu_i = k_d + sum_j k every vertex has omega_i = 1, critical damping is gamma_i = 2 mu_i, and
a step h <= 1 is stable on every mesh: nobody has to know the unit of a stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..cuberille.neighbors import neighbor_table
from ..kernels.cuberille.cells import nearest_points
from ..kernels.threads import in_blocks
from ..model.trace import Motion
from ..progress import Progress, silent
from .iterate import iterate
from .low_pass import adjacency

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy import sparse

    from ..model.cubes import CubeGrid
    from ..model.trace import Trace
    from ..settings import FitSettings

BLOCK = 20_000
"""Vertices matched in one call: far below 100 ms."""


@dataclass(frozen=True)
class Fit:
    """A mesh after the fit.

    Attributes
    ----------
    vertices : (n, 3) float array
    nearest : (n,) int32 array
        The point that draws each vertex, -1 where there is none.
    trace : Trace
    """

    vertices: NDArray[np.float64]
    nearest: NDArray[np.int32]
    trace: Trace


def fit(
    vertices: NDArray[np.float64],
    edges: NDArray[np.int64],
    cubes: NDArray[np.int64],
    points: NDArray[np.float64],
    grid: CubeGrid,
    settings: FitSettings,
    *,
    threads: int = 0,
    progress: Progress = silent,
) -> Fit:
    """Let the mesh move until it rests on the points.

    Each vertex is drawn to the point nearest to it: at first among those of the cube it came from and its 26
    neighbors, then at every step among those of the cube that holds the point last assigned and its 26
    neighbors (the paper's dynamic correspondence). Where those hold none it has no k_d and follows its springs.

    Parameters
    ----------
    vertices : (n, 3) float array
        Where the mesh starts, at rest.
    edges : (e, 2) int array
        The springs, each once.
    cubes : (n,) int array
        The cube of `grid` behind each vertex.
    points : (p, 3) float array
    grid : CubeGrid
    settings : FitSettings
    threads : int
    progress : callable

    Returns
    -------
    Fit
    """
    position, targets = (np.ascontiguousarray(places - grid.origin) for places in (vertices, points))
    motion = _NearestSteps(position, targets, edges, cubes.astype(np.int32), grid, settings, threads)
    state, trace = iterate(motion, settings.max_steps, progress)
    state = motion.matched(state)
    return Fit(np.asarray(grid.origin + state.position), state.nearest, trace)


@dataclass(frozen=True)
class _NearestState:
    """Positions and velocities of the vertices, relative to the grid's origin, and their correspondence.

    `nearest` are the points that draw the vertices, `left` those that drew them before, -1 where there are none;
    `cube` are the cubes in and around which the next are sought.
    """

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    nearest: NDArray[np.int32]
    left: NDArray[np.int32]
    cube: NDArray[np.int32]


@dataclass(frozen=True)
class _NearestSteps:
    """Steps of explicit Euler, drawn to the nearest points."""

    start: NDArray[np.float64]
    points: NDArray[np.float64]
    edges: NDArray[np.int64]
    cubes: NDArray[np.int32]
    grid: CubeGrid
    settings: FitSettings
    threads: int

    @cached_property
    def springs(self) -> sparse.csr_array[np.float64]:
        """Which vertices are joined, (n, n)."""
        return adjacency(self.edges, len(self.start))

    @cached_property
    def degree(self) -> NDArray[np.int32]:
        """Springs of each vertex, (n, 1)."""
        return np.diff(self.springs.indptr)[:, None]

    @cached_property
    def stiffness(self) -> float:
        """Stiffness of a spring, so that those of a vertex have that of the settings together, on average."""
        return self.settings.stiffness / max(float(self.degree.mean()), 1.0)

    @cached_property
    def table(self) -> NDArray[np.int32]:
        """The 27 cubes around each cube."""
        return neighbor_table(self.grid.keys)

    @cached_property
    def cube_of_point(self) -> NDArray[np.int32]:
        """The cube of each point, (p,)."""
        cubes = np.empty(len(self.points), np.int32)
        cubes[self.grid.order] = np.repeat(np.arange(len(self.grid.keys)), np.diff(self.grid.start))
        return cubes

    @cached_property
    def edge(self) -> float:
        """The shortest edge of the cubes."""
        return float(self.grid.cell_mm.min())

    def init(self) -> _NearestState:
        """Return the mesh where it starts, drawn by no point yet."""
        none = np.full(len(self.start), -1, np.int32)
        return _NearestState(self.start, np.zeros_like(self.start), none, none, self.cubes)

    def rested(self, motion: Motion, count: int) -> bool:
        """Tell whether speed and acceleration have fallen below the tolerance."""
        return motion.rests(self.settings.tolerance)

    def matched(self, state: _NearestState) -> _NearestState:
        """Assign its nearest point to every vertex.

        Unless that is allowed, a vertex does not go back to the point it left last: half way between two points,
        explicit Euler could swing between them for ever.
        """
        found = np.empty_like(state.nearest)

        def work(start: int, stop: int) -> None:
            nearest_points(
                state.position, self.points, self.table, self.grid.order, self.grid.start,
                state.cube, found, start, stop,
            )  # fmt: skip

        in_blocks(work, len(found), block=BLOCK, threads=self.threads)
        moves = found != state.nearest
        if not self.settings.allow_returns:
            moves &= found != state.left
        nearest = np.where(moves, found, state.nearest)
        cube = np.where(nearest >= 0, self.cube_of_point[nearest], state.cube)
        return replace(state, nearest=nearest, left=np.where(moves, state.nearest, state.left), cube=cube)

    def step(self, state: _NearestState, count: int) -> tuple[_NearestState, Motion]:
        """Take one step: x += h x', x' += h x''; no vertex moves more than one cube edge."""
        state = self.matched(state)
        drawn = (state.nearest >= 0)[:, None]
        pull = np.where(drawn, self.points[state.nearest] - state.position, 0.0)
        tension = self.stiffness * (self.springs @ state.position - self.degree * state.position)
        mass = np.maximum(drawn + self.stiffness * self.degree, 1e-300)
        step, velocity, clamped = self._limited(state.velocity)
        acceleration = (pull + tension) / mass - 2 * self.settings.damping * velocity
        stretched = state.position[self.edges[:, 0]] - state.position[self.edges[:, 1]]
        motion = Motion(
            speed=float(_length(velocity).max()) / self.edge,
            acceleration=float(_length(acceleration).max()) / self.edge,
            kinetic=0.5 * float((mass * velocity**2).sum()),
            potential=0.5 * float((pull**2).sum() + self.stiffness * (stretched**2).sum()),
            distance_mm=float(_length(pull).sum() / max(int(drawn.sum()), 1)),
            clamped=clamped,
            unattracted=int((~drawn).sum()),
        )
        moved = state.position + step * velocity
        return replace(state, position=moved, velocity=velocity + step * acceleration), motion

    def _limited(self, velocity: NDArray[np.float64]) -> tuple[float, NDArray[np.float64], int]:
        """Return the time step and the velocities, once vertices that would move too far are slowed or it is cut."""
        step = self.settings.step
        reach = step * _length(velocity) / self.edge
        far = reach > 1
        if far.any() and self.settings.limit == "shorten":
            return step / float(reach.max()), velocity, int(far.sum())
        if far.any():
            velocity = velocity / np.maximum(reach, 1.0)[:, None]
        return step, velocity, int(far.sum())


def _length(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.sqrt((vectors**2).sum(axis=1)))
