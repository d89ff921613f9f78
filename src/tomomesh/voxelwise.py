"""The way without networks, one arrow a line: study -> mask -> boundary of its voxels -> mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .measure.topology import check_promise
from .model.cubes import CubeGrid
from .model.lattice import Lattice
from .model.networks import Networks
from .model.trace import Trace
from .segment.sample import Sampling
from .segment.window import choose_window, window
from .surface.voxels import boundary, voxel_surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .account import Account
    from .model.volume import Volume
    from .progress import Progress
    from .settings import Settings
    from .surface.voxels import Boundary, VoxelSurface

NOTHING = np.empty(0)
NO_NETWORKS = Networks(
    Lattice("none", np.empty((0, 2), np.int64), np.empty((0, 0), np.int32), (0,)),
    NOTHING.astype(np.int32),
    np.empty((0, 0, 2)),
    np.empty((0, 0), np.bool_),
    outlined=False,
    pixels=NOTHING.astype(np.int64),
    strays=NOTHING.astype(np.int64),
)
NO_CUBES = CubeGrid(NOTHING.astype(np.int64), np.zeros(3), np.ones(3), NOTHING.astype(np.int64), np.zeros(1, np.int64))
NO_TRACE = Trace(
    NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, NOTHING.astype(np.int64), NOTHING.astype(np.int64), converged=False
)


def find_boundary(volume: Volume, settings: Settings, account: Account) -> tuple[NDArray[np.bool_], Boundary]:
    """Return the window of a study (K, J, I) and its boundary."""
    with account.timed("window"):
        lower, upper = choose_window(volume, settings.window)
        mask = window(volume, lower=lower, upper=upper)
    account.window(mask, lower, upper)
    surface = "outer" if settings.cubes.surface == "outer" else "all"
    with account.timed("points"):
        found = boundary(volume, mask, lower=lower, upper=upper, surface=surface, threads=settings.run.threads)
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
