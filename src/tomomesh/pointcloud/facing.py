"""Samples that face one another: of two sheets that lie near each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels.pointcloud.facing import find_facing
from ..kernels.threads import in_blocks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .samples import Samples

ACROSS = 0.9
"""Cosine from which the step between two samples is along the normals of both. With .8 the skull of docs/clouds.md has
15 pairs within 2 sampling distances and the rocker-arm 1, which have none with this."""
BLOCK = 4_096
"""Samples worked on in one call. No result depends on it."""
ROOM = 64
"""Pairs for which there is room at first. Where it does not suffice, room is made."""


def facing_pairs(
    samples: Samples, reach: float, asked: NDArray[np.bool_] | None = None, *, threads: int = 0
) -> NDArray[np.int64]:
    """Return the pairs (k, 2) of samples within reach that face one another.

    Parameters
    ----------
    samples : Samples
    reach : float
        Longest step between two.
    asked : (p,) bool array, optional
        Samples of which one at least is to be in each pair; all where not given.
    threads : int

    Returns
    -------
    (k, 2) int64 array
        Numbers of the samples, in the order of their cubes.
    """
    index, rows, count = samples.index, samples.rows, len(samples.positions)
    around = np.ones(count, np.bool_) if asked is None else asked[index.order]
    found: dict[int, NDArray[np.int64]] = {}

    def look(start: int, stop: int) -> None:
        pairs, room = np.empty((ROOM, 2), np.int64), 0
        while (room := find_facing(rows, around, *index.cells, reach, ACROSS, pairs, start, stop)) > len(pairs):
            pairs = np.empty((room, 2), np.int64)
        found[start] = pairs[:room]

    in_blocks(look, count, block=BLOCK, threads=threads)
    return np.asarray(index.order[np.concatenate([found[start] for start in sorted(found)])])
