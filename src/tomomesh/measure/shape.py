"""Shapes of triangles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..model.mesh import TriMesh


def triangle_shapes(mesh: TriMesh) -> dict[str, float]:
    """Return edge lengths, smallest angles and aspect of the faces of a mesh.

    The aspect of a triangle is 4 sqrt(3) area over the sum of its squared sides: 1 where it is equilateral, 0
    where it is flat (Bank & Smith 1997).
    """
    sides = mesh.corners - np.roll(mesh.corners, -1, axis=1)
    squared = (sides**2).sum(axis=2)
    a, b, c = np.sort(np.sqrt(squared), axis=1).T
    cosine = (b**2 + c**2 - a**2) / np.maximum(2 * b * c, 1e-300)
    angles = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    aspect = 4 * np.sqrt(3) * mesh.face_areas / np.maximum(squared.sum(axis=1), 1e-300)
    return {
        "shortest_edge_mm": float(a.min()),
        "median_edge_mm": float(np.median(np.sqrt(squared))),
        "longest_edge_mm": float(c.max()),
        "smallest_angle_deg": float(angles.min()),
        "mean_smallest_angle_deg": float(angles.mean()),
        "mean_aspect": float(aspect.mean()),
    }
