"""Which cubes the surface between samples passes through: those of the triangles between neighbors.

A shell of cubes that hold samples has holes, and its closing joins sheets that are near one another. The triangles of
each sample and its neighbors along the surface (a star: their Delaunay triangulation in its plane) leave no holes but
those that are wider than it looks, and so the cubes may be small.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..cuberille.neighbors import once_each
from ..kernels.pointcloud.stars import lay_stars
from ..kernels.threads import in_blocks
from ..model.cubes import keys_of
from ..progress import Progress, silent

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .samples import Samples

    Floats = NDArray[np.float64]

BLOCK = 1_024
"""Samples worked on in one call. No result depends on it."""
SIGHT = 2.5
"""How far a sample looks for neighbors, times its spacing."""
DENSE = 0.5
"""Distance of the places on a triangle, cube edges."""
ROOM, CUBES = 256, 1 << 15
"""Places on a triangle, and cubes of a call, for which there is room at first. Where it does not suffice, room is made.
"""


def keys_between(
    samples: Samples, lowest: Floats, cell: Floats, *, threads: int = 0, progress: Progress = silent
) -> NDArray[np.int64]:
    """List the cubes that the triangles between samples and their neighbors pass through.

    Parameters
    ----------
    samples : Samples
    lowest, cell : (3,) float arrays
        Lowest corner of cube (0, 0, 0), not over any sample, and the edges of the cubes.
    threads : int
    progress : callable

    Returns
    -------
    (c,) int64 array
        Their keys (see `tomomesh.model.cubes.keys_of`), rising.
    """
    index, rows = samples.index, samples.rows
    first = keys_of(np.zeros((1, 3), np.int64))
    steps = np.append(keys_of(np.eye(3, dtype=np.int64)) - first, first)
    seen = (*index.cells, SIGHT, lowest, cell, DENSE * float(cell.min()), steps)
    found: dict[int, NDArray[np.int64]] = {}

    def lay(start: int, stop: int) -> None:
        places, taken = np.empty((ROOM, 3)), np.full(CUBES, -1)
        while short := lay_stars(rows, *seen, places, taken, start, stop):
            taken = np.full(2 * len(taken) if short == 1 else len(taken), -1)
            places = np.empty((2 * len(places) if short == 2 else len(places), 3))
        found[start] = np.sort(taken[taken >= 0])

    count = len(rows)
    in_blocks(lay, count, block=BLOCK, threads=threads, done=lambda n: progress("bridges", n, count))
    return once_each(np.concatenate([found[start] for start in sorted(found)]))
