"""How thick the walls of a solid are, and how wide the gaps between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.measure.balls import enclose_slabs, grow_balls
from ..kernels.threads import in_blocks
from ..progress import Progress, silent
from .tree import Tree

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

    Floats = NDArray[np.float64]

SAMPLES = 20_000
"""Samples that a surface has at least; a face has one in its middle, and a large one more. The thinnest 1 % is then
told by 200 of them."""
STEP = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps of an even sequence in the square, the inverse of the plastic number and its square (Roberts 2018)."""
SHARE = 1.0
"""Percent of a surface that tells what is common on it."""
SPOT = 4.0
"""Edge of a cube over a width within which narrow places count together: room for a spot of one width and its rim."""
BLOCK = 1_000
"""Samples handled at once: some milliseconds. No result depends on it."""


@dataclass(frozen=True)
class Thickness:
    """How far it is to the opposite side, all over a surface.

    Attributes
    ----------
    places : (s, 3) float array
    areas : (s,) float array
        Area that each stands for; they add up to that of the surface.
    widths : (s,) float array
        Diameter of the ball between each and what faces it; infinite where nothing does.
    """

    places: Floats
    areas: Floats
    widths: Floats

    @property
    def least(self) -> tuple[float, Floats]:
        """The smallest width, infinite where there is none, and where."""
        at = int(np.argmin(self.widths))
        return float(self.widths[at]), self.places[at]

    def area_below(self, width: float) -> float:
        """Return the area of the surface where it is narrower."""
        return float(self.areas[self.widths < width].sum())

    def widest_spot(self, width: float) -> float:
        """Return the most area that is narrower within a cube of `SPOT` times the width."""
        thin = self.widths < width
        if not thin.any():
            return 0.0
        cube = np.floor((self.places[thin] - self.places.min(axis=0)) / (SPOT * width)).astype(np.int64)
        _, owner = np.unique(cube, axis=0, return_inverse=True)
        return float(np.bincount(owner.reshape(-1), self.areas[thin]).max())

    def percentile(self, percent: float) -> float:
        """Return the width that so much of the surface stays below; infinite where less of it has any."""
        order = np.argsort(self.widths, kind="stable")
        reached = np.cumsum(self.areas[order])
        return float(self.widths[order[np.searchsorted(reached, percent / 100 * reached[-1])]])


def walls_of(mesh: TriMesh, *, near: float = np.inf, threads: int = 0, progress: Progress = silent) -> Thickness:
    """Measure the thickness of a solid all over its surface: the walls of `walls_and_gaps`, alone.

    Returns
    -------
    Thickness
    """
    return _walls(_Sampled.of(mesh, threads, progress), near)


def walls_and_gaps(
    mesh: TriMesh, *, near: float = np.inf, threads: int = 0, progress: Progress = silent
) -> tuple[Thickness, Thickness]:
    """Measure the thickness of a solid all over its surface, and the width of what is between its walls.

    The width at a place is the diameter of the ball that touches the surface there, on its inner or its outer side,
    and is stopped by a face whose normal is opposite to the place's within 60 degrees. So the width between two
    parallel planes is their distance, that of a ball or a tube its diameter; it falls to 0 towards edges sharper
    than 60 degrees, and is not disturbed by blunter ones, nor by roughness. A ball that has another face half a
    radius from its center looks past an edge, and does not count.

    Parameters
    ----------
    mesh : TriMesh
        Closed and outward, but for the linings of cavities.
    near : float
        Gaps wider than this are not looked for, nor are walls, unless fewer than `SHARE` of the surface have one.
    threads : int
        0 is one a core. The result does not depend on it.
    progress : callable
        Told how far the stage ``walls`` is; what it raises ends the work.

    Returns
    -------
    walls, gaps : Thickness
        Too wide by half a percent at most, besides what the samples miss.

    Notes
    -----
    The medial ball at a place is found as by Ma, Bae & Choi (2012), on faces in place of points.
    """
    surface = _Sampled.of(mesh, threads, progress)
    return _walls(surface, near), surface.widths(1, min(near, surface.widest))


def _walls(surface: _Sampled, near: float) -> Thickness:
    """Return the walls that are no wider than asked for; all, where next to nothing is."""
    found = surface.widths(-1, min(near, surface.widest))
    if near < surface.widest and found.percentile(SHARE) == np.inf:
        return surface.widths(-1, surface.widest)
    return found


@dataclass(frozen=True)
class _Sampled:
    """A surface with the places (s, 3) where it is measured, their normals (s, 3) and their areas (s,)."""

    tree: Tree
    widest: float
    places: Floats
    normals: Floats
    areas: Floats
    threads: int
    progress: Progress

    @classmethod
    def of(cls, mesh: TriMesh, threads: int, progress: Progress) -> _Sampled:
        tree = Tree.of_faces(mesh, threads=threads)
        normals, areas = _normals(tree)
        widest = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
        places, of, share = _samples(tree, areas)
        return cls(tree, widest, places, normals[of], share, threads, progress)

    def widths(self, side: int, most: float) -> Thickness:
        """Return the widths on the inner side, -1, or the outer, 1: those up to the most that is looked for."""
        found = _widths(self.tree, side, self.normals, self.places, most, self.threads, self.progress)
        return Thickness(self.places, self.areas, found)


def _normals(tree: Tree) -> tuple[Floats, Floats]:
    """Return the unit normals (m, 3) and the areas (m,) of the faces of a tree."""
    a, b, c = (tree.vertices[tree.simplices[:, n]] for n in range(3))
    vectors = np.cross(b - a, c - a)
    twice = np.sqrt((vectors**2).sum(axis=1))
    return vectors / np.where(twice > 0, twice, 1.0)[:, None], 0.5 * twice


def _samples(tree: Tree, areas: Floats) -> tuple[Floats, NDArray[np.int64], Floats]:
    """Spread samples over the faces of a tree: places (s, 3), the face of each, and its share of the area."""
    count = np.maximum(np.ceil(areas / max(areas.sum(), 1e-300) * SAMPLES), 1).astype(np.int64)
    of = np.repeat(np.arange(len(areas)), count)
    number = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
    u, v = ((0.5 + number[:, None] * STEP) % 1).T
    over = u + v > 1
    u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
    alone = count[of] == 1
    u, v = np.where(alone, 1 / 3, u)[:, None], np.where(alone, 1 / 3, v)[:, None]
    a, b, c = (tree.vertices[tree.simplices[of, n]] for n in range(3))
    return np.ascontiguousarray((1 - u - v) * a + u * b + v * c), of, areas[of] / count[of]


def _widths(
    tree: Tree,
    side: int,
    normals: Floats,
    places: Floats,
    widest: float,
    threads: int,
    progress: Progress,
) -> Floats:
    """Return the width at each sample (s,), infinite where there is none, given the normals there (s, 3)."""
    widths = np.full(len(places), widest)
    into = side * normals
    faces = tree.simplices if side < 0 else np.ascontiguousarray(tree.simplices[:, ::-1])
    slabs = _slabs(tree, faces, threads)
    in_blocks(
        lambda start, stop: grow_balls(places, into, tree.vertices, faces, tree.boxes, slabs, widths, start, stop),
        len(places),
        block=BLOCK,
        threads=threads,
        done=lambda count: progress("walls", count, len(places)),
    )
    return widths


def _slabs(tree: Tree, faces: NDArray[np.int32], threads: int) -> Floats:
    """Return the slabs and cones (2 P, 6) of the nodes of a tree, its faces turned as given."""
    slabs = np.zeros((2 * tree.leaves, 6))
    in_blocks(
        lambda start, stop: enclose_slabs(tree.vertices, faces, slabs, max(start, 1), stop),
        len(slabs),
        block=BLOCK,
        threads=threads,
    )
    return slabs
