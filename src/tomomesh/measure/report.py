"""The quality of a mesh, and how far it is from points or from another mesh."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from ..model.points import PointSet
from .distance import distance_to_surface, spread_of
from .shape import triangle_shapes
from .topology import distinct_positions, topology, welded

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

SAMPLES = 20_000
"""Samples a surface for its distance to another."""


def assess(
    mesh: TriMesh,
    *,
    points: PointSet | NDArray[np.float64] | None = None,
    against: TriMesh | None = None,
    cavities: int = 0,
) -> dict[str, Any]:
    """Measure a mesh.

    Parameters
    ----------
    mesh : TriMesh
        One face at least.
    points : PointSet or (p, 3) float array, optional
        The points that the surface should pass through.
    against : TriMesh, optional
        A surface that it should equal.
    cavities : int
        Components that may face inward.

    Returns
    -------
    dict
        Counts, areas, volumes, triangle shapes and distances; each key names its unit (see docs/report.md).
    """
    counts = topology(mesh, cavities=cavities)
    apart = distinct_positions(mesh, np.float32) == len(mesh.vertices)
    again = counts if apart else topology(welded(mesh), cavities=cavities)
    found: dict[str, Any] = {"vertices": len(mesh.vertices), "faces": len(mesh.faces), **asdict(counts)}
    found |= {"closed": counts.boundary_edges == 0, "sound": counts.sound, "sound_after_welding": again.sound}
    found["area_mm2"] = float(mesh.face_areas.sum())
    found["volume_mm3"] = float(mesh.face_volumes.sum())
    found |= triangle_shapes(mesh)
    if points is not None:
        points = points.positions if isinstance(points, PointSet) else points
        found |= spread_of(distance_to_surface(points, mesh), "points_to_surface_")
        found |= spread_of(np.asarray(cKDTree(points).query(mesh.vertices)[0]), "vertices_to_points_")
    if against is not None:
        found |= compare(mesh, against)
    return found


def compare(mesh: TriMesh, other: TriMesh, *, leave_out: NDArray[np.bool_] | None = None) -> dict[str, float]:
    """Measure the distances between two surfaces, both ways.

    Parameters
    ----------
    mesh, other : TriMesh
    leave_out : (m,) bool array, optional
        Faces of `mesh` that are not sampled.

    Returns
    -------
    dict
        Mean, 95th percentile and maximum from `mesh` to `other`, and, prefixed with ``back_``, from `other`.
    """
    there = distance_to_surface(area_samples(mesh, leave_out=leave_out), other)
    back = distance_to_surface(area_samples(other), mesh)
    return spread_of(there, "") | spread_of(back, "back_")


def area_samples(
    mesh: TriMesh, count: int = SAMPLES, *, leave_out: NDArray[np.bool_] | None = None
) -> NDArray[np.float64]:
    """Draw points uniformly by area from a mesh, (count, 3); the same points every time."""
    areas = mesh.face_areas if leave_out is None else np.where(leave_out, 0.0, mesh.face_areas)
    rng = np.random.default_rng(0)
    reached = np.cumsum(areas)
    if len(areas) == 0 or reached[-1] == 0:
        return np.empty((0, 3))
    face = np.searchsorted(reached, rng.random(count) * reached[-1], side="right").clip(0, len(areas) - 1)
    u, v = rng.random((2, count, 1))
    over = u + v > 1
    u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
    a, b, c = (mesh.corners[face, n] for n in range(3))
    return np.asarray(a + u * (b - a) + v * (c - a))
