"""Low-pass filter (the paper's Fig. 8c)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

if TYPE_CHECKING:
    from numpy.typing import NDArray

OWN_WEIGHT = 0.5
"""Weight of a vertex' own position; its neighbors share the rest."""


def adjacency(edges: NDArray[np.int64], count: int) -> sparse.csr_array[np.float64]:
    """Return the symmetric (n, n) matrix with a 1 for every edge, its columns in rising order."""
    ends = np.concatenate([edges, edges[:, ::-1]])
    matrix = sparse.coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count)).tocsr()
    matrix.sort_indices()
    return matrix


def low_pass(vertices: NDArray[np.float64], edges: NDArray[np.int64], passes: int) -> NDArray[np.float64]:
    """Move each vertex to a weighted mean of itself and its neighbors, several times.

    Parameters
    ----------
    vertices : (n, 3) float array
    edges : (e, 2) int array
        Each edge once; every vertex has one at least.
    passes : int

    Returns
    -------
    (n, 3) float array
        Never outside the convex hull of `vertices`.
    """
    origin = vertices.min(axis=0)
    neighbors = adjacency(edges, len(vertices))
    share = (1 - OWN_WEIGHT) / np.diff(neighbors.indptr)[:, None]
    local = vertices - origin
    for _ in range(passes):
        local = OWN_WEIGHT * local + share * (neighbors @ local)
    return np.asarray(origin + local)
