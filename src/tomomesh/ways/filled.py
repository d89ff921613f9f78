"""Points that fill a solid: points -> voxels, gaps closed -> their boundary -> mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import EmptyError
from ..isosurface.voxels import boundary, voxel_surface
from ..model.columns import box
from ..model.volume import Grid, Volume
from ..pointcloud.solid import FINE, depths, distance_within
from ..results import Surface
from ..stage import Stage, folded, measured, timed
from .clouds.points import place_found
from .sections import body_of_voxels, boundary_found, points_found
from .way import POINTS, Way, parameters

if TYPE_CHECKING:
    from ..progress import Progress
    from ..settings import Settings
    from .clouds.points import Points

MOST_VOXELS = 60_000_000
"""Voxels over which they are made larger, a cube of 391 to a side: only memory and detail depend on it."""


def surface_of_filled(points: Points, settings: Settings, progress: Progress) -> Stage[Surface]:
    """Close the boundary of a solid that points fill."""
    places = np.unique(points.cloud.positions, axis=0)
    apart = measured("points", distance_within, places)
    filled = _fill(points, apart.value, settings)
    edges = boundary(filled.value, filled.value.voxels > 0, lower=0.0, threads=settings.run.threads)
    rest = measured("fit", voxel_surface, edges, settings.fit, threads=settings.run.threads, progress=progress)
    surface = Surface(
        points.cloud, edges.cuberille, rest.value.smoothed, rest.value.mesh, rest.value.nearest,
        cavities=edges.cavities,
    )  # fmt: skip
    told = points_found(points.cloud, apart.value, unit=points.place.unit)
    return folded(surface, apart, filled, rest, told, boundary_found(edges, rest.value), place_found(points))


@timed("cubes")
def _fill(points: Points, apart: float, settings: Settings) -> Stage[Volume]:
    asked = settings.cubes.cell_mm
    low, high = box(points.cloud.positions)
    least = float(((high - low + 6 * apart).prod() / MOST_VOXELS) ** (1 / 3))
    edge = max(float(np.min(asked)) if asked else FINE * apart * settings.cubes.cell_factor, least)
    if edge <= 0 or not np.isfinite(edge):
        raise EmptyError("the points fill nothing", found="all at one place", expected="points within a solid")
    levels, first = depths(points.cloud.positions, apart, edge)
    if not (levels > 0).any():
        raise EmptyError("the points fill no voxel", found=f"edge = {edge:.4g}", hint="a smaller --cell")
    affine = np.diag([edge, edge, edge, 1.0])
    affine[:3, 3] = first
    return Stage(Volume(levels, affine, Grid((0, 1, 2), (False, False, False), affine)))


WAY = Way(
    applies=lambda settings, input: input in POINTS and settings.cubes.filled,
    because=lambda settings, input: "with --filled",
    reads=parameters("cell_mm", "cell_factor", "stiffness"),
    surface=surface_of_filled,
    of_body=lambda report: body_of_voxels(report, "what the points fill"),
)
