"""Hand the stages of a result to the gallery."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..model.points import PointSet
from ..show import draw_all
from ..show.plane import Plane
from ..show.render import View

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

    from ..pipeline import Segmentation, Surface
    from ..settings import Settings


def pictures(
    stage_one: Segmentation | None, surface: Surface | None, settings: Settings
) -> Iterator[tuple[str, Figure]]:
    """Yield every picture that the stages allow, with its name."""
    stages: dict[str, Any] = {"tolerance": settings.fit.tolerance}
    if stage_one is not None:
        volume = stage_one.volume
        plane = stage_one.report["study"]["plane"]
        stages |= {
            "images": volume.voxels,
            "mask": stage_one.mask,
            "networks": stage_one.networks,
            "labels": stage_one.labels,
            "points": _drawn(stage_one),
            "plane": Plane(spacing_mm=volume.spacing_mm[:2], upward=plane != "axial"),
        }
    if surface is not None:
        stages |= {
            "points": surface.points if stage_one is None else _drawn(stage_one),
            "cuberille": surface.cuberille,
            "triangulated": surface.cuberille.triangulated(),
            "smoothed": surface.smoothed,
            "mesh": surface.mesh,
            "trace": surface.trace,
            "view": _view(stage_one, settings),
        }
    return draw_all(**stages)


def _drawn(stage_one: Segmentation) -> PointSet:
    """Return the points; without a network there are no kinds of neurons to tell apart."""
    points = stage_one.points
    return points if stage_one.boundary is None else PointSet.from_positions(points.positions)


def _view(stage_one: Segmentation | None, settings: Settings) -> View:
    """Name the axes of the patient where there is one, and plainly where there is a cloud."""
    return View() if stage_one is not None else View(unit=settings.run.units, axes=("x", "y", "z"))
