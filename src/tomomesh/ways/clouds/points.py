"""What the ways from points begin with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ...contours.axis import half_planes
from ...contours.known import known_slices
from ...contours.slices import find_slices, one_slice
from ...contours.turning import between_half_planes
from ...errors import EmptyError, GeometryError
from ...model.columns import box
from ...model.units import MM
from ...results import Place
from ...stage import Stage, timed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...contours.slices import Slices
    from ...model.mesh import TriMesh
    from ...model.points import PointSet
    from ...settings import Settings


OWN = ("um", "mm", "cm", "m", "voxel", "unknown")
"""Units that files of tomomesh name."""
WORDS = {"in": "inches", "ft": "feet", "us-ft": "US survey feet"}
"""What others are called in a sentence."""


@dataclass(frozen=True)
class Points:
    """A cloud, what its numbers are, and its slices where it is a stack of contours.

    Attributes
    ----------
    cloud : PointSet
        Counted from its lowest corner, where that was asked for.
    place : Place
    slices : Slices or None
    between : (k, 3) float array
        Places interpolated between outlines in planes about one axis; none of any other cloud.
    """

    cloud: PointSet
    place: Place
    slices: Slices | None
    between: NDArray[np.float64]

    @property
    def places(self) -> NDArray[np.float64]:
        """The points, and what was interpolated between them, (n + k, 3)."""
        return np.concatenate([self.cloud.positions, self.between]) if len(self.between) else self.cloud.positions

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
    cloud, unit = in_unit(cloud, settings.run.units)
    lowest, _ = box(cloud.positions)
    place = Place(unit, cloud.frame, tuple(lowest.tolist()), settings.run.local_origin)
    if settings.run.local_origin:
        cloud = replace(cloud, positions=cloud.positions - lowest)
    stacked = settings.cubes.stacks != "none"
    slices = _slices(cloud, settings.cloud.thickness) if stacked else None
    if slices or not stacked or settings.cubes.open or settings.fit.attraction == "nearest":
        return Stage(Points(cloud, place, slices, np.empty((0, 3))))
    return Stage(Points(*_turned_about(cloud, place)))


def _slices(cloud: PointSet, thickness: float | None) -> Slices | None:
    """Return the slices of a stack of contours, or the only one, where it was given a thickness; else None."""
    found = known_slices(cloud, thickness) or find_slices(cloud.positions)
    return found or (one_slice(cloud.positions, thickness) if thickness else None)


def _turned_about(cloud: PointSet, place: Place) -> tuple[PointSet, Place, None, NDArray[np.float64]]:
    """Interpolate between planes about an axis, where a cloud lies in such, and note that in the cloud."""
    found = half_planes(cloud.positions)
    if found is None:
        return cloud, place, None, np.empty((0, 3))
    told = f"the points lie in {len(found.angles) // 2} planes about one axis: what is between is interpolated"
    return replace(cloud, notes=(*cloud.notes, told)), place, None, between_half_planes(found)


def in_unit(cloud: PointSet, asked: str | None) -> tuple[PointSet, str]:
    """Return a cloud in a unit of `OWN`, and that unit: as asked for, else as its file states, else millimeters.

    Raises
    ------
    GeometryError
        For degrees, and other units that have no known length.
    """
    unit = asked or cloud.unit or "mm"
    if unit in OWN:
        return cloud, unit
    if unit not in MM:
        raise GeometryError(
            "the coordinates are no lengths that are known", found=f"unit = {unit}",
            expected="meters, feet or another length, as of a projected coordinate system",
            hint="--units, to take the numbers as lengths",
        )  # fmt: skip
    near = "m" if MM[unit] > MM["um"] else "um"
    told = f"coordinates in {WORDS.get(unit, unit)} were converted to {near}"
    positions = cloud.positions * (MM[unit] / MM[near])
    return replace(cloud, positions=positions, notes=(*cloud.notes, told), unit=near), near


def place_found(points: Points) -> Stage[None]:
    """Tell where the lowest corner of a cloud is, and what its reader says of it."""
    known = {"origin": list(points.place.origin), "frame": points.place.frame, "notes": list(points.cloud.notes)}
    return Stage(None, {"points": known})


def interpolated(mesh: TriMesh, points: Points) -> NDArray[np.bool_]:
    """Tell which faces (m,) are nearer to what was interpolated between the points than to these."""
    if len(points.between) == 0:
        return np.zeros(len(mesh.faces), np.bool_)
    nearest = np.asarray(scipy.spatial.cKDTree(points.places).query(mesh.corners.mean(axis=1))[1])
    return nearest >= len(points.cloud)
