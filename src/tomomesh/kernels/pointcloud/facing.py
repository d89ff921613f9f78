"""Loops that find samples which face one another across what parts two sheets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .samples import MOST, gather

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]


@kernel("i8(f8[:,::1], b1[::1], i8[::1], i4[::1], f8[::1], f8, f8, i8[:,::1], i8, i8)")
def find_facing(
    samples: Floats,
    asked: NDArray[np.bool_],
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    reach: float,
    across: float,
    pairs: Integers,
    begin: int,
    end: int,
) -> int:
    """Find the pairs of samples between which the step runs along the normals of both.

    Parameters
    ----------
    samples : (p, 7) float array
        Position, unit normal, spacing; in the order of their cubes.
    asked : (p,) bool array
        Samples of which one at least is in each pair.
    blocks, start, frame : arrays
        See `tomomesh.kernels.pointcloud.samples`.
    reach : float
        Longest step.
    across : float
        Cosine of the angle between the step and either normal over which it runs along that.
    pairs : (k, 2) int64 array
        Result: numbers of both, the lower one first; some are left out where the array is too short.
    begin, end : int
        Samples to work on.

    Returns
    -------
    int
        Pairs that there are.
    """
    found, total = np.empty(MOST, np.int64), 0
    for p in range(begin, end):
        if not asked[p]:
            continue
        for n in range(gather(samples, blocks, start, frame, samples[p], reach, found)):
            q = found[n]
            if q == p or (q < p and asked[q]):
                continue
            x, y, z = samples[q, 0] - samples[p, 0], samples[q, 1] - samples[p, 1], samples[q, 2] - samples[p, 2]
            here = x * samples[p, 3] + y * samples[p, 4] + z * samples[p, 5]
            there = x * samples[q, 3] + y * samples[q, 4] + z * samples[q, 5]
            least = across * across * (x * x + y * y + z * z)
            if here * here > least and there * there > least:
                if total < len(pairs):
                    pairs[total, 0], pairs[total, 1] = min(p, q), max(p, q)
                total += 1
    return total
