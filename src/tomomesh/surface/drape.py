"""Lay a mesh over the surface that samples describe: the dynamic mesh, drawn to feet instead of points.

The nearest point (the paper's attraction) draws every bit of noise into the surface, and leaves what lies between
two points where it is. A foot is the place straight below a vertex on the smooth surface under the samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.feet import advance, average, find_feet, list_neighbors, nearest_places, quad_normals
from ..kernels.threads import in_blocks
from ..model.trace import Trace
from ..progress import Progress, silent
from .search import Index

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..settings import FitSettings
    from .samples import Samples

    Floats = NDArray[np.float64]

BLOCK = 8_192
"""Vertices worked on in one call: below 100 ms."""
NARROW = 0.68
"""Width of the weights of exact samples, sampling distances."""
SHARE = 1 / 3
"""Width of the weights over the width with which a sample was settled."""
SIGHT = 2.5
"""Standard deviations of the weights that are looked at."""
STALE = 0.15
"""Way, in cube edges, after which a vertex seeks its foot anew."""
SEEKING = (2, 4, 7, 10)
"""Steps before which feet are sought anew, and vertices are held where they then are; later, feet at every tenth."""
HOLD = 0.5
"""Stiffness of the spring that holds a vertex where it was, over that of its other springs."""
RESTLESS = 0.05
"""Share of the vertices that may still move where the mesh counts as at rest."""
SAGITTA = 0.5
"""Share of the height of a square's middle by which its corners rise: a chord lies below the curve, and this much
makes the mean distance of the surface from its samples least."""


@dataclass(frozen=True)
class Draped:
    """A mesh at rest on its samples.

    Attributes
    ----------
    vertices : (n, 3) float array
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


class Ring:
    """The neighbors of each vertex along the sides of squares, and the low-pass filter over them (Fig. 8c)."""

    def __init__(self, quads: NDArray[np.int32], count: int, threads: int = 0) -> None:
        self.quads, self.threads = quads, threads
        self.start = np.concatenate([[0], np.cumsum(np.bincount(quads.ravel(), minlength=count))])
        self.neighbors = np.empty(quads.size, np.int32)
        list_neighbors(quads, self.start, self.neighbors)

    def smoothed(self, vertices: Floats, passes: int, share: float = 0.5) -> Floats:
        """Move each vertex a share of the way to the mean of its neighbors, several times."""
        for _ in range(passes):
            before, vertices = vertices, np.empty_like(vertices)
            self._pass(before, share, vertices)
        return vertices

    def _pass(self, before: Floats, share: float, after: Floats) -> None:
        def work(begin: int, end: int) -> None:
            average(before, self.start, self.neighbors, share, after, begin, end)

        in_blocks(work, len(before), block=BLOCK, threads=self.threads)

    def normals(self, vertices: Floats) -> Floats:
        """Return unit normals at the vertices, (n, 3)."""
        normals = np.empty_like(vertices)
        quad_normals(vertices, self.quads, normals)
        return normals


def drape(
    vertices: Floats,
    ring: Ring,
    samples: Samples,
    edge: float,
    settings: FitSettings,
    *,
    threads: int = 0,
    progress: Progress = silent,
) -> Draped:
    """Let a mesh move until it rests on the surface under its samples.

    Parameters
    ----------
    vertices : (n, 3) float array
        Where it starts, at rest.
    ring : Ring
        Its squares: a closed 2-manifold.
    samples : Samples
    edge : float
        Edge of the cubes: no vertex moves more in a step.
    settings : FitSettings
    threads : int
    progress : callable

    Returns
    -------
    Draped
    """
    ground = _Ground.under(vertices, ring, samples, threads)
    feet = ground.feet(vertices, ring.normals(vertices), ground.first_reach(vertices))
    anchors = vertices
    state = np.stack([vertices, np.zeros_like(vertices), vertices], axis=1)
    history: list[Floats] = []
    while len(history) < settings.max_steps and not _rests(history, len(vertices)):
        if history and (len(history) in SEEKING or len(history) % 10 == 0):
            feet, anchors = ground.renewed(state[:, 0], feet, anchors, STALE * edge)
            if len(history) in SEEKING:
                state[:, 2] = state[:, 0]
        state, sums = _step(state, feet, anchors, ring, edge, settings, threads)
        history.append(sums)
        progress("fit", len(history), settings.max_steps)
    steps = max(len(history), 1)
    progress("fit", steps, steps)
    placed = np.ascontiguousarray(state[:, 0])
    feet = ground.feet(placed, ground.towards(feet, ring.normals(placed)), ground.reach)
    placed = placed - feet[:, :1] * feet[:, 1:]
    filled = (feet[:, 1:] == 0).all(axis=1)
    placed, faces = _split(placed, np.where(filled[:, None], ring.normals(placed), feet[:, 1:]), ring)
    return Draped(placed, faces, filled, _trace(history, edge, len(vertices)))


def _step(
    state: Floats, feet: Floats, anchors: Floats, ring: Ring, edge: float, settings: FitSettings, threads: int
) -> tuple[Floats, Floats]:
    """Take one step of all vertices; return the new state and what `advance` sums up."""
    result = np.empty_like(state)
    rates = np.array([settings.step, settings.damping, edge, HOLD, settings.tolerance * edge])
    sums = np.zeros((-(-len(state) // BLOCK), 8))

    def work(begin: int, end: int) -> None:
        advance(state, feet, anchors, ring.start, ring.neighbors, rates, result, sums[begin // BLOCK], begin, end)

    in_blocks(work, len(state), block=BLOCK, threads=threads)
    return result, np.concatenate([sums[:, :2].max(axis=0), sums[:, 2:].sum(axis=0)])


def _rests(history: list[Floats], count: int) -> bool:
    """Tell whether all but a few vertices are slower than the tolerance, and no longer accelerated."""
    return bool(history) and float(history[-1][7]) <= RESTLESS * count


def _trace(history: list[Floats], edge: float, count: int) -> Trace:
    sums = np.array(history).reshape(-1, 8).T
    clamped, free = sums[5:7].astype(np.int64)
    distance = sums[4] / np.maximum(count - free, 1)
    return Trace(sums[0] / edge, sums[1] / edge, sums[2], sums[3], distance, clamped, free, _rests(history, count))


@dataclass(frozen=True)
class _Ground:
    """Samples that face outward, and how far each vertex looks for them."""

    samples: Floats
    index: Index
    nearest: NDArray[np.int32]
    threads: int

    @classmethod
    def under(cls, vertices: Floats, ring: Ring, samples: Samples, threads: int) -> _Ground:
        width = np.maximum(NARROW * samples.spacing, SHARE * samples.width)
        rows = np.column_stack([samples.positions, samples.normals, width])
        index = Index.of(samples.positions, SIGHT * float(np.median(width)))
        rows = rows[index.order]
        vertex = _nearest(rows, vertices, index.frame[3], threads)
        facing = (ring.normals(vertices)[vertex] * rows[:, 3:6]).sum(axis=1)
        rows[:, 3:6] *= np.where(facing < 0, -1.0, 1.0)[:, None]
        rows = rows[vertex >= 0] if (vertex < 0).any() else rows
        index = Index.of(rows[:, :3], index.frame[3])
        rows = np.ascontiguousarray(rows[index.order])
        near = np.empty(len(vertices), np.int32)
        cells = index.cells
        in_blocks(
            lambda a, b: nearest_places(vertices, rows, *cells, near, a, b), len(vertices), block=BLOCK, threads=threads
        )
        return cls(rows, index, near, threads)

    @property
    def reach(self) -> Floats:
        """How far each vertex looks, (n,); 0 where it has no sample near."""
        return np.where(self.nearest >= 0, SIGHT * self.samples[self.nearest, 6], 0.0)

    def first_reach(self, places: Floats) -> Floats:
        """How far each place looks before the mesh has moved: to the nearest sample and on, (n,)."""
        away = np.sqrt(((self.samples[self.nearest, :3] - places) ** 2).sum(axis=1))
        return np.where(self.nearest >= 0, self.reach + away, 0.0)

    def feet(self, places: Floats, normals: Floats, reach: Floats) -> Floats:
        """Return height and normal of the surface below places, (n, 4)."""
        feet = np.empty((len(places), 4))
        cells = self.index.cells

        def work(begin: int, end: int) -> None:
            find_feet(places, normals, reach, self.samples, *cells, feet, begin, end)

        in_blocks(work, len(places), block=BLOCK, threads=self.threads)
        return feet

    def renewed(self, places: Floats, feet: Floats, anchors: Floats, stale: float) -> tuple[Floats, Floats]:
        """Seek the feet of those vertices anew that have moved some way from where theirs were sought."""
        moved = np.flatnonzero(((places - anchors) ** 2).sum(axis=1) > stale**2)
        moved = moved[(feet[moved, 1:] != 0).any(axis=1)]
        found = self.feet(np.ascontiguousarray(places[moved]), np.ascontiguousarray(feet[moved, 1:]), self.reach[moved])
        feet, anchors = feet.copy(), anchors.copy()
        feet[moved], anchors[moved] = found, places[moved]
        return feet, anchors

    def towards(self, feet: Floats, normals: Floats) -> Floats:
        """Return the normals of the feet, and the mesh's own where there is none."""
        seen = (feet[:, 1:] != 0).any(axis=1, keepdims=True)
        return np.ascontiguousarray(np.where(seen, feet[:, 1:], normals))


def _split(vertices: Floats, normals: Floats, ring: Ring) -> tuple[Floats, NDArray[np.int64]]:
    """Split the squares by the diagonals nearer to the surface, and raise their corners by a part of the sagitta.

    A chord d between places with normals m and n lies (n - m) d / 8 below the middle of the arc.
    """
    first, second = (
        ((normals[two] - normals[one]) * (vertices[two] - vertices[one])).sum(axis=1) / 8
        for one, two in (ring.quads.T[[0, 2]], ring.quads.T[[1, 3]])
    )
    turned = (np.abs(second) < np.abs(first)).astype(np.int64)
    mean = np.bincount(ring.quads.ravel(), np.repeat(0.5 * (first + second), 4), len(vertices))
    rise = SAGITTA * mean / np.diff(ring.start)
    a, b, c, d = (ring.quads[np.arange(len(turned)), (turned + n) % 4] for n in range(4))
    faces = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3).astype(np.int64)
    return vertices + rise[:, None] * normals, faces


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
