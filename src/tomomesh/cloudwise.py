"""The way from any cloud, one arrow a line: points -> samples -> bridged cubes -> walls -> fitted mesh."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from .cuberille.leak_test import SURE, hold
from .cuberille.neighbors import once_each
from .cuberille.partition import cubes_over, is_flat
from .dynamics.low_pass import OneRing
from .dynamics.moving_least_squares import SurfaceFit, fit_to_surface
from .dynamics.untangle import untangle
from .errors import EmptyError, GeometryError
from .measure.intersections import Crossings
from .model.columns import any_of, box
from .model.cubes import cells_of, keys_of
from .model.mesh import QuadMesh, TriMesh
from .opensurface.gaps import gaps
from .opensurface.sheet import open_sheet
from .pointcloud.bridges import bridges
from .pointcloud.forecast import require_room, require_room_for_points
from .pointcloud.samples import Samples, settle_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .account import Account
    from .cuberille.leak_test import Held
    from .pointcloud.bridges import Bridges
    from .progress import Progress
    from .settings import Settings

    Floats = NDArray[np.float64]

FINE, COARSE = 0.95, 1.5
"""Least and greatest edge of the cubes over the sampling distance, but for noise."""
BENT = 0.08
"""Bend of the samples from which the finest cubes are taken; for less, the sagitta of an edge stays as it is there."""
MANY = 250_000
"""Samples up to which the finest cubes are taken in any case: the mesh then has a million faces."""
NOISE = (1.8, 1.3, 1.0)
"""Edges of the cubes over the noise of the points, tried one after the other: small cubes show noise as handles,
large ones fill thin parts."""
SPANS = (5.0, 12.0)
"""Longest bridges that are tried, sampling distances."""
WIDEST = 6.0
"""Widest closing that is tried, sampling distances: large cubes are closed by fewer."""
TRIED = ((0, 1, 2), (3, 4, 5, 6, 7, 8))
"""Closings that are tried before and after longer bridges, cubes."""


@dataclass(frozen=True)
class CloudSurface:
    """A cloud and its surface, every stage of it; positions are relative to the origin.

    Attributes
    ----------
    samples : Samples
    held : Held
    origin : (3,) float array
        Where positions are counted from, in the cloud's own frame.
    cuberille : QuadMesh
    smoothed, mesh : TriMesh
        In the cloud's own frame.
    filled : (m,) bool array
        Faces that lie where there are no samples.
    crossing : (m,) bool array
        Faces that pass through others.
    fitted : SurfaceFit or None
        The fit; None where the shell was only smoothed.
    """

    samples: Samples
    held: Held
    origin: Floats
    cuberille: QuadMesh
    smoothed: TriMesh
    mesh: TriMesh
    filled: NDArray[np.bool_]
    crossing: NDArray[np.bool_]
    fitted: SurfaceFit | None


def surface_of_cloud(positions: Floats, settings: Settings, account: Account, progress: Progress) -> CloudSurface:
    """Turn positions (n, 3) into a closed surface, or into a sheet with borders where that is asked for."""
    if len(positions) == 0:
        raise EmptyError("there are no points", expected="at least one")
    threads, (origin, _) = settings.run.threads, box(positions)
    require_room_for_points(len(positions))
    with account.timed("samples"):
        samples = settle_points(positions - origin, threads=threads, progress=progress)
    account.samples(len(positions), samples)
    if settings.cubes.open:
        return _open_surface(samples, origin, settings, account, progress)
    with account.timed("cubes"):
        shell = _hold(len(positions), samples, settings, progress)
    held, cell = shell.held, shell.cell
    taken = held.walls.worth_keeping(largest=settings.cubes.largest)
    account.held(held, taken, cell, shell.cubes, len(shell.spanned.places))
    fits = held.holds or not _refused(samples, origin, settings, account)
    walls = held.walls.only(taken)
    with account.timed("smooth"):
        ring = OneRing.of_quads(walls.quads, len(walls.corners), threads)
        lattice = shell.lowest + walls.corners * cell
        vertices = ring.smoothed(lattice, settings.cubes.smoothing)
    with account.timed("fit"):
        smoothed = TriMesh(vertices, _halves(walls.quads))
        mesh, fitted = smoothed, None
        filled: NDArray[np.bool_] = np.zeros(len(smoothed.faces), np.bool_)
        if fits:
            edge = float(cell.min())
            fitted = fit_to_surface(vertices, ring, samples, edge, settings.fit, threads=threads, progress=progress)
            mesh = TriMesh(fitted.vertices, fitted.faces)
            filled = any_of(fitted.filled[fitted.faces])
    with account.timed("untangle"):
        mesh, taken_back, crossing = untangle(mesh, vertices, ring, Crossings(threads))
    account.fitted(fitted, taken_back, filled)
    return CloudSurface(
        samples, held, origin, QuadMesh(lattice + origin, walls.quads.astype(np.int64), keys_of(walls.cells)),
        smoothed.moved(vertices + origin), mesh.moved(mesh.vertices + origin), filled, crossing, fitted,
    )  # fmt: skip


def _open_surface(
    samples: Samples, origin: Floats, settings: Settings, account: Account, progress: Progress
) -> CloudSurface:
    """Turn the samples of an open surface into a one-sided sheet."""
    cell, threads = _cell_edges(samples, settings)[0], settings.run.threads
    with account.timed("fit"):
        spanned = bridges(samples, float(cell.min()), threads=threads, progress=progress)
        made = open_sheet(samples, spanned, cell, settings, Crossings(threads), progress)
    account.held(made.held, np.ones(made.held.walls.count, bool), cell, made.cubes, len(spanned.places))
    account.fitted(made.fitted, made.taken_back, made.filled)
    return CloudSurface(
        samples, made.held, origin, QuadMesh(made.lattice + origin, made.quads, keys_of(made.cells)),
        made.smoothed.moved(made.smoothed.vertices + origin), made.mesh.moved(made.mesh.vertices + origin),
        made.filled, made.crossing, made.fitted,
    )  # fmt: skip


@dataclass(frozen=True)
class _Shell:
    """Cubes (c, 3) of an edge from a lowest corner, what spans their holes, and how they hold."""

    cell: Floats
    lowest: Floats
    cubes: int
    spanned: Bridges
    held: Held


def _hold(count: int, samples: Samples, settings: Settings, progress: Progress) -> _Shell:
    """Return the shell that holds with the least that is made up: short bridges, narrow closings, large cubes."""
    cubes, best = settings.cubes, None
    closings = TRIED if cubes.closing is None else ((cubes.closing,),)
    reach = WIDEST * float(np.median(samples.spacing))
    for tried, span, cell in product(closings, SPANS, _cell_edges(samples, settings)):
        require_room(count, samples, cell)
        spanned = bridges(samples, float(cell.min()), span=span, threads=settings.run.threads, progress=progress)
        lowest, keys = cubes_over(np.concatenate([samples.positions, spanned.places]), cell)
        cells = cells_of(once_each(keys))
        steps = [k for k in tried if cubes.closing is not None or k * cell.min() <= reach]
        held = hold(
            cells, steps, cavities=cubes.surface == "all", threads=settings.run.threads, progress=progress
        )  # fmt: skip
        if best is None or held.two_sided >= SURE or held.is_better_than(best.held):
            best = _Shell(cell, lowest, len(cells), spanned, held)
        if held.two_sided >= SURE:
            break
    assert best is not None
    return best


def _cell_edges(samples: Samples, settings: Settings) -> list[Floats]:
    """Return the edges of the cubes along each axis: the sampling distance, or what the noise needs, or as asked."""
    spacing, noise = float(np.median(samples.spacing)), float(np.median(samples.noise))
    most = min(COARSE, FINE * max(1.0, np.sqrt(len(samples.positions) / MANY)))
    fine = float(np.clip(FINE * np.sqrt(BENT / max(samples.bend, 1e-300)), FINE, most))
    own = dict.fromkeys(max(fine * spacing, factor * noise) for factor in NOISE)
    asked = [settings.cubes.cell_mm] if settings.cubes.cell_mm else [(edge,) for edge in own]
    return [np.broadcast_to(np.array(one) * settings.cubes.cell_factor, 3).copy() for one in asked]


def _refused(samples: Samples, origin: Floats, settings: Settings, account: Account) -> bool:
    """Refuse a shell that the outside leaks into, unless that was allowed or the points lie in a plane.

    What is let pass is not fitted: both walls would rest on the same samples, and the mesh would fall flat.
    """
    flat = is_flat(samples.positions, float(np.median(samples.spacing)))
    if flat or settings.cubes.allow_leaks:
        account.unfitted(flat=flat)
        return True
    found = gaps(samples, account.cell_mm, threads=settings.run.threads)
    where = [f"a gap of {gap.size:.4g} around {_place(gap.place + origin)}" for gap in found[:1]]
    raise GeometryError(
        ("the points look like an open surface: " if found else "")
        + "the outside leaks into the shell of cubes, so its surface would have two walls",
        found=f"{len(found)} border(s), the widest {where[0]}" if found else f"cell = {account.cell_mm:.4g}",
        expected="points all around the object, without gaps as wide as its holes",
        hint="--open for a sheet with borders, a larger --closing or --cell, or --allow-leaks",
    )


def _place(place: Floats) -> str:
    return "(" + ", ".join(f"{c:.6g}" for c in place) + ")"


def _halves(quads: NDArray[np.int32]) -> NDArray[np.int64]:
    """Split each square by its diagonal 0-2 (the paper's systematic triangulation, Fig. 8b)."""
    return quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.int64)
