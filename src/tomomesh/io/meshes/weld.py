"""Equal positions, found exactly."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def weld(positions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return each position once, and where every one of the old ones went.

    Parameters
    ----------
    positions : (n, 3) float array
        Finite.

    Returns
    -------
    unique : (u, 3) float array
        In the order of their first appearance.
    numbers : (n,) int64 array
        ``unique[numbers]`` equals `positions`.
    """
    positions = positions + 0.0  # -0.0 is 0.0
    order = np.lexsort(positions.T)
    new = np.ones(len(order), bool)
    new[1:] = (np.diff(positions[order], axis=0) != 0).any(axis=1)
    groups = np.empty(len(order), np.int64)
    groups[order] = np.cumsum(new) - 1
    first = order[new]  # lexsort is stable: the first of each group
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return positions[np.sort(first)], rank[groups]
