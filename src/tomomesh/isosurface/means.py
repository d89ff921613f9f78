"""Averages over lists of members: the squares around a vertex, the corners of a square, a vertex' neighbors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels.isosurface.surface_nets import mean_of, mean_of_numbers
from ..kernels.threads import in_blocks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

BLOCK = 40_000
"""Vertices or squares handled in one call: far below 100 ms."""


def means(values: Floats, members: NDArray[np.int32], threads: int) -> Floats:
    """Average numbers (n,) or rows (n, 3) over lists of them (m, s): (m,) or (m, 3)."""
    found, mean = np.empty((len(members), *values.shape[1:])), mean_of if values.ndim > 1 else mean_of_numbers
    in_blocks(
        lambda start, stop: mean(values, members, found, start, stop), len(members), block=BLOCK, threads=threads
    )  # fmt: skip
    return found
