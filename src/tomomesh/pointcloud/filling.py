"""A closed shell where no closing makes one: around what the indicator of the samples says is inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..cuberille.closing import shell_around
from ..cuberille.faces import exposed_faces
from ..cuberille.leak_test import LeakTest
from ..model.columns import cells_at
from .indicator import facing, find_inside

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh
    from ..progress import Progress
    from .samples import Samples

    Floats = NDArray[np.float64]

FINE = 0.5
"""Edge of the cubes, sampling distances: a sphere of 60 points is 6 % too large, and with 1.4 times of it 7 %."""
ROOM = 600_000
"""Cubes that the box around the samples is divided into at most: some seconds of work. Chosen: half of it
changes the volume of a bowl by .04 %, twice nothing."""
EACH = 8
"""The same for each sample, in a large cloud."""
NEIGHBORS = 5
"""Faces of the leaky shell around a sample that tell which way it faces, and samples that tell what is measured."""
REACH = 2.5
"""Distance from all samples over which a face is made up, sampling distances: points thrown at random leave holes as
wide, once in 10 million."""
BORDER = 1.0
"""The same from which a vertex belongs to such a hole; a cap stands above its border by as much. Chosen: half
of it changes the volume of a bowl by -3.6 %, twice by +6.1 %."""


@dataclass(frozen=True)
class Filling:
    """Cubes of an edge from a lowest corner (3,), the shell around what is inside, and how it fits the samples.

    Attributes
    ----------
    cell : float
    lowest : (3,) float array
    leak_test : LeakTest
    cubes : int
        Cubes that hold samples.
    met : float
        Share of the samples that lie at the surface.
    doubtful : (3,) float array
        The sample at which inside and outside differ least.
    """

    cell: float
    lowest: Floats
    leak_test: LeakTest
    cubes: int
    met: float
    doubtful: Floats


def fill_inside(
    samples: Samples, leaky: LeakTest, lowest: Floats, edges: Floats, *, cell: float | None = None, threads: int = 0,
    progress: Progress,
) -> Filling:  # fmt: skip
    """Make a closed shell around what lies inside of a sampled surface, by the normals of the samples.

    Parameters
    ----------
    samples : Samples
    leaky : LeakTest
        A shell of cubes that does not hold: it tells most of the normals.
    lowest, edges : (3,) float arrays
        Where its cubes begin, and how wide they are.
    cell : float, optional
        Edge of the cubes, where it is asked for.
    threads : int
    progress : callable

    Returns
    -------
    Filling
    """
    spacing, box = float(np.median(samples.spacing)), np.maximum(np.ptp(samples.positions, axis=0), 1e-300)
    room = max(ROOM, EACH * len(samples.positions))
    own = max(FINE * spacing, float(np.prod(np.maximum(box, spacing)) / room) ** (1 / 3))
    edge = own if cell is None else max(cell, own)
    outward = samples.positions - samples.positions.mean(axis=0)
    starts = [facing(samples.normals, way) for way in (_of_shell(samples, leaky, lowest, edges), outward)]
    found = find_inside(samples, starts, edge, threads=threads, progress=progress)
    cells = np.unique(cells_at(samples.positions, found.lowest, np.full(3, edge)), axis=0)
    shell = shell_around(found.inside, cells, threads=threads)
    faces = exposed_faces(shell)
    test = LeakTest(shell, faces, faces.least_two_sided)
    away = scipy.spatial.cKDTree(found.lowest + edge * (faces.cells + 0.5)).query(samples.positions)[0]
    met = float((away <= 2 * edge + samples.spacing).mean())
    return Filling(edge, found.lowest, test, len(cells), met, samples.positions[found.doubtful])


def made_up(places: Floats, samples: Samples, edge: float, reach: float = REACH) -> NDArray[np.bool_]:
    """Tell which places (n, 3) of a surface lie where there are no samples, for cubes of an edge."""
    away, near = scipy.spatial.cKDTree(samples.positions).query(places)
    return np.asarray(away > reach * np.maximum(samples.spacing[near], edge))


def holes(mesh: TriMesh, samples: Samples, edge: float) -> NDArray[np.bool_]:
    """Tell which vertices (n,) lie in a hole that is made up, out to its border."""
    beside = made_up(mesh.vertices, samples, edge, BORDER)
    a, b = mesh.edges[beside[mesh.edges].all(axis=1)].T
    links = scipy.sparse.coo_array((np.ones(len(a), bool), (a, b)), shape=(len(beside), len(beside)))
    count, piece = scipy.sparse.csgraph.connected_components(links, directed=False)
    wide = np.bincount(piece, made_up(mesh.vertices, samples, edge), count) > 0
    return np.asarray(beside & wide[piece])


def _of_shell(samples: Samples, leaky: LeakTest, lowest: Floats, edges: Floats) -> Floats:
    """Return the way that the shell faces around each sample, (p, 3)."""
    faces = leaky.faces
    corners = (lowest + faces.corners * edges)[faces.quads]
    ways = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    near = scipy.spatial.cKDTree(corners.mean(axis=1)).query(samples.positions, k=list(range(1, NEIGHBORS + 1)))[1]
    return np.asarray(ways[near].sum(axis=1))
