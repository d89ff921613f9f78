"""A stack of contours: points -> slices -> insides -> voxels between the slices -> mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..contours.direction import FEWEST
from ..contours.stack import ContourSurface, contour_surface
from ..model.points import NEURON
from ..results import Enclosed, Surface
from ..stage import Stage, folded, measured
from .clouds.points import place_found
from .sections import body_of_voxels, boundary_found, points_found
from .way import Way, on_input, parameters

if TYPE_CHECKING:
    from ..contours.slices import Slices
    from ..model.points import PointSet
    from ..progress import Progress
    from ..settings import Settings
    from .clouds.points import Points

APART = 1.5
"""Distance of two slices of a stack of contours, in median ones, over which a result is warned of: half a slice more
than one, so that a missing slice is told. A warning's threshold, chosen: no mesh depends on it."""

NAMED = 4
"""Places that a warning names at most."""


def surface_of_stack(points: Points, settings: Settings, progress: Progress) -> Stage[Surface]:
    """Close a cloud that is a stack of contours."""
    assert points.slices is not None
    made = surface_of_slices(points.cloud, points.slices, settings, progress, unit=points.place.unit)
    return folded(made.value, made, place_found(points))


def surface_of_slices(
    cloud: PointSet, slices: Slices, settings: Settings, progress: Progress,
    *, finest: float | None = None, bridged: int = 0, encloses: Enclosed | None = None, unit: str = "mm",
) -> Stage[Surface]:  # fmt: skip
    """Turn contours into a closed surface.

    Parameters
    ----------
    cloud : PointSet
    slices : Slices
    settings : Settings
    progress : callable
    finest : float, optional
        Edge of the voxels between the slices, where no cell is asked for.
    bridged : int
        Gaps of the contours that were bridged.
    encloses : Enclosed, optional
        What a study's rings or its window enclose; the slices do where not given.
    unit : str
    """
    asked = settings.cubes
    edge = finest if asked.cell_mm is None else float(np.min(asked.cell_mm))
    closed = measured(
        "contours", contour_surface, cloud.positions, slices, edge=None if edge is None else edge * asked.cell_factor,
        thickness=settings.cloud.thickness, allow_leaks=asked.allow_leaks, fit=settings.fit,
        threads=settings.run.threads, progress=progress,
    )  # fmt: skip
    made = closed.value
    surface = Surface(
        cloud, made.boundary.cuberille, made.rest.smoothed, made.mesh, made.rest.nearest, filled=made.filled,
        cavities=made.boundary.cavities, encloses=encloses or _least(made, slices),
    )  # fmt: skip
    spaced = points_found(cloud, slices.spacing, unit=unit, bridged=bridged)
    left = int((cloud.kinds[slices.labels < 0] == NEURON).sum())
    told = _stack_found(made, slices, left=left, of_study=encloses is not None)
    return folded(surface, closed, spaced, boundary_found(made.boundary, made.rest), told)


def _least(made: ContourSurface, slices: Slices) -> Enclosed:
    """Return the volume of the frusta; of several structures, which may lie in each other, that of the largest."""
    stack = made.stack
    if not slices.rings:
        return Enclosed("slices", float(stack.frusta.sum()))
    _, first = np.unique(stack.body, return_index=True)
    groups = slices.groups[[stack.parts[n].plane for n in first]]
    volumes = np.bincount(groups, stack.frusta)
    return Enclosed("slices", float(volumes.max()), whole=int(np.count_nonzero(volumes)) < 2)


def _stack_found(made: ContourSurface, slices: Slices, *, left: int, of_study: bool) -> Stage[None]:
    """Tell of the slices, and the voxels between them."""
    stack, volume = made.stack, float(made.mesh.face_volumes.sum())
    widest = max((float(gaps.max()) for gaps in stack.gaps.values()), default=stack.step)
    frusta = float(stack.frusta.sum())
    stats: dict[str, dict[str, Any]] = {
        "stack": {
            "slices": made.slices,
            "contours": made.contours,
            "open": made.open,
            "bodies": int(stack.body.max()) + 1,
            "on_one_slice": len(stack.alone),
            "points_left_out": left,
            "slice_distance_mm": stack.step,
            "widest_slice_distance_mm": widest,
            "longest_gap": made.reach,
            "frusta_mm3": frusta,
            "volume_over_frusta": volume / frusta,
            "voxel_mm": made.edge,
            "voxels": made.voxels,
        },
        "fit": {"filled_faces": int(made.filled.sum())},
    }
    warnings = [] if of_study else _told_of_slices(made, slices, widest, left)
    if made.edge > made.asked_edge:
        warnings.append(f"voxels of {made.asked_edge:.4g} would not fit: they are {made.edge:.4g} wide")
    return Stage(None, stats, tuple(warnings))


def _told_of_slices(made: ContourSurface, slices: Slices, widest: float, left: int) -> list[str]:
    """Warn of what the slices do not tell."""
    stack, told = made.stack, []
    if stack.widest > APART:
        told.append(f"slices lie up to {widest:.4g} apart, {stack.step:.4g} as a rule: that is interpolated")
    if stack.alone and stack.thickness is None:
        places = (slices.origin + part.place @ slices.axes for part in stack.alone[:NAMED])
        least = 1e-6 * made.edge  # what rounding leaves of 0 would be told with its power of ten
        named = "; ".join(", ".join(f"{axis:.4g}" for axis in np.where(abs(at) < least, 0.0, at)) for at in places)
        more = "; ..." if len(stack.alone) > NAMED else ""
        told.append(
            f"{len(stack.alone)} contour(s) go on in no other slice, and are made a slice distance thick: "
            f"at {named}{more}"
        )
    if left:
        told.append(f"{left} point(s) are on no contour of {FEWEST} points or more: they are left out")
    return told


def body_of_stack(report: dict[str, Any]) -> list[str]:
    """Say in the summary what voxels lie between the slices."""
    return body_of_voxels(report, "insides of contours interpolated")


WAY = Way(
    applies=lambda settings, input: input == "stack",
    because=on_input,
    reads=parameters("cell_mm", "cell_factor", "stacks", "allow_leaks", "attraction", "stiffness"),
    surface=surface_of_stack,
    of_body=body_of_stack,
)
