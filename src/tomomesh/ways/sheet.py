"""An open surface: points -> samples of a surface -> shell of cubes -> one of its two walls, cut along its borders."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..measure.intersections import CrossingFaces
from ..model.mesh import QuadMesh
from ..opensurface.sheet import OpenSheet, open_sheet
from ..pointcloud.bridges import bridges
from ..results import Surface
from ..stage import Stage, folded, timed
from .clouds.points import place_found
from .clouds.samples import cell_edges, lowest_corner, require_parts, settle
from .sections import body_of_cubes, fit_found, shell_found, walls_found
from .way import POINTS, Way, parameters

if TYPE_CHECKING:
    from ..pointcloud.samples import Samples
    from ..progress import Progress
    from ..settings import Settings
    from .clouds.points import Points


def surface_of_sheet(points: Points, settings: Settings, progress: Progress) -> Stage[Surface]:
    """Turn the points of an open surface into a one-sided sheet."""
    settled = settle(points, settings, progress)
    laid = _lay(settled.value, settings, progress)
    made, origin = laid.value, lowest_corner(points)
    surface = Surface(
        points.cloud, QuadMesh(made.lattice + origin, made.quads),
        made.smoothed.moved(made.smoothed.vertices + origin), made.mesh.moved(made.mesh.vertices + origin),
        np.empty(0, np.int32), trace=made.fitted.trace, filled=made.filled, borders=True, crossing=made.crossing,
        cavities=int(made.leak_test.faces.inward.sum()),
    )  # fmt: skip
    fitted = fit_found(
        made.fitted.trace, len(made.fitted.vertices), taken_back=made.taken_back, filled=made.filled
    )  # fmt: skip
    return folded(surface, settled, laid, fitted, place_found(points))


@timed("fit")
def _lay(samples: Samples, settings: Settings, progress: Progress) -> Stage[OpenSheet]:
    cell, threads = cell_edges(samples, settings)[0], settings.run.threads
    require_parts(samples, cell, 2)
    spanned = bridges(samples, float(cell.min()), threads=threads, progress=progress)
    made = open_sheet(samples, spanned, cell, settings, CrossingFaces(threads), progress)
    every = np.ones(made.leak_test.faces.count, bool)
    return folded(made, shell_found(made.leak_test, every, cell, made.cubes, len(spanned)), walls_found(1))


WAY = Way(
    applies=lambda settings, input: input in POINTS and settings.cubes.open,
    because=lambda settings, input: "with --open",
    reads=parameters(
        "cell_mm", "cell_factor", "largest", "low_pass", "stacks", "open", "attraction", "damping", "step"
    ),
    surface=surface_of_sheet,
    of_body=body_of_cubes,
)
