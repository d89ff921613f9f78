"""Points themselves draw the mesh: points -> cubes -> mesh that rests on them (the paper's second stage)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..cuberille.partition import sampling_distance
from ..pointcloud.samples import distinct
from ..stage import Stage, folded, measured
from .clouds.points import place_found
from .cubes import surface_on_cubes
from .sections import body_of_cubes, points_found
from .way import CUBES, POINTS, SPRINGS, Way, parameters

if TYPE_CHECKING:
    from ..progress import Progress
    from ..results import Surface
    from ..settings import Settings
    from .clouds.points import Points


def surface_near_points(points: Points, settings: Settings, progress: Progress) -> Stage[Surface]:
    """Turn a cloud into a closed surface, each of whose vertices is drawn to the point nearest to it."""
    spaced = measured("points", sampling_distance, distinct(points.cloud.positions))
    told = points_found(points.cloud, spaced.value, unit=points.place.unit)
    made = surface_on_cubes(points.cloud, spaced.value, settings, progress)
    return folded(made.value, spaced, told, made, place_found(points))


WAY = Way(
    applies=lambda settings, input: input in POINTS and settings.fit.attraction == "nearest",
    because=lambda settings, input: "on a cloud with --attraction nearest",
    reads=CUBES | SPRINGS | parameters("attraction", "tracking"),
    surface=surface_near_points,
    of_body=body_of_cubes,
)
