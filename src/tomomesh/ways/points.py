"""What the ways from points begin with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..contours.known import known_slices
from ..contours.slices import find_slices
from ..errors import EmptyError
from ..model.columns import box
from ..results import Place
from ..stage import Stage, timed

if TYPE_CHECKING:
    from ..contours.slices import Slices
    from ..model.points import PointSet
    from ..settings import Settings


@dataclass(frozen=True)
class Points:
    """A cloud, what its numbers are, and its slices where it is a stack of contours.

    Attributes
    ----------
    cloud : PointSet
        Counted from its lowest corner, where that was asked for.
    place : Place
    slices : Slices or None
    """

    cloud: PointSet
    place: Place
    slices: Slices | None

    @property
    def input(self) -> str:
        """What kind of points they are, a key of `tomomesh.ways.way.INPUTS`."""
        return "cloud" if self.slices is None else "stack"


@timed("slices")
def take_points(cloud: PointSet, settings: Settings) -> Stage[Points]:
    """Find out what kind of points a cloud is.

    Raises
    ------
    EmptyError
        Without points.
    """
    if len(cloud) == 0:
        raise EmptyError("there are no points", expected="at least one")
    lowest, _ = box(cloud.positions)
    place = Place(settings.run.units, cloud.frame, tuple(lowest.tolist()), settings.run.local_origin)
    if settings.run.local_origin:
        cloud = replace(cloud, positions=cloud.positions - lowest)
    slices = None
    if settings.cubes.stacks != "none":
        slices = known_slices(cloud) or find_slices(cloud.positions)
    return Stage(Points(cloud, place, slices))


def place_found(points: Points) -> Stage[None]:
    """Tell where the lowest corner of a cloud is, and what its reader says of it."""
    known = {"origin": list(points.place.origin), "frame": points.place.frame, "notes": list(points.cloud.notes)}
    return Stage(None, {"points": known})
