"""How long edges should be: shorter where the surface bends, longer where it is flat."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels.remeshing.surface import find_bends, grade_sizes, mix_normals, vertex_normals

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

SAG = 0.015
"""How far the middle of a face may lie from the surface, in edges, where the surface bends."""
SHORTEST, LONGEST = 0.7, 1.2
"""Limits of a length, in edges: a factor of two between the finest faces and the coarsest."""
SLOPE = 0.5
"""How fast lengths grow along the surface. Dunyach et al. (2013) let them grow as fast as the distance."""
ROUNDS = 2
"""Rounds in which normals are mixed with their neighbors' before the surface's bend is taken from them, so that
steps of one voxel count for little."""


def wanted_sizes(vertices: Floats, faces: NDArray[np.int32], normals: Floats, areas: Floats, edge: float) -> Floats:
    """Return the length that edges should have at each vertex, (n,).

    An edge of length L on a surface of curvature k leaves the middle of its face k L^2 / 6 off the surface (Dunyach
    et al. 2013).

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int32 array
    normals, areas : (m, 3), (m,) float arrays
        Of the faces.
    edge : float
        Where the surface is as usual.
    """
    mean, mixed = np.empty_like(vertices), np.empty_like(vertices)
    vertex_normals(faces, normals, areas, mean)
    for _ in range(ROUNDS):
        mix_normals(faces, mean, mixed)
        mean, mixed = mixed, mean
    bends = np.empty(len(mean))
    find_bends(vertices, faces, mean, bends)
    flat = 6 * SAG * edge / (LONGEST * edge) ** 2
    sizes = np.maximum(np.sqrt(6 * SAG * edge / np.maximum(bends, flat)), SHORTEST * edge)
    grade_sizes(vertices, faces, sizes, SLOPE)
    return sizes
