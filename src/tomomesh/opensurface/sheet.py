"""An open surface as a sheet with borders: shell of cubes -> one of its two sides -> fit -> cut along the borders.

The samples are carried on beyond their borders by an apron, and the cubes are dilated once: so the shell has no
holes but those that are wide, and both sides reach over the borders. They come apart where the apron ends; the one
that is kept is laid over the samples, and what lies beyond the borders is cut away.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..cuberille.closing import close_shell
from ..cuberille.faces import exposed_faces
from ..cuberille.leak_test import LeakTest
from ..cuberille.neighbors import dilate
from ..cuberille.partition import cubes_over, dimensions
from ..dynamics.low_pass import OneRing
from ..dynamics.moving_least_squares import SurfaceFit, fit_to_surface
from ..dynamics.untangle import untangle
from ..errors import EmptyError, GeometryError
from ..model.columns import any_of
from ..model.cubes import cells_of
from ..model.mesh import TriMesh
from .borders import borders
from .sides import Side, one_side
from .trimming import trimmed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..dynamics.untangle import Tangled
    from ..pointcloud.samples import Samples
    from ..progress import Progress
    from ..settings import Settings
    from .borders import Borders

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

CLOSINGS = (0, 1, 2)
"""Closings that are tried until the two sides come apart, cubes. Chosen: half of it changes the distance by +0.1 %,
twice by +0.1 %."""
APRON = 0.7
"""How far a sheet is carried on beyond its borders, in the radius of the disks there. Chosen: half of it changes the
distance by -6.6 %, twice by -0.3 %."""
TIP = 0.8
"""Share of the apron from which the shell is cut away. Chosen: half of it changes the distance by -12.2 %, twice leads
to a refusal."""
DENSE = 0.5
"""Distance of the places on the apron, cube edges. Chosen: half of it changes the distance by -1.2 %, twice by -1.9 %.
"""
OVER = 0.4
"""How far a sheet reaches beyond its outermost samples, cube edges: half of that is where points thrown at random end
before their surface does. Chosen: half of it changes the distance by -8.5 %, twice by +23.8 %."""
EVEN = 3
"""Passes of the low-pass filter over the heights along whose zero the sheet is cut. Chosen: half of it changes the
distance by -0.3 %, twice by -1.5 %."""
SHIFT = 0.9
"""Share of a height by which that filter may change it: none changes its sign, or narrow strips would be cut. Chosen:
half of it changes the distance by +0.1 %, twice area -0.0 %."""
SNAP = (0.3, 0.1, 0.02)
"""Share of an edge over which a vertex moves to the cut; the first that lets no face pass through another. Chosen: half
of it changes the distance by +5.3 %, twice by +3.4 %."""


@dataclass(frozen=True)
class OpenSheet:
    """A sheet with borders; positions are relative to where the samples' are.

    Attributes
    ----------
    leak_test : LeakTest
        Of the shell with both its sides.
    cubes : int
        Cubes of the shell before it was closed.
    lattice : (n, 3) float array
        Vertices of the side that is kept.
    quads : (q, 4) int64 array
        Its squares.
    smoothed : TriMesh
        That side after the low-pass filter.
    mesh : TriMesh
        The sheet: a consistently oriented 2-manifold with borders.
    filled : (m,) bool array
        Faces that lie where there are no samples.
    crossing : (m,) bool array
        Faces that pass through others.
    fitted : SurfaceFit
    taken_back : int
        Vertices that do not lie where the fit had them.
    """

    leak_test: LeakTest
    cubes: int
    lattice: Floats
    quads: Integers
    smoothed: TriMesh
    mesh: TriMesh
    filled: NDArray[np.bool_]
    crossing: NDArray[np.bool_]
    fitted: SurfaceFit
    taken_back: int


def open_sheet(
    samples: Samples,
    spanned: Floats,
    cell: Floats,
    settings: Settings,
    tangled: Tangled,
    progress: Progress,
) -> OpenSheet:
    """Turn the samples of an open surface into a one-sided sheet.

    Parameters
    ----------
    samples : Samples
    spanned : (b, 3) float array
        What spans the narrow holes between them (`tomomesh.pointcloud.bridges`).
    cell : (3,) float array
        Edge of the cubes along each axis.
    settings : Settings
    tangled : callable
        Marks the faces (m,) of a mesh that pass through others.
    progress : callable

    Returns
    -------
    OpenSheet
        A hole stays open where a ball of five sampling distances fits through; narrower ones are closed. A surface
        without borders becomes a closed mesh.

    Raises
    ------
    GeometryError
        Where both sides of the surface are one, or the samples lie on a line or at one place.
    EmptyError
        Where nothing of the sheet is measured, or nothing lies within its borders.
    """
    _require_extent(samples)
    threads, edge = settings.run.threads, float(cell.min())
    found, samples = borders(samples, edge, threads=threads)
    kept = _kept_side(samples, spanned, found, cell, settings)
    ring = kept.side.ring
    fitted = fit_to_surface(kept.start, ring, samples, edge, settings.fit, threads=threads, progress=progress)
    mesh, taken_back, _ = untangle(TriMesh(fitted.vertices, fitted.faces), kept.start, ring, tangled)
    height = np.minimum(found.depths(mesh.vertices, threads=threads) + OVER * edge, 2 * edge)
    even = ring.smoothed(np.repeat(height[:, None], 3, axis=1), EVEN)[:, 0]
    most = SHIFT * np.abs(height)
    even = height + np.clip(even - height, -most, most)
    for near in SNAP:
        sheet, source = trimmed(mesh, even, near)
        crossing = tangled(sheet)
        if not crossing.any():
            break
    filled = any_of(fitted.filled[mesh.faces])[source]
    _require_measured(filled, samples)
    quads, smoothed = ring.quads.astype(np.int64), TriMesh(kept.smoothed, mesh.faces)
    return OpenSheet(
        kept.leak_test, kept.cubes, kept.lattice, quads, smoothed, sheet, filled, crossing,
        fitted, taken_back,
    )  # fmt: skip


def _require_extent(samples: Samples) -> None:
    """Refuse samples that span no surface."""
    extent = dimensions(samples.positions, float(np.median(samples.spacing)))
    if extent < 2:
        raise GeometryError(
            "the points span no surface: they lie " + ("on a line" if extent else "at one place"),
            found=f"{len(samples.positions)} sample(s)", expected="points all over a surface",
        )  # fmt: skip


def _require_measured(filled: NDArray[np.bool_], samples: Samples) -> None:
    """Refuse a sheet of which nothing, or nothing measured, lies within its borders."""
    if filled.all():
        raise EmptyError(
            "nothing of the sheet is measured within its borders",
            found=f"{len(samples.positions)} sample(s), {float(np.median(samples.spacing)):.4g} apart",
            expected="points all over a surface", hint="more points, or another --cell",
        )  # fmt: skip


@dataclass(frozen=True)
class _ShellSide:
    """One side of a shell: vertices (n, 3) on the lattice, smoothed, and where the fit starts."""

    leak_test: LeakTest
    cubes: int
    lattice: Floats
    smoothed: Floats
    start: Floats
    side: Side


def _kept_side(samples: Samples, spanned: Floats, found: Borders, cell: Floats, settings: Settings) -> _ShellSide:
    """Return one of the two sides of the shell around the sheet, from the narrowest closing that keeps them apart."""
    edge = float(cell.min())
    apron, share = found.apron(APRON, DENSE * edge)
    lowest, keys = cubes_over(np.concatenate([samples.positions, spanned, apron]), cell)
    cells = cells_of(dilate(np.unique(keys), 1))
    for closing in CLOSINGS:
        shell = close_shell(cells, closing, threads=settings.run.threads)
        both = exposed_faces(shell)
        ring = OneRing.of_quads(both.quads, len(both.corners), settings.run.threads)
        lattice = lowest + both.corners * cell
        smoothed = ring.smoothed(lattice, settings.cubes.low_pass)
        start = smoothed - edge * ring.normals(smoothed)
        side = one_side(start, ring, samples, apron, share >= TIP, edge, largest=settings.cubes.largest)
        if side is not None:
            kept, tested = side.vertices, LeakTest(shell, both, both.least_two_sided)
            return _ShellSide(tested, len(cells), lattice[kept], smoothed[kept], start[kept], side)
    raise GeometryError(
        "the two sides of the surface do not come apart: it has one side only, as a Moebius strip, or its borders "
        "are lost in the noise",
        found=f"cell = {edge:.4g}, {found.count} border(s)",
        expected="a surface with two sides",
        hint="a larger --cell",
    )
