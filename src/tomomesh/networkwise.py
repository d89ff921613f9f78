"""The paper's way from points, one arrow a line: cubes -> cuberille -> low-pass filter -> dynamic mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .cuberille.leak_test import CLOSINGS, close_leaks
from .cuberille.partition import is_flat, partition
from .dynamics.collapse import without_collapse
from .dynamics.low_pass import low_pass
from .dynamics.mass_spring import fit
from .errors import GeometryError
from .measure.topology import check_promise
from .results import Surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .account import Account
    from .model.points import PointSet
    from .progress import Progress
    from .settings import Settings

LEAST = 0.5
"""Share of the rings' volume that a shell must enclose; a slab may be too thin to be seen to hold."""


def surface_of_networks(
    points: PointSet,
    spacing: float,
    settings: Settings,
    account: Account,
    progress: Progress,
    *,
    expected_mm3: float = 0.0,
) -> Surface:
    """Turn points into a closed surface that rests on them: cubes -> cuberille -> low-pass filter -> dynamic mesh."""
    asked, threads = settings.cubes, settings.run.threads
    with account.timed("cubes"):
        grid = partition(points.positions, _cell(spacing, settings))
        closings = CLOSINGS if asked.closing is None else (asked.closing,)
        held = close_leaks(
            grid.cells, closings, cavities=asked.surface == "all", tracking=asked.tracking, threads=threads,
            progress=progress,
        )  # fmt: skip
        taken = held.faces.worth_keeping(largest=asked.largest)
    account.held(held, taken, grid.cell_mm, len(grid.keys))
    with account.timed("cuberille"):
        walls = held.faces.only(taken)
        cubes, cuberille, origins = walls.over(grid)
    enclosed = float(walls.volumes.sum() * grid.cell_mm.prod())
    if enclosed < LEAST * expected_mm3 if expected_mm3 else not held.tight:
        settings = _without_fit(account, settings, points.positions)
    with account.timed("smooth"):
        rough = cuberille.triangulated()
        smoothed = rough.moved(low_pass(cuberille.vertices, cuberille.edges, settings.cubes.smoothing))
    with account.timed("fit"):
        springs = cuberille.edges if settings.fit.springs == "quads" else rough.edges
        rest = fit(
            smoothed.vertices, springs, origins, points.positions, cubes, settings.fit,
            threads=threads, progress=progress,
        )  # fmt: skip
    mesh, collapsed = without_collapse(smoothed, smoothed.moved(rest.vertices))
    account.fit(rest.trace, len(mesh.vertices), collapsed)
    with account.timed("quality"):
        check_promise(mesh, cavities=account.cavities)
        account.quality(mesh, points, account.cavities)
    return Surface(points, cubes, cuberille, smoothed, mesh, rest.nearest, rest.trace, account.report)


def _cell(spacing: float, settings: Settings) -> NDArray[np.float64]:
    """Return the edge of the cubes along each axis: r, or what was asked for, times the dilation factor."""
    asked = settings.cubes.cell_mm or (spacing,)
    return np.broadcast_to(np.array(asked, np.float64) * settings.cubes.cell_factor, 3).copy()


def _without_fit(account: Account, settings: Settings, positions: NDArray[np.float64]) -> Settings:
    """Refuse a shell that the outside leaks into, unless that was allowed or the points lie in a plane.

    What is let pass is not fitted: both walls would rest on the same points, and the mesh would fall flat.
    """
    flat = is_flat(positions, account.cell_mm)
    if flat or settings.cubes.allow_leaks:
        account.unfitted(flat=flat)
        return settings.replace(max_steps=0)
    raise GeometryError(
        "the outside leaks into the shell of cubes, so its surface would have two walls",
        found=f"cell = {account.cell_mm:.4g}",
        expected="gaps between the points that are narrower than a hole of the surface",
        hint="a larger --cell-mm or --closing, or --allow-leaks",
    )
