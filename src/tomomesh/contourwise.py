"""The way from a stack of contours, one arrow a line: points -> slices -> insides -> voxels between -> mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .contours.known import known_slices
from .contours.slices import find_slices
from .contours.stack import contour_surface
from .errors import EmptyError
from .segmentation.contours.train import train_contours
from .segmentation.sample import sample_contours
from .segmentation.training import regions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .account import Account
    from .contours.slices import Slices
    from .contours.stack import ContourSurface
    from .model.contours import Contours
    from .model.points import PointSet
    from .model.volume import Volume
    from .progress import Progress
    from .segmentation.sample import Sampling
    from .settings import Settings


def slices_of(cloud: PointSet, settings: Settings) -> Slices | None:
    """Return the slices of a cloud that is a stack of contours, where that is to be found out."""
    if settings.cubes.stacks == "none":
        return None
    return known_slices(cloud) or find_slices(cloud.positions)


def find_contours(
    volume: Volume, mask: NDArray[np.bool_], settings: Settings, account: Account, progress: Progress
) -> tuple[Contours, NDArray[np.uint16], Sampling]:
    """Run several networks on every slice of a window; return also the regions and the points."""
    pixel_mm, run = volume.spacing_mm[:2], settings.run
    with account.timed("networks"):
        contours = train_contours(
            mask, settings.network, pixel_mm=pixel_mm, seed=run.seed, threads=run.threads, progress=progress
        )
    with account.timed("regions"):
        labels = regions(mask, contours, pixel_mm=pixel_mm, threads=run.threads)
    account.contours(contours, mask)
    with account.timed("points"):
        sampling = sample_contours(contours, volume)
    account.points(sampling.points, sampling.spacing_mm, sampling.bridged)
    return contours, labels, sampling


def slices_of_rings(points: PointSet) -> Slices:
    """Return the slices of the rings of a study, which know them.

    Raises
    ------
    EmptyError
        Where they are on one slice alone.
    """
    slices = known_slices(points)
    if slices is None:
        found = f"{len(np.unique(points.slices))} slice"
        raise EmptyError("contours on one slice enclose no volume", found=found, expected="at least two slices")
    return slices


def surface_of_contours(
    cloud: PointSet, slices: Slices, settings: Settings, account: Account, progress: Progress,
    *, finest: float | None = None, bridged: int = 0,
) -> ContourSurface:  # fmt: skip
    """Turn a stack of contours into a closed surface; voxels are as wide as `finest`, where no cell is asked for."""
    edge = finest if settings.cubes.cell_mm is None else float(np.min(settings.cubes.cell_mm))
    with account.timed("contours"):
        made = contour_surface(
            cloud.positions, slices, edge=None if edge is None else edge * settings.cubes.cell_factor,
            allow_leaks=settings.cubes.allow_leaks, fit=settings.fit, threads=settings.run.threads, progress=progress,
        )  # fmt: skip
    account.points(cloud, slices.spacing, bridged)
    account.boundary(made.boundary, made.rest)
    account.stack(made, slices)
    return made
