"""Averages over lists of members: the squares around a vertex, the corners of a square, a vertex' neighbors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels.isosurface.surface_nets import mean_of
from ..kernels.threads import in_blocks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

BLOCK = 40_000
"""Vertices or squares handled in one call: far below 100 ms."""


def means(values: Floats, members: NDArray[np.int32], threads: int) -> Floats:
    """Average rows (n, 3) of an array over lists of them (m, s): (m, 3)."""
    found = np.empty((len(members), 3))

    in_blocks(
        lambda start, stop: mean_of(values, members, found, start, stop), len(members), block=BLOCK, threads=threads
    )  # fmt: skip
    return found
