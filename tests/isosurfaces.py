"""Gray levels of balls, and the surface that marching cubes have of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from skimage.measure import marching_cubes

from tomomesh.model.mesh import TriMesh
from tomomesh.model.volume import Grid, Volume

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def volume_of(levels: NDArray[Any], affine: Floats | None = None) -> Volume:
    """Take levels as they are, whatever the handedness of the affine."""
    affine = np.eye(4) if affine is None else affine
    return Volume(levels, affine, Grid((0, 1, 2), (False, False, False), affine))


def ball(steps: int, spacing: tuple[float, float, float] = (1.0, 1.0, 1.0), *, kind: str = "gray") -> Volume:
    """Sample a ball of radius 1 about the origin, so many steps of the finest spacing to its radius."""
    edges = np.array(spacing) / steps
    sides = [np.arange(-np.ceil(1.3 / e), np.ceil(1.3 / e) + 1) * e for e in edges]
    z, y, x = np.meshgrid(*(sides[n] + 0.31 * edges[n] for n in (2, 1, 0)), indexing="ij")
    affine = np.diag([*edges, 1.0])
    affine[:3, 3] = [sides[n][0] + 0.31 * edges[n] for n in range(3)]
    height = 1 - np.sqrt(x**2 + y**2 + z**2)
    return volume_of(height if kind == "gray" else np.where(height > 0, 1.0, -1.0), affine)


def mean_turn(mesh: TriMesh) -> float:
    """Return the mean angle between the normals of neighboring faces, in degrees."""
    _, edge = np.unique(np.sort(mesh.half_edges, axis=1), axis=0, return_inverse=True)
    first, second = (np.argsort(edge.ravel(), kind="stable") // 3).reshape(-1, 2).T
    normals = mesh.face_vectors / np.maximum(2 * mesh.face_areas, 1e-300)[:, None]
    cosine = (normals[first] * normals[second]).sum(axis=1)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())


def cubes_marched(volume: Volume, lower: float) -> TriMesh:
    """Return scikit-image's surface of the padded levels, which on the border lies half way to the padding."""
    padded = np.pad(volume.voxels.astype(np.float64), 1, mode="edge")
    inner = np.zeros(padded.shape, bool)
    inner[1:-1, 1:-1, 1:-1] = True
    padded = np.where(inner | (padded <= lower), padded, 2 * lower - padded)
    places, faces, _, _ = marching_cubes(padded.astype(np.float32), lower)
    return TriMesh(volume.to_mm(places[:, ::-1].astype(np.float64) - 1), faces.astype(np.int64))
