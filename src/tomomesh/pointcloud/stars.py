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
from ..model.columns import cells_at
from ..model.cubes import cells_of, keys_of
from ..progress import Progress, silent
from .search import Index

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
ROOM = 128
"""Places a sample for which there is room at first. Where it does not suffice, room is made."""


def cells_between(
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
    (c, 3) int64 array
        Each once, in the order of their keys.
    """
    index = Index.of(samples.positions, SIGHT * float(np.median(samples.spacing)))
    rows = np.column_stack([samples.positions, samples.normals, samples.spacing])[index.order]
    found: dict[int, NDArray[np.int64]] = {}

    def lay(start: int, stop: int) -> None:
        places, room = np.empty((ROOM * (stop - start), 3)), 0
        while (room := lay_stars(rows, *index.cells, SIGHT, DENSE * cell.min(), places, start, stop)) > len(places):
            places = np.empty((room, 3))
        found[start] = once_each(keys_of(cells_at(places[:room], lowest, cell)))

    count = len(rows)
    in_blocks(lay, count, block=BLOCK, threads=threads, done=lambda n: progress("bridges", n, count))
    return cells_of(once_each(np.concatenate([found[start] for start in sorted(found)])))
