"""A tree of boxes over triangles or points, and the nearest of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.measure.bvh import curve_keys, enclose_leaves, enclose_nodes, order_keys
from ..kernels.measure.triangles import nearest_simplices
from ..kernels.threads import in_blocks
from ..model.columns import for_kernels
from ..progress import Progress, silent

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]

LEAF = 4
"""Fewest simplices in a leaf, where there are so many; fewer than twice as many are the most. Only speed depends on it.
"""
SOME = 2_000
"""Simplices that tell the usual place and extent. Only speed depends on it."""
BLOCK = 20_000
"""Simplices handled at once, and five times the points: some milliseconds. No result depends on it."""


@dataclass(frozen=True)
class Tree:
    """Simplices in the order of a space-filling curve, and boxes around more and more of them.

    Attributes
    ----------
    vertices : (n, 3) float array
    simplices : (m, k) int32 array
        Vertices of each, in the order of the curve.
    order : (m,) int32 array
        The number that each had before.
    boxes : (4 P, 3) float array
        See `tomomesh.kernels.measure.bvh`.
    """

    vertices: Floats
    simplices: Ints
    order: Ints
    boxes: Floats

    @classmethod
    def of_faces(cls, mesh: TriMesh, *, threads: int = 0) -> Tree:
        """Build the tree of the faces of a mesh; one at least, and finite vertices."""
        return cls.over(mesh.vertices, mesh.faces.astype(np.int32), threads=threads)

    @classmethod
    def of_points(cls, points: Floats, *, threads: int = 0) -> Tree:
        """Build the tree of some points (n, 3); one at least, and finite ones."""
        return cls.over(points, np.arange(len(points), dtype=np.int32)[:, None], threads=threads)

    @classmethod
    def over(cls, vertices: Floats, simplices: Ints, *, threads: int = 0) -> Tree:
        """Build the tree of simplices (m, k) over vertices (n, 3)."""
        vertices, simplices = for_kernels(vertices, np.float64), for_kernels(simplices, np.int32)
        order = _along_curve(vertices, simplices, threads)
        simplices = simplices.take(order, axis=0)
        return cls(vertices, simplices, order, _boxes(vertices, simplices, threads))

    def moved(self, vertices: Floats, *, threads: int = 0) -> Tree:
        """Return the tree of the same simplices where their vertices have moved a little."""
        vertices = for_kernels(vertices, np.float64)
        return replace(self, vertices=vertices, boxes=_boxes(vertices, self.simplices, threads))

    def nodes_with(self, some: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Tell which nodes (2 P,) hold any of some simplices (m,)."""
        nodes = np.zeros(2 * self.leaves, np.bool_)
        first = np.arange(self.leaves) * len(self.order) // self.leaves
        nodes[self.leaves :] = np.logical_or.reduceat(some[self.order], first)
        level = self.leaves
        while level > 1:
            nodes[level // 2 : level] = nodes[level : 2 * level].reshape(-1, 2).any(axis=1)
            level //= 2
        return nodes

    @property
    def leaves(self) -> int:
        """Number of leaves, a power of two."""
        return len(self.boxes) // 4

    def nearest(
        self,
        points: Floats,
        *,
        order: Ints | None = None,
        enough: float = 0.0,
        threads: int = 0,
        progress: Progress = silent,
    ) -> tuple[Floats, Ints]:
        """Find the simplex that is nearest to each point.

        Parameters
        ----------
        points : (p, 3) float array
        order : (p,) int32 array, optional
            An order in which they are near each other, as that of a tree of them.
        enough : float
            Distance at which a nearer one is no longer sought.
        threads : int
            0 is one a core.
        progress : callable
            Told how many points are done; what it raises ends the work.

        Returns
        -------
        (p,) float array
            Exact distances, where they are larger than `enough`.
        (p,) int32 array
            Numbers of the simplices.
        """
        points = for_kernels(points, np.float64)
        distance, number = np.empty(len(points)), np.empty(len(points), np.int32)
        if len(points) == 0:
            return distance, number
        if order is None:
            order = _along_curve(points, np.arange(len(points), dtype=np.int32)[:, None], threads)
        along, squared, nearest = points.take(order, axis=0), distance.copy(), number.copy()
        in_blocks(
            lambda start, stop: nearest_simplices(
                along, self.vertices, self.simplices, self.boxes, enough * enough, squared, nearest, start, stop
            ),
            len(points),
            block=BLOCK // 5,
            threads=threads,
            done=lambda count: progress("distances", count, len(points)),
        )
        distance[order], number[order] = np.sqrt(squared), self.order[nearest]
        return distance, number


def _boxes(vertices: Floats, simplices: Ints, threads: int) -> Floats:
    """Return the boxes around the nodes over simplices in the order of the curve."""
    leaves = 1 << max(len(simplices) // LEAF, 1).bit_length() - 1
    boxes = np.empty((4 * leaves, 3))
    in_blocks(
        lambda start, stop: enclose_leaves(vertices, simplices, boxes, start, stop),
        leaves,
        block=BLOCK // LEAF,
        threads=threads,
    )
    enclose_nodes(boxes)
    return boxes


def _along_curve(vertices: Floats, simplices: Ints, threads: int) -> Ints:
    """Order simplices along a space-filling curve, the large ones after all others."""
    some = vertices[simplices[:: max(len(simplices) // SOME, 1)]]
    # all but the farthest 1 % on each side, and a span more around: places far off do not coarsen the curve
    low, high = np.percentile(some.mean(axis=1), [1, 99], axis=0)
    span = max(float((high - low).max()), 1e-300)
    usual = max(float(np.median(np.ptp(some, axis=1).max(axis=1))), 1e-9 * span)
    low, side = low - span, 3 * span
    keys = np.empty((2, len(simplices)), np.int64)
    in_blocks(
        lambda start, stop: curve_keys(vertices, simplices, low, side, usual, keys[0], start, stop),
        len(simplices),
        block=BLOCK,
        threads=threads,
    )
    return sort_keys(keys)


def sort_keys(keys: NDArray[np.int64]) -> Ints:
    """Sort the first row of keys (2, m), where the second is room to work in, and return their order, (m,)."""
    order = np.empty(keys.shape, np.int32)
    order_keys(keys, order)
    return np.array(order[0])  # without the room
