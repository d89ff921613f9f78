"""What the stages hand back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from .model.columns import any_of
from .model.cubes import CubeGrid
from .model.lattice import Lattice
from .model.networks import Networks
from .model.points import CAP
from .model.trace import Trace

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from .isosurface.voxels import Boundary
    from .model.contours import Contours
    from .model.mesh import QuadMesh, TriMesh
    from .model.networks import SpaceNetwork
    from .model.points import PointSet
    from .model.volume import Volume
    from .printing.part import Part
    from .segmentation.sample import Sampling

NOTHING = np.empty(0)
NO_NETWORKS = Networks(
    Lattice("none", np.empty((0, 2), np.int64), np.empty((0, 0), np.int32), (0,)),
    NOTHING.astype(np.int32),
    np.empty((0, 0, 2)),
    np.empty((0, 0), np.bool_),
    outlined=False,
    pixels=NOTHING.astype(np.int64),
    strays=NOTHING.astype(np.int64),
)
NO_CUBES = CubeGrid(NOTHING.astype(np.int64), np.zeros(3), np.ones(3), NOTHING.astype(np.int64), np.zeros(1, np.int64))
NO_TRACE = Trace(
    NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, NOTHING.astype(np.int64), NOTHING.astype(np.int64), converged=False
)
"""What stands for stages that were not run."""


@dataclass(frozen=True)
class SpaceFound:
    """One network in space, and what it was trained on.

    Attributes
    ----------
    network : SpaceNetwork
    places : (n, 3) float array
        The window's boundary or its voxels in patient millimeters, all of them.
    """

    network: SpaceNetwork
    places: NDArray[np.float64]


@dataclass(frozen=True)
class Segmentation:
    """A study after stage one.

    Attributes
    ----------
    volume : Volume
        The study, its slices along K.
    mask : (K, J, I) bool array
        The window.
    networks : Networks
    labels : (K, J, I) uint16 array
        Every window pixel's winner: 0 background, neuron + 1 within its slice.
    points : PointSet
        The neurons, bridged gaps and caps in patient millimeters.
    sampling : Sampling
    told : callable
        Returns the report.
    boundary : Boundary or None
        The window's own boundary, where it takes the place of networks.
    contours : Contours or None
        Several networks a slice, where they take the place of one.
    space : SpaceFound or None
        One network in space, where it takes the place of those of the slices.
    """

    volume: Volume
    mask: NDArray[np.bool_]
    networks: Networks
    labels: NDArray[np.uint16]
    points: PointSet
    sampling: Sampling
    told: Callable[[], dict[str, Any]]
    boundary: Boundary | None = None
    contours: Contours | None = None
    space: SpaceFound | None = None

    @cached_property
    def report(self) -> dict[str, Any]:
        """What the stages found, key by key in docs/report.md."""
        return self.told()


@dataclass(frozen=True)
class Surface:
    """A cloud after stages two and three; every stage is kept.

    Attributes
    ----------
    points : PointSet
    cubes : CubeGrid
    cuberille : QuadMesh
    smoothed, mesh : TriMesh
        The surface before and after the fit, with the same faces unless `mesh` was decimated.
    nearest : (n,) int32 array
        The point that draws each vertex of `mesh`, -1 where there is none; empty for clouds and decimated meshes.
    trace : Trace
    told : callable
        Returns the report.
    segmentation : Segmentation or None
        Stage one, where the points came from a study.
    filled : (m,) bool array or None
        Faces of `mesh` that lie where a cloud has no points: filled, not measured.
    part : Part or None
        What is written in place of `mesh`, where printing was asked for.
    """

    points: PointSet
    cubes: CubeGrid
    cuberille: QuadMesh
    smoothed: TriMesh
    mesh: TriMesh
    nearest: NDArray[np.int32]
    trace: Trace
    told: Callable[[], dict[str, Any]]
    segmentation: Segmentation | None = None
    filled: NDArray[np.bool_] | None = None
    part: Part | None = None

    @cached_property
    def report(self) -> dict[str, Any]:
        """What the stages found and how good the mesh is, key by key in docs/report.md; measured on first use."""
        return self.told()

    @property
    def cap_faces(self) -> NDArray[np.bool_]:
        """Faces (m,) with a corner that is nearest to a cap: filled, not measured."""
        _, nearest = cKDTree(self.points.positions).query(self.mesh.vertices)
        on_cap = self.points.kinds[nearest] == CAP
        return any_of(on_cap[self.mesh.faces])
