"""Span the holes of a sampled surface, along the surface only."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels.pointcloud.bridges import bridge, full_sectors
from ..kernels.threads import in_blocks
from ..progress import Progress, silent

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .samples import Samples

    Floats = NDArray[np.float64]

BLOCK = 4_096
"""Points worked on in one call. No result depends on it."""
SIGHT = 2.5
"""How far a point looks for neighbors around it, times its spacing. Chosen: half of it changes the distance by -1.6 %,
twice by +5.3 %."""
SPAN = 5.0
"""Longest bridge, times the spacing: points thrown at random leave holes as wide, once in 10 million. Chosen: half and
twice of it change no case of benchmarks/constants.py."""
ROOM = 8
"""Places a sample for which there is room at first. Where it does not suffice, room is made."""
DENSE = 0.5
"""Distance of the places on a bridge, cube edges. Chosen: half of it changes the distance by -0.3 %, twice by
+0.5 %."""


def bridges(
    samples: Samples, edge: float, *, span: float = SPAN, threads: int = 0, progress: Progress = silent
) -> Floats:
    """Lay places on straight lines across the holes between samples.

    A line joins two samples that have no neighbors in its direction, and lies flat on the surface at both. So
    nothing is spanned beyond the rim of a sheet, nor between two sheets, which a dilation would join.

    Parameters
    ----------
    samples : Samples
    edge : float
        Edge of the cubes that the places must fill without a gap.
    span : float
        Longest bridge, times the spacing.
    threads : int
    progress : callable

    Returns
    -------
    (b, 3) float array
        The places, on straight lines from rim to rim.
    """
    index, rows = samples.index, samples.rows
    cells, count = index.cells, len(rows)
    sectors = np.empty(count, np.int64)
    found: dict[int, NDArray[np.float64]] = {}

    def look(start: int, stop: int) -> None:
        full_sectors(rows, *cells, SIGHT, sectors, start, stop)

    def lay(start: int, stop: int) -> None:
        places, room = np.empty((ROOM * (stop - start), 3)), 0
        while (room := bridge(rows, *cells, sectors, span, DENSE * edge, places, start, stop)) > len(places):
            places = np.empty((room, 3))
        found[start] = places[:room].copy()

    in_blocks(look, count, block=BLOCK, threads=threads, done=lambda n: progress("bridges", n, 2 * count))
    in_blocks(lay, count, block=BLOCK, threads=threads, done=lambda n: progress("bridges", count + n, 2 * count))
    return np.concatenate([np.empty((0, 3)), *(found[start] for start in sorted(found))])
