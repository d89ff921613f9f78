"""The way without networks, one arrow a line: study -> mask -> boundary of its voxels -> mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .measure.topology import check_promise
from .results import NOTHING
from .segment.sample import Sampling
from .segment.window import choose_window, window
from .surface.voxels import boundary, voxel_surface

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from .account import Account
    from .model.volume import Volume
    from .progress import Progress
    from .settings import Settings
    from .surface.voxels import Boundary, VoxelSurface


def find_boundary(volume: Volume, settings: Settings, account: Account) -> tuple[NDArray[np.bool_], Boundary]:
    """Return the window of a study (K, J, I) and its boundary."""
    layers = settings.window.layers
    with account.timed("window"):
        lower, upper = choose_window(volume, settings.window)
        mask = window(volume, lower=lower, upper=upper, layers=layers)
    account.window(mask, lower, upper, volume.layers)
    surface = "outer" if settings.cubes.surface == "outer" else "all"
    with account.timed("points"):
        found = boundary(
            volume, mask, lower=lower, upper=upper, layers=layers, surface=surface, threads=settings.run.threads
        )
    account.points(found.points, max(volume.spacing_mm), found.added)
    return mask, found


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
