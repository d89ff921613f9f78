"""Lay a mesh over the surface that samples describe: the dynamic mesh, drawn to feet instead of points.

The nearest point (the paper's attraction) draws every bit of noise into the surface, and leaves what lies between
two points where it is. A foot is the place straight below a vertex on the smooth surface under the samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.dynamics.projections import first_feet, nearest_places, renew_feet
from ..kernels.dynamics.quads import quad_normals, split_quads
from ..kernels.dynamics.springs import advance, average, list_neighbors
from ..kernels.pointcloud.samples import SIGHT
from ..kernels.threads import in_blocks
from ..model.columns import any_of
from ..model.trace import Trace
from ..pointcloud.search import Index
from ..progress import Progress, silent

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ..pointcloud.samples import Samples
    from ..settings import FitSettings

    Floats = NDArray[np.float64]

BLOCK = 4_096
"""Vertices worked on in one call: below 50 ms, and even shares for several threads."""
NARROW = 0.68
"""Width of the weights of exact samples, sampling distances."""
SHARE = 1 / 3
"""Width of the weights over the width with which a sample was settled."""
STALE = 0.15
"""Way, in cube edges, after which a vertex seeks its foot anew."""
EXACT = 0.05
"""The same in the end: a plane tells the height of a surface a way w off within w^2 / 2 over its radius."""
SEEKING = (3, 6, 10)
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
    feet, anchors = ground.first_feet(vertices, ring.normals(vertices))
    places, velocities, origins = vertices, np.zeros_like(vertices), vertices
    history: list[Floats] = []
    while len(history) < settings.max_steps and not _rests(history, len(vertices)):
        if history and (len(history) in SEEKING or len(history) % 10 == 0):
            ground.renew(places, STALE * edge, feet, anchors)
            if len(history) in SEEKING:
                origins = places
        places, sums = _step((places, velocities, origins), feet, anchors, ring, edge, settings, threads)
        history.append(sums)
        progress("fit", len(history), settings.max_steps)
    steps = max(len(history), 1)
    progress("fit", steps, steps)
    normals = ring.normals(places)
    lost = _footless(feet) & (ground.nearest >= 0)
    feet[lost, 1:], anchors[lost] = normals[lost], np.inf
    ground.renew(places, EXACT * edge, feet, anchors)
    height = feet[:, 0] + np.einsum("ij,ij->i", feet[:, 1:], places - anchors)
    places = places - height[:, None] * feet[:, 1:]
    filled = _footless(feet)
    normals = np.where(filled[:, None], normals, feet[:, 1:])
    places, faces = _split(places, normals, ring)
    return Draped(places, faces, filled, _trace(history, edge, len(vertices)))


def _footless(feet: Floats) -> NDArray[np.bool_]:
    """Tell which vertices have no foot."""
    return ~any_of(feet[:, 1:] != 0)


def _step(
    state: tuple[Floats, Floats, Floats],
    feet: Floats,
    anchors: Floats,
    ring: Ring,
    edge: float,
    settings: FitSettings,
    threads: int,
) -> tuple[Floats, Floats]:
    """Take one step of all vertices; return where they then are and what `advance` sums up."""
    result = np.empty_like(state[0])
    rates = np.array([settings.step, settings.damping, edge, HOLD, settings.tolerance * edge])
    sums = np.zeros((-(-len(result) // BLOCK), 8))

    def work(begin: int, end: int) -> None:
        advance(*state, feet, anchors, ring.start, ring.neighbors, rates, result, sums[begin // BLOCK], begin, end)

    in_blocks(work, len(result), block=BLOCK, threads=threads)
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
        facing = np.einsum("ij,ij->i", ring.normals(vertices)[vertex], rows[:, 3:6])
        rows[:, 3:6] *= np.where(facing < 0, -1.0, 1.0)[:, None]
        if (vertex < 0).any():
            rows = rows[vertex >= 0]
            index = Index.of(rows[:, :3], index.frame[3])
            rows = np.ascontiguousarray(rows[index.order])
        near = np.empty(len(vertices), np.int32)
        ground = cls(rows, index, near, threads)
        ground.run(lambda a, b: nearest_places(vertices, rows, *index.cells, near, a, b))
        return ground

    def first_feet(self, places: Floats, normals: Floats) -> tuple[Floats, Floats]:
        """Return height and normal of the surface under each place (n, 4), and where it was measured (n, 3)."""
        feet, anchors, cells = np.empty((len(places), 4)), np.empty_like(places), self.index.cells
        self.run(lambda a, b: first_feet(places, normals, self.nearest, self.samples, *cells, feet, anchors, a, b))
        return feet, anchors

    def renew(self, places: Floats, stale: float, feet: Floats, anchors: Floats) -> None:
        """Seek the feet of those vertices anew that have moved some way from where theirs were sought."""
        cells = self.index.cells
        self.run(lambda a, b: renew_feet(places, self.nearest, self.samples, *cells, stale, feet, anchors, a, b))

    def run(self, work: Callable[[int, int], None]) -> None:
        """Do something with all vertices, range by range."""
        in_blocks(work, len(self.nearest), block=BLOCK, threads=self.threads)


def _split(vertices: Floats, normals: Floats, ring: Ring) -> tuple[Floats, NDArray[np.int64]]:
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
