"""From points to a mesh that rests on them: cubes -> cuberille -> low-pass filter -> dynamic mesh (the paper's way)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..cuberille.leak_test import CLOSINGS, close_leaks
from ..cuberille.partition import is_flat, partition
from ..dynamics.collapse import without_collapse
from ..dynamics.low_pass import OneRing, low_pass
from ..dynamics.mass_spring import fit
from ..dynamics.moving_least_squares import fit_to_surface
from ..dynamics.untangle import untangle
from ..errors import GeometryError
from ..measure.intersections import CrossingFaces
from ..model.boxes import box_of
from ..model.columns import any_of
from ..model.mesh import TriMesh
from ..results import LEAST, Enclosed, Surface
from ..stage import Stage, folded, measured, timed
from .sections import LEAKY_SHELL, count_walls, fit_found, hollow, shell_found, walls_found

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..cuberille.leak_test import LeakTest
    from ..followed import Followed
    from ..model.cubes import CubeGrid
    from ..model.mesh import QuadMesh
    from ..model.points import PointSet
    from ..model.sliced import Sliced
    from ..model.trace import Trace
    from ..pointcloud.samples import Samples
    from ..progress import Progress
    from ..settings import Settings

    Floats = NDArray[np.float64]
    Tracked = tuple[CubeGrid, QuadMesh, NDArray[np.int64]]


@dataclass(frozen=True)
class Shell:
    """Cubes that hold the points, and the faces around them; `taken` tells of each surface whether it is kept."""

    grid: CubeGrid
    leak_test: LeakTest
    taken: NDArray[np.bool_]

    @property
    def volume(self) -> float:
        """Volume inside the surfaces that are kept."""
        return float(self.leak_test.faces.volumes[self.taken].sum() * self.grid.cell_mm.prod())


@dataclass(frozen=True)
class Inside:
    """What is known of the inside of a surface: its rings, its window, and what it follows; nothing of a cloud's."""

    rings_mm3: float = 0.0
    window_mm3: float = 0.0
    mask: Sliced | None = None
    follows: Followed | None = None

    @property
    def may_be_flat(self) -> bool:
        """Whether points may rightly lie in a plane, as those of a flat cloud or of a window of one slice do."""
        return self.mask is None or min(int(side.stop - side.start) for side in box_of(self.mask)) == 1

    def or_more(self, hollow: Enclosed) -> Enclosed:
        """Return the largest that is known; what a shell of cubes is hollow by counts where there are no rings."""
        rings = Enclosed("rings", self.rings_mm3) if self.rings_mm3 else hollow
        return rings.or_more(Enclosed("window", self.window_mm3))


ANYTHING = Inside()
"""Where nothing is known."""


@dataclass(frozen=True)
class Drawn:
    """A mesh that was drawn to something.

    Attributes
    ----------
    mesh : TriMesh
    trace : Trace or None
        None where it was left as it is.
    nearest : (n,) int32 array
        The point that draws each vertex; empty where a surface does.
    filled : (m,) bool array or None
        Faces where there are no samples of that surface.
    """

    mesh: TriMesh
    trace: Trace | None
    nearest: NDArray[np.int32]
    filled: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Rest:
    """A mesh at rest, and its faces that pass through others."""

    drawn: Drawn
    mesh: TriMesh
    crossing: NDArray[np.bool_]


def surface_on_cubes(
    points: PointSet, spacing: float, settings: Settings, progress: Progress, asked: Inside = ANYTHING,
    samples: Samples | None = None,
) -> Stage[Surface]:  # fmt: skip
    """Turn points into a closed surface that rests on them, or on what lies under them.

    Parameters
    ----------
    points : PointSet
    spacing : float
        r, the edge of the cubes where none is asked for.
    settings : Settings
    progress : callable
    asked : Inside
        What is known of the inside.
    samples : Samples, optional
        Of the surface under the points, which draws the mesh in place of the nearest of them.

    Raises
    ------
    GeometryError
        Where the outside leaks in.
    """
    shell = _close(points.positions, spacing, settings, progress)
    tracked = measured("cuberille", _track, shell.value)
    walls = _walls(shell.value, points.positions, settings, asked)
    cubes, cuberille, _ = tracked.value
    smoothed = measured("smooth", _smoothed, cuberille, settings.cubes.low_pass)
    grid, taken = shell.value.grid, shell.value.taken
    encloses = asked.or_more(hollow(shell.value.leak_test, taken, len(grid.keys), grid.cell_mm))
    drawn = tracked.value, smoothed.value, points.positions, samples, settings, progress
    # a study's millimeters fit 32 bits, in which most meshes are kept; a cloud may lie anywhere
    tangled = CrossingFaces(settings.run.threads, single=asked.mask is not None)
    rest = _fit(*drawn, tangled, still=walls.value == 2)
    if settings.cubes.allow_leaks and walls.value == 1 and encloses.share(rest.value.mesh) < LEAST:
        walls = walls_found(2, LEAKY_SHELL)  # found out by the fit alone: it goes back to where it began
        rest = _fit(*drawn, tangled, still=True)
    fitted = rest.value.drawn
    made = Surface(
        points, cuberille, smoothed.value, rest.value.mesh, fitted.nearest, cubes, fitted.trace, fitted.filled,
        cavities=int((shell.value.leak_test.faces.inward & taken).sum()), crossing=rest.value.crossing,
        encloses=encloses if walls.value == 1 else None, follows=asked.follows if walls.value == 1 else None,
    )  # fmt: skip
    return folded(made, shell, tracked, walls, smoothed, rest)


@timed("cubes")
def _close(positions: Floats, spacing: float, settings: Settings, progress: Progress) -> Stage[Shell]:
    asked, threads = settings.cubes, settings.run.threads
    grid = partition(positions, _cell(spacing, settings))
    closings = CLOSINGS if asked.closing is None else (asked.closing,)
    leak_test = close_leaks(
        grid.cells, closings, cavities=asked.surface == "all", tracking=asked.tracking, threads=threads,
        progress=progress,
    )  # fmt: skip
    taken = leak_test.faces.worth_keeping(largest=asked.largest)
    return folded(Shell(grid, leak_test, taken), shell_found(leak_test, taken, grid.cell_mm, len(grid.keys)))


def _cell(spacing: float, settings: Settings) -> Floats:
    """Return the edge of the cubes along each axis: r, or what was asked for, times the dilation factor."""
    asked = settings.cubes.cell_mm or (spacing,)
    return np.broadcast_to(np.array(asked, np.float64) * settings.cubes.cell_factor, 3).copy()


def _track(shell: Shell) -> Tracked:
    return shell.leak_test.faces.only(shell.taken).over(shell.grid)


def _walls(shell: Shell, positions: Floats, settings: Settings, asked: Inside) -> Stage[int]:
    """Count the walls of a shell.

    Raises
    ------
    GeometryError
        Where the outside leaks in.
    """
    cell, rings_mm3 = float(shell.grid.cell_mm.min()), asked.rings_mm3
    tight = shell.volume >= LEAST * rings_mm3 if rings_mm3 else shell.leak_test.tight
    walls = count_walls(settings, tight=tight, flat=not tight and is_flat(positions, cell) and asked.may_be_flat)
    if walls is not None:
        return walls
    raise GeometryError(
        "the outside leaks into the shell of cubes, so its surface would have two walls",
        found=f"cell = {cell:.4g}",
        expected="gaps between the points that are narrower than a hole of the surface",
        hint="a larger --cell-mm or --closing, or --allow-leaks",
    )


def _smoothed(cuberille: QuadMesh, passes: int) -> TriMesh:
    rough = cuberille.triangulated()
    return rough.moved(low_pass(cuberille.vertices, cuberille.edges, passes))


@timed("fit")
def _fit(
    tracked: Tracked, smoothed: TriMesh, positions: Floats, samples: Samples | None, settings: Settings,
    progress: Progress, tangled: CrossingFaces, *, still: bool,
) -> Stage[Rest]:  # fmt: skip
    """Draw the mesh to the points or to the surface under them, unless it is to stay as it is."""
    cuberille = tracked[1]
    ring = OneRing.of_quads(cuberille.quads.astype(np.int32), len(smoothed.vertices), settings.run.threads)
    if samples is None or still:
        drawn = _to_points(tracked, smoothed, positions, settings, progress, still=still)
    else:
        drawn = _to_surface(tracked, smoothed, samples, ring, settings, progress)
    mesh, collapsed = without_collapse(replace(drawn.mesh, vertices=smoothed.vertices), drawn.mesh)
    mesh, taken_back, crossing = untangle(mesh, smoothed.vertices, ring, tangled, cuberille.vertices)
    trace = None if still else drawn.trace
    told = fit_found(
        trace, len(mesh.vertices), collapsed=collapsed, taken_back=taken_back, filled=drawn.filled
    )  # fmt: skip
    return folded(Rest(drawn, mesh, crossing), told)


def _to_points(
    tracked: Tracked, smoothed: TriMesh, positions: Floats, settings: Settings, progress: Progress, *, still: bool
) -> Drawn:
    """Draw each vertex to the point that is nearest to it (the paper's attraction)."""
    cubes, cuberille, origins = tracked
    asked = replace(settings.fit, max_steps=0) if still else settings.fit
    springs = cuberille.edges if settings.fit.springs == "quads" else smoothed.edges
    rest = fit(
        smoothed.vertices, springs, origins, positions, cubes, asked,
        threads=settings.run.threads, progress=progress,
    )  # fmt: skip
    return Drawn(smoothed.moved(rest.vertices), rest.trace, rest.nearest)


def _to_surface(
    tracked: Tracked, smoothed: TriMesh, samples: Samples, ring: OneRing, settings: Settings, progress: Progress
) -> Drawn:
    """Draw each vertex to the surface under the points; positions count from the grid's origin."""
    cubes, origin = tracked[0], tracked[0].origin
    rest = fit_to_surface(
        smoothed.vertices - origin, ring, replace(samples, positions=samples.positions - origin),
        float(cubes.cell_mm.min()), settings.fit, threads=settings.run.threads, progress=progress,
    )  # fmt: skip
    mesh = TriMesh(rest.vertices + origin, rest.faces)
    return Drawn(mesh, rest.trace, np.empty(0, np.int32), any_of(rest.filled[rest.faces]))
