"""Loops over squares: normals at their corners, and their parting into triangles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@kernel("void(f8[:,::1], i4[:,::1], f8[:,::1])")
def quad_normals(vertices: Floats, quads: NDArray[np.int32], normals: Floats) -> None:
    """Find unit normals (n, 3) at the vertices: the sum of the vector areas of the squares around each."""
    normals[:] = 0.0
    for q in range(len(quads)):
        a, b, c, d = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        for axis in range(3):
            one, two = (axis + 1) % 3, (axis + 2) % 3
            area = (vertices[c, one] - vertices[a, one]) * (vertices[d, two] - vertices[b, two])
            area -= (vertices[c, two] - vertices[a, two]) * (vertices[d, one] - vertices[b, one])
            for corner in range(4):
                normals[quads[q, corner], axis] += area
    for v in range(len(normals)):
        length = np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2)
        for axis in range(3):
            normals[v, axis] /= max(length, 1e-300)


@kernel("void(f8[:,::1], f8[:,::1], i4[:,::1], f8, f8[:,::1], i4[:,::1], f8[:,::1])")
def split_quads(
    vertices: Floats,
    normals: Floats,
    quads: NDArray[np.int32],
    share: float,
    rise: Floats,
    faces: NDArray[np.int32],
    raised: Floats,
) -> None:
    """Split squares by the diagonals nearer to the surface, and raise their corners by a share of the sagitta.

    A chord d between places with normals m and n lies (n - m) d / 8 below the middle of the arc.

    Parameters
    ----------
    vertices, normals : (n, 3) float arrays
    quads : (q, 4) int32 array
    share : float
    rise : (n, 2) float array
        Zeros; room for sum and number of the sagittas at each vertex.
    faces : (2q, 3) int32 array
        Result.
    raised : (n, 3) float array
        Result: where the vertices then are.
    """
    sagitta = np.empty(2)
    for q in range(len(quads)):
        for one in range(2):
            a, c = quads[q, one], quads[q, one + 2]
            sagitta[one] = 0.0
            for axis in range(3):
                sagitta[one] += (normals[c, axis] - normals[a, axis]) * (vertices[c, axis] - vertices[a, axis]) / 8
        turn = int(abs(sagitta[1]) < abs(sagitta[0]))
        for corner in range(4):
            rise[quads[q, corner], 0] += 0.5 * (sagitta[0] + sagitta[1])
            rise[quads[q, corner], 1] += 1.0
        for half in range(2):
            faces[2 * q + half, 0] = quads[q, turn]
            faces[2 * q + half, 1] = quads[q, (turn + half + 1) % 4]
            faces[2 * q + half, 2] = quads[q, (turn + half + 2) % 4]
    for v in range(len(vertices)):
        for axis in range(3):
            raised[v, axis] = vertices[v, axis] + share * rise[v, 0] / max(rise[v, 1], 1.0) * normals[v, axis]
