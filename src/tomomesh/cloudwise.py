"""The way from any cloud, one arrow a line: points -> samples -> bridged cubes -> walls -> draped mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .errors import EmptyError, GeometryError, ResourceError
from .measure.intersections import self_intersections
from .model.cubes import MARGIN, SIDE, cells_of, keys_of
from .model.mesh import QuadMesh, TriMesh
from .surface.bridges import bridges
from .surface.drape import Draped, Ring, drape
from .surface.gaps import widest_gap
from .surface.holding import hold
from .surface.samples import Samples, settle_points
from .surface.untangle import untangle

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .account import Account
    from .progress import Progress
    from .settings import Settings
    from .surface.bridges import Bridges
    from .surface.holding import Held

    Floats = NDArray[np.float64]

NOISE = 1.8
"""Edge of the cubes over the noise of the points: smaller ones would show it as handles."""
FLAT = 1e-6
"""Thickness of a cloud, in sampling distances, under which it counts as flat."""


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
    draped : Draped or None
        The fit; None where the shell was only smoothed.
    """

    samples: Samples
    held: Held
    origin: Floats
    cuberille: QuadMesh
    smoothed: TriMesh
    mesh: TriMesh
    filled: NDArray[np.bool_]
    draped: Draped | None


def surface_of_cloud(positions: Floats, settings: Settings, account: Account, progress: Progress) -> CloudSurface:
    """Turn positions (n, 3) into a closed surface."""
    if len(positions) == 0:
        raise EmptyError("there are no points", expected="at least one")
    threads, origin = settings.run.threads, positions.min(axis=0)
    with account.timed("samples"):
        samples = settle_points(positions - origin, threads=threads, progress=progress)
    cell = _cell(samples, settings)
    account.samples(len(positions), samples)
    with account.timed("bridges"):
        spanned = bridges(samples, float(cell.min()), threads=threads, progress=progress)
    with account.timed("cubes"):
        lowest, cells = _cells(np.concatenate([samples.positions, spanned.places]), cell)
        cavities = settings.cubes.surface == "all"
        held = hold(cells, settings.cubes.closing, cavities=cavities, threads=threads, progress=progress)
    taken = _taken(held, settings)
    account.held(held, taken, cell, len(cells), len(spanned.places))
    fitted = held.holds or not _refused(samples, spanned, origin, settings, account)
    walls = held.walls.only(taken)
    with account.timed("smooth"):
        ring = Ring(walls.quads, len(walls.corners), threads)
        lattice = lowest + walls.corners * cell
        vertices = ring.smoothed(lattice, settings.cubes.smoothing)
    with account.timed("fit"):
        smoothed = TriMesh(vertices, _halves(walls.quads))
        mesh, filled, draped = smoothed, np.zeros(len(smoothed.faces), bool), None
        if fitted:
            draped = drape(vertices, ring, samples, float(cell.min()), settings.fit, threads=threads, progress=progress)
            mesh = TriMesh(draped.vertices, draped.faces)
            filled = draped.filled[draped.faces].any(axis=1)
    with account.timed("untangle"):
        mesh, taken_back = untangle(mesh, vertices, ring, lambda one: self_intersections(one, threads=threads))
    account.draped(draped, taken_back, filled)
    return CloudSurface(
        samples, held, origin, QuadMesh(lattice + origin, walls.quads.astype(np.int64), keys_of(walls.cells)),
        smoothed.moved(vertices + origin), mesh.moved(mesh.vertices + origin), filled, draped,
    )  # fmt: skip


def _cell(samples: Samples, settings: Settings) -> Floats:
    """Return the edge of the cubes along each axis: the sampling distance, or what the noise needs, or as asked."""
    own = max(float(np.median(samples.spacing)), NOISE * float(np.median(samples.noise)))
    asked = settings.cubes.cell_mm or (own,)
    return np.broadcast_to(np.array(asked, np.float64) * settings.cubes.cell_factor, 3).copy()


def _cells(places: Floats, cell: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Return the lowest corner of cell (0, 0, 0), and the cells (c, 3) that hold places."""
    low = places.min(axis=0)
    widest = float((places.max(axis=0) - low).max())
    most = SIDE - 2 * MARGIN - 2
    if (widest / cell).max() > most:
        raise ResourceError(
            "the cubes are too small for the extent of the points",
            found=f"cell = {cell.min():g}",
            expected=f"at least {widest / most:g}",
            hint="a larger --cell",
        )
    lowest = low - 0.5 * cell
    keys = keys_of(np.floor((places - lowest) / cell).astype(np.int64))
    return lowest, cells_of(np.unique(keys))


def _taken(held: Held, settings: Settings) -> NDArray[np.bool_]:
    """Return which surfaces are kept: all but debris, or the largest alone."""
    taken = ~held.walls.debris
    if settings.cubes.largest:
        taken[:] = False
        taken[np.argmax(np.abs(held.walls.volumes))] = True
    return taken


def _refused(samples: Samples, spanned: Bridges, origin: Floats, settings: Settings, account: Account) -> bool:
    """Refuse a shell that the outside leaks into, unless that was allowed or the points lie in a plane.

    What is let pass is not fitted: both walls would rest on the same samples, and the mesh would fall flat.
    """
    flat = _is_flat(samples)
    if flat or settings.cubes.allow_leaks:
        account.warn(
            "the points lie in a plane, on a line or at one place: their shell is smoothed, but not fitted"
            if flat
            else "the outside leaks into the shell: its surface has two walls, and is smoothed, but not fitted"
        )
        return True
    gap = widest_gap(samples, spanned.sectors)
    where = f"a gap of {gap[0]:.4g} around {_place(gap[1] + origin)}" if gap else f"cell = {account.cell_mm:.4g}"
    raise GeometryError(
        "the outside leaks into the shell of cubes, so its surface would have two walls",
        found=where,
        expected="points all around the object, without gaps as wide as its holes",
        hint="--open for a sheet with borders, a larger --closing or --cell, or --allow-leaks",
    )


def _is_flat(samples: Samples) -> bool:
    centered = samples.positions - samples.positions.mean(axis=0)
    thickness = np.linalg.svd(centered.T @ centered / len(centered), compute_uv=False)[-1]
    return bool(thickness <= (FLAT * float(np.median(samples.spacing))) ** 2)


def _place(place: Floats) -> str:
    return "(" + ", ".join(f"{c:.6g}" for c in place) + ")"


def _halves(quads: NDArray[np.int32]) -> NDArray[np.int64]:
    """Split each square by its diagonal 0-2 (the paper's systematic triangulation, Fig. 8b)."""
    return quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.int64)
