"""No network: the boundary of the window's own voxels -> mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..followed import Followed
from ..isosurface.voxels import Boundary, boundary, voxel_surface
from ..model.points import PointSet
from ..results import Segmentation, Surface
from ..segmentation.sample import Sampling
from ..stage import Stage, folded, measured
from .sections import body_of_voxels, boundary_found, points_found
from .way import POINTS, Way, parameters

if TYPE_CHECKING:
    from ..progress import Progress
    from ..segmentation.study import Selected
    from ..settings import Settings

NOTHING = np.empty(0)


def segment_by_voxels(kept: Selected, settings: Settings, progress: Progress) -> Stage[Segmentation[Boundary]]:
    """Take the boundary of the window in place of networks."""
    chosen, surface = kept.chosen, "outer" if settings.cubes.surface == "outer" else "all"
    progress("voxels", 0, 1)
    bounded = measured(
        "points", boundary, chosen.volume, chosen.mask, lower=chosen.lower, upper=chosen.upper,
        layers=settings.window.layers, surface=surface, divide=settings.cubes.divide, around=chosen.box,
        threads=settings.run.threads,
    )  # fmt: skip
    progress("voxels", 1, 1)
    found, spacing = bounded.value, max(kept.study.spacing_mm)
    sampling = Sampling(found.points, spacing, found.added, NOTHING, NOTHING)
    labels = kept.mask.view(np.uint8)
    made = Segmentation(kept.study, kept.plane, kept.chosen.runs, labels, found.points, sampling, found)
    return folded(made, bounded, points_found(found.points, spacing, bridged=found.added))


def surface_by_voxels(found: Segmentation[Boundary], settings: Settings, progress: Progress) -> Stage[Surface]:
    """Let a net around the voxels come to rest where the gray levels cross the window's bounds.

    No volume is asked of it: no vertex leaves its cell, so the middle of every voxel that is kept lies inside.
    """
    source = found.source
    threads = settings.run.threads
    meshed = measured("fit", voxel_surface, source, settings.fit, threads=threads, progress=progress)
    made = meshed.value
    surface = Surface(
        found.points, source.cuberille, made.smoothed, made.mesh, made.nearest, cavities=source.cavities,
        follows=Followed("voxels", source.affine, source.crossings.positions, float(source.volumes.sum())),
        cut_off=made.cut_off,
    )  # fmt: skip
    return folded(surface, meshed, boundary_found(source, made, labels=settings.window.select is not None))


def _pictures(found: Segmentation[Boundary]) -> dict[str, Any]:
    """Draw the points alone: without a network there are no kinds of neurons to tell apart."""
    return {"points": PointSet.from_positions(found.points.positions)}


WAY = Way(
    applies=lambda settings, input: input not in POINTS and settings.network.network == "none",
    because=lambda settings, input: "with --way voxels",
    reads=parameters("surface", "stiffness", "divide"),
    segment=segment_by_voxels,
    surface=surface_by_voxels,
    of_body=body_of_voxels,
    pictures=_pictures,
)
