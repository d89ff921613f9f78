"""Any points: points -> samples of a surface -> cubes, holes bridged -> mesh drawn to the surface under the samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..dynamics.low_pass import OneRing
from ..dynamics.membrane import capped, carried_on
from ..dynamics.moving_least_squares import SurfaceFit, fit_to_surface
from ..dynamics.untangle import untangle
from ..measure.intersections import CrossingFaces
from ..model.columns import any_of
from ..model.mesh import QuadMesh, TriMesh
from ..pointcloud.filling import holes
from ..results import Surface
from ..stage import Stage, folded, measured
from .clouds.joints import follows
from .clouds.points import interpolated, place_found
from .clouds.samples import lowest_corner, settle
from .clouds.shell import Shell, shell_around, walls_of
from .sections import body_of_cubes, fit_found, hollow
from .way import CUBES, POINTS, Way, on_input, parameters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..cuberille.faces import Faces
    from ..pointcloud.samples import Samples
    from ..progress import Progress
    from ..settings import Settings
    from .clouds.points import Points

    Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Rough:
    """The faces that are kept, their corners (n, 3) on the lattice, and where these lie after the low-pass filter."""

    faces: Faces
    lattice: Floats
    ring: OneRing
    vertices: Floats

    def cuberille(self, origin: Floats | float = 0.0) -> QuadMesh:
        """Return the faces between the cubes, counted from an origin."""
        return QuadMesh(self.lattice + origin, self.faces.quads.astype(np.int64))


@dataclass(frozen=True)
class Rest:
    """A mesh, its faces (m,) where there are no samples, and the fit; None where the shell was only smoothed."""

    mesh: TriMesh
    filled: NDArray[np.bool_]
    fitted: SurfaceFit | None


def surface_of_cloud(points: Points, settings: Settings, progress: Progress) -> Stage[Surface]:
    """Turn a cloud into a closed surface."""
    settled = settle(points, settings, progress)
    samples, origin, told = settled.value, lowest_corner(points), folded(None, settled)
    shell = shell_around(points, samples, settings, progress)
    walls = walls_of(shell.value, samples, points, origin, settings)
    rough = measured("smooth", _smoothed, shell.value, settings)
    smoothed, ring = rough.value.vertices, rough.value.ring
    rest = measured("fit", _fitted, shell.value, rough.value, samples, settings, progress, still=walls.value == 2)
    tangled = CrossingFaces(settings.run.threads)
    apart = measured("untangle", untangle, rest.value.mesh, smoothed, ring, tangled, rough.value.lattice)
    mesh, taken_back, crossing = apart.value
    trace, filled = None if rest.value.fitted is None else rest.value.fitted.trace, rest.value.filled
    moved = folded(None, rest, apart)
    del rest, apart  # and with them where the mesh was before
    followed = follows(shell.value, mesh, samples, origin, tangled, threads=settings.run.threads)
    del samples, settled, tangled  # before more is made
    filled = filled | interpolated(mesh.moved(mesh.vertices + origin), points)
    enclosed = hollow(shell.value.leak_test, shell.value.taken(settings), shell.value.cubes, shell.value.cell)
    surface = Surface(
        points.cloud, rough.value.cuberille(origin), mesh.moved(smoothed + origin),
        mesh.moved(mesh.vertices + origin), np.empty(0, np.int32), trace=trace, filled=filled,
        cavities=int(rough.value.faces.inward.sum()), crossing=crossing,
        encloses=enclosed if walls.value == 1 else None,
    )  # fmt: skip
    fitted = fit_found(trace, len(smoothed), taken_back=taken_back, filled=filled)
    return folded(surface, told, shell, walls, rough, moved, fitted, followed, place_found(points))


def _smoothed(shell: Shell, settings: Settings) -> Rough:
    faces = shell.leak_test.faces.only(shell.taken(settings))
    ring = OneRing.of_quads(faces.quads, len(faces.corners), settings.run.threads)
    lattice = shell.lowest + faces.corners * shell.cell
    return Rough(faces, lattice, ring, ring.smoothed(lattice, settings.cubes.low_pass))


def _fitted(
    shell: Shell, rough: Rough, samples: Samples, settings: Settings, progress: Progress, *, still: bool
) -> Rest:
    """Draw the mesh to the surface under its samples, unless it is to stay as it is."""
    if still:
        split = rough.cuberille().triangulated().moved(rough.vertices)
        return Rest(split, np.zeros(len(split.faces), np.bool_), None)
    edge, threads = float(shell.cell.min()), settings.run.threads
    fitted = fit_to_surface(rough.vertices, rough.ring, samples, edge, settings.fit, threads=threads, progress=progress)
    mesh, filled = TriMesh(fitted.vertices, fitted.faces), fitted.filled
    if shell.by_normals:
        filled = filled | holes(mesh, samples, edge)
        mesh = mesh.moved((capped if settings.cubes.fill_holes else carried_on)(mesh, filled))
    return Rest(mesh, any_of(filled[mesh.faces]), fitted)


WAY = Way(
    applies=lambda settings, input: input in POINTS,
    because=on_input,
    reads=CUBES | parameters("fill_holes", "stacks", "open", "attraction", "damping", "step"),
    surface=surface_of_cloud,
    of_body=body_of_cubes,
)
