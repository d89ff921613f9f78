"""Any points: points -> samples of a surface -> cubes, holes bridged -> mesh drawn to the surface under the samples."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from ..cuberille.leak_test import SURE, close_leaks
from ..cuberille.neighbors import once_each
from ..cuberille.partition import cubes_over, is_flat
from ..dynamics.low_pass import OneRing
from ..dynamics.moving_least_squares import SurfaceFit, fit_to_surface
from ..dynamics.untangle import untangle
from ..errors import GeometryError
from ..measure.intersections import CrossingFaces
from ..model.columns import any_of
from ..model.cubes import cells_of
from ..model.mesh import QuadMesh, TriMesh
from ..opensurface.gaps import gaps
from ..pointcloud.bridges import bridges
from ..pointcloud.forecast import require_room
from ..results import Surface
from ..stage import Stage, folded, measured, timed
from .points import place_found
from .samples import cell_edges, lowest_corner, settle
from .sections import body_of_cubes, count_walls, fit_found, hollow, shell_found
from .way import CUBES, POINTS, Way, on_input, parameters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..cuberille.faces import Faces
    from ..cuberille.leak_test import LeakTest
    from ..pointcloud.bridges import Bridges
    from ..pointcloud.samples import Samples
    from ..progress import Progress
    from ..settings import Settings
    from .points import Points

    Floats = NDArray[np.float64]

SPANS = (5.0, 12.0)
"""Longest bridges that are tried, sampling distances. Chosen: half of them changes the distance by -0.3 %, twice by
-0.2 %."""
WIDEST = 6.0
"""Widest closing that is tried, sampling distances: large cubes are closed by fewer. Chosen: half and twice of it
change no case of benchmarks/constants.py."""
TRIED = ((0, 1, 2), (3, 4, 5, 6, 7, 8))
"""Closings that are tried before and after longer bridges, cubes: all that the leak test tries by itself. Chosen: a
closing of two joins what lies nearer than four cubes, about what the shorter bridges span."""


@dataclass(frozen=True)
class Shell:
    """Cubes of an edge (3,) from a lowest corner, what spans their holes, and how they hold."""

    cell: Floats
    lowest: Floats
    cubes: int
    spanned: Bridges
    leak_test: LeakTest

    def taken(self, settings: Settings) -> NDArray[np.bool_]:
        """Tell of each surface whether it is kept."""
        return self.leak_test.faces.worth_keeping(largest=settings.cubes.largest)


@dataclass(frozen=True)
class Rough:
    """The faces that are kept, their corners (n, 3) on the lattice, and where these lie after the low-pass filter."""

    faces: Faces
    lattice: Floats
    ring: OneRing
    mesh: TriMesh


@dataclass(frozen=True)
class Rest:
    """A mesh, its faces (m,) where there are no samples, and the fit; None where the shell was only smoothed."""

    mesh: TriMesh
    filled: NDArray[np.bool_]
    fitted: SurfaceFit | None


def surface_of_cloud(points: Points, settings: Settings, progress: Progress) -> Stage[Surface]:
    """Turn a cloud into a closed surface."""
    settled = settle(points, settings, progress)
    samples, origin = settled.value, lowest_corner(points)
    shell = _close(points, samples, settings, progress)
    walls = _walls(shell.value, samples, origin, settings)
    rough = measured("smooth", _smoothed, shell.value, settings)
    kept, smoothed, ring = rough.value.faces, rough.value.mesh, rough.value.ring
    rest = measured("fit", _fitted, shell.value, rough.value, samples, settings, progress, still=walls.value == 2)
    apart = measured(
        "untangle", untangle, rest.value.mesh, smoothed.vertices, ring, CrossingFaces(settings.run.threads),
        rough.value.lattice,
    )  # fmt: skip
    mesh, taken_back, crossing = apart.value
    cuberille = QuadMesh(rough.value.lattice + origin, kept.quads.astype(np.int64))
    trace = None if rest.value.fitted is None else rest.value.fitted.trace
    filled = rest.value.filled | _interpolated(mesh.moved(mesh.vertices + origin), points)
    enclosed = hollow(shell.value.leak_test, shell.value.taken(settings), shell.value.cubes, shell.value.cell)
    surface = Surface(
        points.cloud, cuberille, smoothed.moved(smoothed.vertices + origin),
        mesh.moved(mesh.vertices + origin), np.empty(0, np.int32), trace=trace, filled=filled,
        cavities=int(kept.inward.sum()), crossing=crossing,
        encloses=enclosed if walls.value == 1 else None,
    )  # fmt: skip
    fitted = fit_found(trace, len(smoothed.vertices), taken_back=taken_back, filled=filled)
    return folded(surface, settled, shell, walls, rough, rest, apart, fitted, place_found(points))


def _interpolated(mesh: TriMesh, points: Points) -> NDArray[np.bool_]:
    """Tell which faces (m,) are nearer to what was interpolated between the points than to these."""
    if len(points.between) == 0:
        return np.zeros(len(mesh.faces), np.bool_)
    nearest = np.asarray(cKDTree(points.places).query(mesh.corners.mean(axis=1))[1])
    return nearest >= len(points.cloud)


@timed("cubes")
def _close(points: Points, samples: Samples, settings: Settings, progress: Progress) -> Stage[Shell]:
    shell = _tightest(len(points.cloud), samples, settings, progress)
    return folded(
        shell, shell_found(shell.leak_test, shell.taken(settings), shell.cell, shell.cubes, len(shell.spanned.places))
    )  # fmt: skip


def _tightest(count: int, samples: Samples, settings: Settings, progress: Progress) -> Shell:
    """Return the shell that is tight with the least that is made up: short bridges, narrow closings, large cubes."""
    cubes, best = settings.cubes, None
    closings = TRIED if cubes.closing is None else ((cubes.closing,),)
    reach = WIDEST * float(np.median(samples.spacing))
    for tried, span, cell in product(closings, SPANS, cell_edges(samples, settings)):
        require_room(count, samples, cell)
        spanned = bridges(samples, float(cell.min()), span=span, threads=settings.run.threads, progress=progress)
        lowest, keys = cubes_over(np.concatenate([samples.positions, spanned.places]), cell)
        cells = cells_of(once_each(keys))
        steps = [k for k in tried if cubes.closing is not None or k * cell.min() <= reach]
        leak_test = close_leaks(
            cells, steps, cavities=cubes.surface == "all", threads=settings.run.threads, progress=progress
        )  # fmt: skip
        if best is None or leak_test.two_sided >= SURE or leak_test.is_better_than(best.leak_test):
            best = Shell(cell, lowest, len(cells), spanned, leak_test)
        if leak_test.two_sided >= SURE:
            break
    assert best is not None
    return best


def _walls(shell: Shell, samples: Samples, origin: Floats, settings: Settings) -> Stage[int]:
    """Count the walls of a shell.

    Raises
    ------
    GeometryError
        Where the outside leaks in; names the widest gap.
    """
    tight = shell.leak_test.tight
    flat = not tight and is_flat(samples.positions, float(np.median(samples.spacing)))
    walls = count_walls(settings, tight=tight, flat=flat)
    if walls is not None:
        return walls
    cell = float(shell.cell.min())
    found = gaps(samples, cell, threads=settings.run.threads)
    where = [f"a gap of {gap.size:.4g} around {_place(gap.place + origin)}" for gap in found[:1]]
    raise GeometryError(
        ("the points look like an open surface: " if found else "")
        + "the outside leaks into the shell of cubes, so its surface would have two walls",
        found=f"{len(found)} border(s), the widest {where[0]}" if found else f"cell = {cell:.4g}",
        expected="points all around the object, without gaps as wide as its holes",
        hint="--open for a sheet with borders, a larger --closing or --cell, or --allow-leaks",
    )


def _place(place: Floats) -> str:
    return "(" + ", ".join(f"{c:.6g}" for c in place) + ")"


def _smoothed(shell: Shell, settings: Settings) -> Rough:
    faces = shell.leak_test.faces.only(shell.taken(settings))
    ring = OneRing.of_quads(faces.quads, len(faces.corners), settings.run.threads)
    lattice = shell.lowest + faces.corners * shell.cell
    vertices = ring.smoothed(lattice, settings.cubes.low_pass)
    return Rough(faces, lattice, ring, TriMesh(vertices, _halves(faces.quads)))


def _halves(quads: NDArray[np.int32]) -> NDArray[np.int64]:
    """Split each square by its diagonal 0-2 (the paper's systematic triangulation, Fig. 8b)."""
    return quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.int64)


def _fitted(
    shell: Shell, rough: Rough, samples: Samples, settings: Settings, progress: Progress, *, still: bool
) -> Rest:
    """Draw the mesh to the surface under its samples, unless it is to stay as it is."""
    if still:
        return Rest(rough.mesh, np.zeros(len(rough.mesh.faces), np.bool_), None)
    edge, threads = float(shell.cell.min()), settings.run.threads
    start = rough.mesh.vertices
    fitted = fit_to_surface(start, rough.ring, samples, edge, settings.fit, threads=threads, progress=progress)
    return Rest(TriMesh(fitted.vertices, fitted.faces), any_of(fitted.filled[fitted.faces]), fitted)


WAY = Way(
    applies=lambda settings, input: input in POINTS,
    because=on_input,
    reads=CUBES | parameters("stacks", "open", "attraction", "damping", "step"),
    surface=surface_of_cloud,
    of_body=body_of_cubes,
)
