"""The way without networks, one arrow a line: study -> mask -> boundary of its voxels -> mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .isosurface.voxels import boundary, voxel_surface
from .measure.topology import check_promise
from .results import NOTHING
from .segmentation.sample import Sampling

if TYPE_CHECKING:
    from .account import Account
    from .isosurface.voxels import Boundary, VoxelSurface
    from .progress import Progress
    from .segmentation.selection import Chosen
    from .settings import Settings


def find_boundary(chosen: Chosen, settings: Settings, account: Account) -> Boundary:
    """Return the boundary of the voxels that are kept of a study."""
    surface = "outer" if settings.cubes.surface == "outer" else "all"
    with account.timed("points"):
        found = boundary(
            chosen.volume, chosen.mask, lower=chosen.lower, upper=chosen.upper, layers=settings.window.layers,
            surface=surface, threads=settings.run.threads,
        )  # fmt: skip
    account.points(found.points, max(chosen.volume.spacing_mm), found.added)
    return found


def sampled(found: Boundary) -> Sampling:
    """Return the crossings of a boundary as the point set P."""
    return Sampling(found.points, max(found.volume.spacing_mm), found.added, NOTHING, NOTHING)


def mesh_boundary(found: Boundary, settings: Settings, account: Account, progress: Progress) -> VoxelSurface:
    """Return the surface of a boundary, checked and measured."""
    with account.timed("fit"):
        made = voxel_surface(found, settings.fit, threads=settings.run.threads, progress=progress)
    account.boundary(found, made)
    with account.timed("quality"):
        check_promise(made.mesh, cavities=found.cavities)
        account.quality(made.mesh, found.points, found.cavities)
    return made
