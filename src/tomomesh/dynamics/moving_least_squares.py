"""Fit a mesh to the surface that samples describe: the dynamic mesh, drawn to a moving least-squares surface.

The nearest point (the paper's attraction) draws every bit of noise into the surface, and leaves what lies between
two points where it is. Here each vertex is drawn to its projection: the place straight below it on the smooth surface
under the samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import GeometryError
from ..kernels.dynamics.projections import first_projections, nearest_places, renew_projections
from ..kernels.dynamics.quads import split_quads
from ..kernels.dynamics.springs import advance
from ..kernels.pointcloud.samples import SIGHT
from ..kernels.threads import in_blocks
from ..model.columns import any_of
from ..model.trace import Motion
from ..pointcloud.search import Index
from ..progress import Progress, silent
from .iterate import iterate

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ..model.trace import Trace
    from ..pointcloud.samples import Samples
    from ..settings import FitSettings
    from .low_pass import OneRing

    Floats = NDArray[np.float64]

BLOCK = 4_096
"""Vertices worked on in one call: below 50 ms, and even shares for several threads."""
NARROW = 0.68
"""Width of the weights of exact samples, sampling distances: the best of those measured on clean clouds."""
SHARE = 1 / 3
"""Width of the weights over the width with which a sample was settled: what is settled is smooth already, and a third
only spans the samples (more folds thin parts). Chosen: half of it changes the distance by -0.1 %, twice by -13.7 %."""
SEEKING = (3, 6, 10, 20)
"""Steps before which vertices are projected anew, and from then on drawn back to where they were. After the last
nothing changes but that each moves straight to its projection, so that all come to rest, in 30 steps for clean and
noisy clouds. Without it 0.1 % of the vertices jump from one sheet to another for as long as they are projected anew."""
STALE = 0.15
"""Way, in cube edges, after which a vertex is projected anew: over a curve of radius 4 edges, a plane is then wrong by
0.15^2 / 8 = 0.003."""
EXACT = 0.05
"""The same the last time: wrong by 0.0003, less than the default tolerance."""
RESTORING = 1 / 3
"""Share that the spring which draws a vertex back to where it was has of the stiffness of all its springs. Chosen: half
of it changes the distance by -0.9 %, twice by +2.0 %."""
SAGITTA = 0.5
"""Share of the height of a square's middle by which its corners rise: a chord lies below the curve, and this much makes
the mean distance of the surface from its samples least. Measured, of the vertices alone half of it changes the distance
by -25 %, twice by +50 %."""


@dataclass(frozen=True)
class SurfaceFit:
    """A mesh after the fit to the surface under its samples.

    Attributes
    ----------
    vertices : (n, 3) float array
        Where they came to rest, raised by a part of the sagitta of the squares around each.
    faces : (2q, 3) int64 array
        Each square split by the diagonal that lies nearer to the surface.
    filled : (n,) bool array
        Vertices without samples near: what lies there was filled, not measured.
    trace : Trace
    """

    vertices: Floats
    faces: NDArray[np.int64]
    filled: NDArray[np.bool_]
    trace: Trace


def fit_to_surface(
    vertices: Floats,
    ring: OneRing,
    samples: Samples,
    edge: float,
    settings: FitSettings,
    *,
    threads: int = 0,
    progress: Progress = silent,
) -> SurfaceFit:
    """Let a mesh move until it rests on the surface under its samples.

    Parameters
    ----------
    vertices : (n, 3) float array
        Where it starts, at rest.
    ring : OneRing
        Of its squares: a 2-manifold.
    samples : Samples
    edge : float
        Edge of the cubes: no vertex moves more in a step.
    settings : FitSettings
    threads : int
    progress : callable

    Returns
    -------
    SurfaceFit

    Raises
    ------
    GeometryError
        Where no vertex has samples near: all of the surface would be made up.
    """
    projector = _Projector.under(vertices, ring, samples, threads)
    steps = _ProjectionSteps(vertices, ring, projector, edge, settings, threads)
    state, trace = iterate(steps, settings.max_steps, progress)
    filled, normals, places = _unprojected(state.projections), state.projections[:, 1:].copy(), state.places
    del steps, projector, state  # before faces are made
    _require_any(~filled, samples)
    if filled.any():
        normals[filled] = ring.normals(places)[filled]
    return SurfaceFit(*_split(places, normals, ring), filled, trace)


def _require_any(met: NDArray[np.bool_], samples: Samples) -> None:
    """Refuse a mesh and samples of which none have met."""
    if not met.any():
        raise GeometryError(
            "no vertex of the mesh lies near a sample, so nothing of the surface would be measured",
            found=f"{len(samples.positions)} sample(s), {float(np.median(samples.spacing)):.4g} apart",
            expected="samples all over the surface, and a mesh near them",
            hint="more points, a larger --cell, or of a network in space more --neurons",
        )


def _unprojected(projections: Floats) -> NDArray[np.bool_]:
    """Tell which vertices have no projection."""
    return ~any_of(projections[:, 1:] != 0)


@dataclass(frozen=True)
class _ProjectionState:
    """Positions and velocities of the vertices, (n, 3), and where each is drawn back to, (n, 3).

    `projections` (n, 4) are the height over the surface and its normal, `anchors` (n, 3) where they were measured.
    """

    places: Floats
    velocities: Floats
    origins: Floats
    projections: Floats
    anchors: Floats


@dataclass(frozen=True)
class _ProjectionSteps:
    """Steps of explicit Euler, drawn to projections on the surface under the samples."""

    start: Floats
    ring: OneRing
    projector: _Projector
    edge: float
    settings: FitSettings
    threads: int

    def init(self) -> _ProjectionState:
        """Return the mesh where it starts, above the plane of the sample nearest to each vertex."""
        found = self.projector.first(self.start, self.ring.normals(self.start))
        return _ProjectionState(self.start, np.zeros_like(self.start), self.start, *found)

    def rested(self, motion: Motion, count: int) -> bool:
        """Tell whether speed and acceleration have fallen below the tolerance, once all projections are final."""
        return count > SEEKING[-1] and motion.rests(self.settings.tolerance)

    def step(self, state: _ProjectionState, count: int) -> tuple[_ProjectionState, Motion]:
        """Take a step; the velocities and projections of the state before are changed in place."""
        origins = state.origins
        if count in SEEKING:
            origins = state.places
            self._project(state, last=count == SEEKING[-1])
        restoring = RESTORING if count < SEEKING[-1] else 1.0
        rates = np.array([self.settings.step, self.settings.damping, self.edge, restoring])
        moving = state.places, state.velocities, origins, state.projections, state.anchors
        places = np.empty_like(origins)
        sums = np.zeros((-(-len(places) // BLOCK), 7))

        def work(begin: int, end: int) -> None:
            near = self.ring.start, self.ring.neighbors
            advance(*moving, *near, rates, places, sums[begin // BLOCK], begin, end)

        in_blocks(work, len(places), block=BLOCK, threads=self.threads)
        return _ProjectionState(places, *moving[1:]), self._motion(sums)

    def _project(self, state: _ProjectionState, *, last: bool) -> None:
        """Project the vertices anew that have moved; the last time also those that had no projection."""
        lost = _unprojected(state.projections) & (self.projector.nearest >= 0)
        if last and lost.any():
            state.projections[lost, 1:] = self.ring.normals(state.places)[lost]
            state.anchors[lost] = np.inf
        through = last and self.projector.exact
        stale = 0.0 if through else EXACT if last else STALE
        self.projector.renew(state.places, stale * self.edge, state.projections, state.anchors, through=through)

    def _motion(self, sums: Floats) -> Motion:
        speed, acceleration = sums[:, :2].max(axis=0) / self.edge
        kinetic, potential, height, slowed, free = sums[:, 2:].sum(axis=0)
        distance = height / max(len(self.start) - free, 1)
        return Motion(speed, acceleration, kinetic, potential, distance, int(slowed), int(free))


@dataclass(frozen=True)
class _Projector:
    """Samples that face outward, in their cubes, and how far each vertex looks for them."""

    samples: Floats
    cells: tuple[NDArray[np.int64], NDArray[np.int32], Floats]
    nearest: NDArray[np.int32]
    exact: bool
    threads: int

    @classmethod
    def under(cls, vertices: Floats, ring: OneRing, samples: Samples, threads: int) -> _Projector:
        width = np.maximum(NARROW * samples.spacing, SHARE * samples.width)
        positions = samples.positions if samples.offsets is None else samples.positions + samples.offsets
        index = Index.of(positions, SIGHT * float(np.median(width)))
        rows = np.empty((len(positions), 7))
        for at, columns in ((slice(0, 3), positions), (slice(3, 6), samples.normals), (6, width)):
            rows[:, at] = columns[index.order]
        del positions, width
        vertex = _nearest(rows, vertices, index.frame[3], threads)
        _require_any(vertex >= 0, samples)
        facing = np.einsum("ij,ij->i", ring.normals(vertices)[vertex], rows[:, 3:6])
        rows[:, 3:6] *= np.where(facing < 0, -1.0, 1.0)[:, None]
        if (vertex < 0).any():
            rows = rows[vertex >= 0]
            index = Index.of(rows[:, :3], index.frame[3])
            rows = np.ascontiguousarray(rows[index.order])
        near = np.empty(len(vertices), np.int32)
        projector = cls(rows, index.cells, near, samples.offsets is not None, threads)
        projector.run(lambda a, b: nearest_places(vertices, rows, *projector.cells, near, a, b))
        return projector

    def first(self, places: Floats, normals: Floats) -> tuple[Floats, Floats]:
        """Return height and normal of the surface under each place (n, 4), and where it was measured (n, 3)."""
        found, anchors, seen = np.empty((len(places), 4)), np.empty_like(places), (self.samples, *self.cells)
        self.run(lambda a, b: first_projections(places, normals, self.nearest, *seen, found, anchors, a, b))
        return found, anchors

    def renew(self, places: Floats, stale: float, projections: Floats, anchors: Floats, *, through: bool) -> None:
        """Project those vertices anew that have moved some way from where they last were projected."""
        how = *self.cells, stale, through
        self.run(lambda a, b: renew_projections(places, self.nearest, self.samples, *how, projections, anchors, a, b))

    def run(self, work: Callable[[int, int], None]) -> None:
        """Do something with all vertices, range by range."""
        in_blocks(work, len(self.nearest), block=BLOCK, threads=self.threads)


def _split(vertices: Floats, normals: Floats, ring: OneRing) -> tuple[Floats, NDArray[np.int64]]:
    """Split the squares by the diagonals nearer to the surface, and raise their corners by a part of the sagitta."""
    faces, raised = np.empty((2 * len(ring.quads), 3), np.int32), np.empty_like(vertices)
    split_quads(vertices, normals, ring.quads, SAGITTA, np.zeros((len(vertices), 2)), faces, raised)
    return raised, faces.astype(np.int64)


def _nearest(rows: Floats, vertices: Floats, edge: float, threads: int) -> NDArray[np.int64]:
    """Return the vertex nearest to each sample, (p,); -1 where none is near."""
    index = Index.of(vertices, edge)
    places, cells = vertices[index.order], index.cells
    near = np.empty(len(rows), np.int32)
    positions = np.ascontiguousarray(rows[:, :3])
    in_blocks(
        lambda a, b: nearest_places(positions, places, *cells, near, a, b), len(rows), block=BLOCK, threads=threads
    )
    return np.where(near >= 0, index.order[near], -1)
