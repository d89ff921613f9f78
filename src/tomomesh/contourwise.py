"""The way from a stack of contours, one arrow a line: points -> slices -> insides -> voxels between -> mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .surface.contours import contour_surface
from .surface.slices import find_slices, known_slices

if TYPE_CHECKING:
    from .account import Account
    from .model.points import PointSet
    from .progress import Progress
    from .settings import Settings
    from .surface.contours import ContourSurface
    from .surface.slices import Slices


def slices_of(cloud: PointSet, settings: Settings) -> Slices | None:
    """Return the slices of a cloud that is a stack of contours, where that is to be found out."""
    if settings.cubes.contours == "none":
        return None
    return known_slices(cloud) or find_slices(cloud.positions)


def surface_of_contours(
    cloud: PointSet, slices: Slices, settings: Settings, account: Account, progress: Progress
) -> ContourSurface:
    """Turn a stack of contours into a closed surface."""
    cell = settings.cubes.cell_mm
    with account.timed("contours"):
        made = contour_surface(
            cloud.positions, slices, edge=None if cell is None else min(cell) * settings.cubes.cell_factor,
            allow_leaks=settings.cubes.allow_leaks, fit=settings.fit, threads=settings.run.threads, progress=progress,
        )  # fmt: skip
    account.points(cloud, slices.spacing)
    account.boundary(made.boundary, made.rest)
    account.contours(made, slices.distance)
    return made
