"""Low-pass filter (the paper's Fig. 8c), over the neighbors of each vertex."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..kernels.dynamics.quads import quad_normals
from ..kernels.dynamics.springs import average, list_neighbors
from ..kernels.threads import in_blocks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

OWN_WEIGHT = 0.5
"""Weight of a vertex' own position; its neighbors share the rest. The paper leaves the weights open; with less than
half, a pass turns ripples from vertex to vertex over instead of damping them."""
BLOCK = 4_096
"""Vertices worked on in one call: below 50 ms, and even shares for several threads."""


@dataclass(frozen=True)
class OneRing:
    """The neighbors of each vertex of a mesh.

    Attributes
    ----------
    start : (n + 1,) int64 array
        The neighbors of vertex i are ``neighbors[start[i]:start[i + 1]]``, one at least.
    neighbors : (k,) int32 array
    quads : (q, 4) int32 array
        The squares of the mesh; none where it has triangles.
    threads : int
    """

    start: NDArray[np.int64]
    neighbors: NDArray[np.int32]
    quads: NDArray[np.int32]
    threads: int = 0

    @classmethod
    def of_quads(cls, quads: NDArray[np.int32], count: int, threads: int = 0) -> OneRing:
        """Take the neighbors along the sides of squares (q, 4) that make a closed 2-manifold over `count` vertices."""
        start = np.concatenate([[0], np.cumsum(np.bincount(quads.ravel(), minlength=count))])
        neighbors = np.empty(quads.size, np.int32)
        list_neighbors(quads, start, neighbors)
        return cls(start, neighbors, quads, threads)

    @classmethod
    def of_edges(cls, edges: NDArray[np.int64], count: int, threads: int = 0) -> OneRing:
        """Take the neighbors along edges (e, 2), each named once."""
        pairs = np.concatenate([edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]])
        pairs.sort()
        start = np.searchsorted(pairs, np.arange(count + 1) * count)
        return cls(start, (pairs % count).astype(np.int32), np.empty((0, 4), np.int32), threads)

    def smoothed(self, vertices: Floats, passes: int) -> Floats:
        """Move each vertex to a weighted mean of itself and its neighbors, several times.

        Parameters
        ----------
        vertices : (n, 3) float array
        passes : int

        Returns
        -------
        (n, 3) float array
            Never outside the convex hull of `vertices`.
        """
        origin = vertices.min(axis=0)
        local = vertices - origin
        for _ in range(passes):
            before, local = local, np.empty_like(local)
            self._pass(before, local)
        return np.asarray(origin + local)

    def _pass(self, before: Floats, after: Floats) -> None:
        def work(begin: int, end: int) -> None:
            average(before, self.start, self.neighbors, OWN_WEIGHT, after, begin, end)

        in_blocks(work, len(before), block=BLOCK, threads=self.threads)

    def normals(self, vertices: Floats) -> Floats:
        """Return unit normals at the vertices of squares, (n, 3)."""
        normals = np.empty_like(vertices)
        quad_normals(vertices, self.quads, normals)
        return normals


def adjacency(edges: NDArray[np.int64], count: int) -> scipy.sparse.csr_array[np.float64]:
    """Return the symmetric (n, n) matrix with a 1 for every edge, its columns in rising order."""
    ends = np.concatenate([edges, edges[:, ::-1]])
    matrix = scipy.sparse.coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count)).tocsr()
    matrix.sort_indices()
    return matrix


def low_pass(vertices: Floats, edges: NDArray[np.int64], passes: int) -> Floats:
    """Smooth vertices (n, 3) along edges (e, 2), each named once; see `OneRing.smoothed`."""
    return OneRing.of_edges(edges, len(vertices)).smoothed(vertices, passes)
