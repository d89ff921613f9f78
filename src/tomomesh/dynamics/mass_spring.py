"""The dynamic mesh: masses on springs, drawn to the points (eq. 5-7).

mu_i x_i'' + gamma_i x_i' + sum_j k (x_i - x_j) + k_d (x_i - x_d) = 0, natural lengths zero, explicit Euler.

With masses mu_i = k_d + sum_j k every vertex has omega_i = 1, critical damping is gamma_i = 2 mu_i, and
a step h <= 1 is stable on every mesh: nobody has to know the unit of a stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..cuberille.neighbors import neighbor_table
from ..kernels.cuberille.cells import nearest_points
from ..kernels.threads import in_blocks
from ..model.trace import Trace
from ..progress import Progress, silent
from .low_pass import adjacency

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.cubes import CubeGrid
    from ..settings import FitSettings

BLOCK = 20_000
"""Vertices matched in one call: far below 100 ms."""


@dataclass(frozen=True)
class Fit:
    """A mesh at rest.

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
    neighbors. Where those hold none it has no k_d and follows its springs.

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
    motion = _Motion(position, targets, edges, cubes.astype(np.int32), grid, settings, threads)
    most = settings.max_steps
    while len(motion.history) < most and not motion.rests():
        motion.advance()
        progress("fit", len(motion.history), most)
    motion.match()
    steps = max(len(motion.history), 1)
    progress("fit", steps, steps)
    trace = motion.trace()
    return Fit(np.asarray(grid.origin + motion.position), motion.nearest, trace)


@dataclass
class _Motion:
    """Positions and velocities of the vertices, relative to the grid's origin, and one step of Euler's."""

    position: NDArray[np.float64]
    points: NDArray[np.float64]
    edges: NDArray[np.int64]
    cube: NDArray[np.int32]
    grid: CubeGrid
    settings: FitSettings
    threads: int

    def __post_init__(self) -> None:
        count, grid = len(self.position), self.grid
        self.velocity = np.zeros_like(self.position)
        self.springs = adjacency(self.edges, count)
        self.degree = np.diff(self.springs.indptr)[:, None]
        self.stiffness = self.settings.stiffness / max(self.degree.mean(), 1.0)
        self.table = neighbor_table(grid.keys)
        self.cube_of_point = np.empty(len(self.points), np.int32)
        self.cube_of_point[grid.order] = np.repeat(np.arange(len(grid.keys)), np.diff(grid.start))
        self.nearest = np.full(count, -1, np.int32)
        self.left = self.nearest
        self.edge = float(grid.cell_mm.min())
        self.history: list[tuple[float, ...]] = []

    def rests(self) -> bool:
        """Tell whether speed and acceleration have fallen below the tolerance."""
        return bool(self.history) and max(self.history[-1][:2]) < self.settings.tolerance

    def trace(self) -> Trace:
        """Return the history as arrays."""
        steps = np.array(self.history).reshape(-1, 7).T
        speed, acceleration, kinetic, potential, distance = steps[:5]
        clamped, unattracted = steps[5:].astype(np.int64)
        return Trace(speed, acceleration, kinetic, potential, distance, clamped, unattracted, self.rests())

    def match(self) -> None:
        """Assign its nearest point to every vertex.

        A vertex does not go back to the point it left last: half way between two points, explicit Euler could
        swing between them for ever.
        """
        found = np.empty_like(self.nearest)

        def work(start: int, stop: int) -> None:
            nearest_points(
                self.position, self.points, self.table, self.grid.order, self.grid.start,
                self.cube, found, start, stop,
            )  # fmt: skip

        in_blocks(work, len(self.position), block=BLOCK, threads=self.threads)
        moves = (found != self.nearest) & (found != self.left)
        self.left = np.where(moves, self.nearest, self.left)
        self.nearest = np.where(moves, found, self.nearest)
        self.cube = np.where(self.nearest >= 0, self.cube_of_point[self.nearest], self.cube)

    def advance(self) -> None:
        """Take one step: x += h x', x' += h x''; no vertex moves more than one cube edge."""
        self.match()
        drawn = (self.nearest >= 0)[:, None]
        pull = np.where(drawn, self.points[self.nearest] - self.position, 0.0)
        tension = self.stiffness * (self.springs @ self.position - self.degree * self.position)
        mass = np.maximum(drawn + self.stiffness * self.degree, 1e-300)
        acceleration = (pull + tension) / mass - 2 * self.settings.damping * self.velocity
        step, clamped = self._limited_step()
        self._record(pull, drawn, mass, acceleration, clamped)
        self.position = self.position + step * self.velocity
        self.velocity = self.velocity + step * acceleration

    def _limited_step(self) -> tuple[float, int]:
        """Return the time step, once vertices that would move too far are slowed or the step is shortened."""
        step = self.settings.step
        reach = step * _length(self.velocity) / self.edge
        far = reach > 1
        if far.any() and self.settings.limit == "shorten":
            return step / float(reach.max()), int(far.sum())
        if far.any():
            self.velocity = self.velocity / np.maximum(reach, 1.0)[:, None]
        return step, int(far.sum())

    def _record(
        self,
        pull: NDArray[np.float64],
        drawn: NDArray[np.bool_],
        mass: NDArray[np.float64],
        acceleration: NDArray[np.float64],
        clamped: int,
    ) -> None:
        stretched = self.position[self.edges[:, 0]] - self.position[self.edges[:, 1]]
        self.history.append((
            float(_length(self.velocity).max()) / self.edge,
            float(_length(acceleration).max()) / self.edge,
            0.5 * float((mass * self.velocity**2).sum()),
            0.5 * float((pull**2).sum() + self.stiffness * (stretched**2).sum()),
            float(_length(pull).sum() / max(int(drawn.sum()), 1)),
            clamped,
            int((~drawn).sum()),
        ))  # fmt: skip


def _length(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.sqrt((vectors**2).sum(axis=1)))
