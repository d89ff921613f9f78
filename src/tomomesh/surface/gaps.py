"""Where a cloud that does not close is open: the rim of its widest gap."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .samples import Samples

WIDE = 6
"""Sectors side by side, of 16, that are empty around a point on a rim: more than a third of a turn."""
LINK = 3.0
"""Distance, in spacings, within which points belong to one rim."""


def widest_gap(samples: Samples, sectors: NDArray[np.int64]) -> tuple[float, NDArray[np.float64]] | None:
    """Find the rim that reaches farthest.

    Parameters
    ----------
    samples : Samples
    sectors : (p,) int64 array
        In which of 16 directions each sample has neighbors, one bit each.

    Returns
    -------
    size : float
        Diagonal of the box around the rim.
    place : (3,) float array
        Its middle. None where no point lies on a rim.
    """
    empty = np.zeros(len(sectors), bool)
    for first in range(16):
        bits = sum(1 << (first + n) % 16 for n in range(WIDE))
        empty |= (sectors & bits) == 0
    rim = samples.positions[empty]
    if len(rim) == 0:
        return None
    pairs = cKDTree(rim).query_pairs(LINK * float(np.median(samples.spacing)), output_type="ndarray")
    links = sparse.coo_array((np.ones(len(pairs), bool), pairs.T), shape=(len(rim), len(rim)))
    count, label = connected_components(links, directed=False)
    boxes = [(rim[label == n].min(axis=0), rim[label == n].max(axis=0)) for n in range(count)]
    low, high = max(boxes, key=lambda box: float(np.linalg.norm(box[1] - box[0])))
    return float(np.linalg.norm(high - low)), 0.5 * (low + high)
