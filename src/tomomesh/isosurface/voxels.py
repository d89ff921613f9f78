"""The window's boundary itself as a surface, without networks: gray levels interpolated at the window's bounds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.cuberille.cells import label_components
from ..model.boxes import box_of
from ..model.mesh import QuadMesh
from ..model.points import PointSet
from ..progress import Progress, silent
from .crossings import LevelCrossings, Levels, crossings
from .diagonals import of_triangles, placed, right_handed, triangulated
from .run_mask import RunMask
from .runs import Runs
from .settle import NetFit, settle
from .surface_nets import Net, net_around
from .thick_slices import thinned
from .thin import thin_squares
from .well_composed import surface_cells, without_contacts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.boxes import Box
    from ..model.mesh import TriMesh
    from ..model.volume import Volume
    from ..settings import FitSettings


@dataclass(frozen=True)
class Boundary:
    """The faces between the voxels of a window and those outside, and where the gray levels cross its bounds.

    Attributes
    ----------
    affine : (4, 4) float array
        Indices of the voxels that it lies between to patient millimeters.
    net : Net
    crossings : LevelCrossings
        One a face.
    added : int
        Voxels added so that no two touch along an edge or at a corner alone.
    parts : int
        Into how many each voxel of a thick slice was divided; 1 for none.
    """

    affine: NDArray[np.float64]
    net: Net
    crossings: LevelCrossings
    added: int
    parts: int = 1

    @cached_property
    def points(self) -> PointSet:
        """The crossings in patient millimeters."""
        none = np.full(len(self.net.quads), -1, np.int32)
        return PointSet(placed(self.crossings.positions, self.affine), none, none, self.crossings.kinds)

    @cached_property
    def cuberille(self) -> QuadMesh:
        """The faces themselves."""
        net = self.net
        outward = slice(None, None, 1 if right_handed(self.affine) else -1)
        corners = placed(net.low + np.float64(0.5), self.affine)
        return QuadMesh(corners, net.quads[:, outward].astype(np.int64))

    @cached_property
    def volumes(self) -> NDArray[np.int64]:
        """Signed volume of every surface in voxels, exactly: the sum of x over its faces across x; (s,)."""
        label = np.full(len(self.net.links), -1, np.int32)
        count = label_components(self.net.links, np.ones(len(label), np.bool_), label)
        across = np.flatnonzero(self.net.directions < 2)
        upward = self.net.directions[across] == 1
        height = np.where(upward, self.net.inner[across, 0] + 1, -self.net.inner[across, 0])
        owner = label[self.net.quads[across, 0]]
        return np.bincount(owner, height, count).astype(np.int64)

    @property
    def cavities(self) -> int:
        """Linings of cavities among the surfaces."""
        return int((self.volumes < 0).sum())


def boundary(
    volume: Volume,
    mask: NDArray[np.bool_],
    *,
    lower: float | NDArray[np.float64] = -np.inf,
    upper: float | NDArray[np.float64] = np.inf,
    layers: str = "all",
    surface: str = "all",
    divide: bool = False,
    around: Box | None = None,
    threads: int = 0,
) -> Boundary:
    """Find the boundary of a window, and where the gray levels cross its bounds.

    Parameters
    ----------
    volume : Volume
    mask : (K, J, I) bool array
        The voxels with lower < k <= upper, one at least. What surrounds the volume is background.
    lower, upper : float or (L,) float array
    layers : {"all", "any"}
        Whether a voxel is kept where all its layers lie in their windows, or one at least.
    surface : {"all", "outer"}
        All surfaces, or those that nothing surrounds.
    divide : bool
        Whether voxels of thick slices are divided first.
    around : box, optional
        Outside of which no voxel is kept.
    threads : int

    Returns
    -------
    Boundary
        A closed 2-manifold.

    Raises
    ------
    ResourceError
        Where the boundary would not fit into the memory.
    """
    levels, affine = Levels(volume.voxels, lower, upper, layers), volume.affine
    thin = thinned(levels, mask, affine, threads) if divide else None
    if thin is not None:
        levels, mask, affine, around = thin.levels, thin.mask, thin.affine, None
    held, low = _framed(mask, around)
    cells = surface_cells(held, threads)
    joined = without_contacts(held, lambda voxels: levels.excess(voxels + low), threads, cells)
    whole = _filled(joined) if surface == "outer" else joined
    net = net_around(whole, threads, low, cells if whole is held else None)
    x, y, z = net.inner.T
    found = crossings(levels, net.inner, net.steps, ~mask[z, y, x], thin, threads)
    if found.stepped:  # gray levels say themselves where their border is
        found = replace(found, thin=thin_squares(joined, net.inner - low, net.steps, threads))
    added = int(np.count_nonzero(joined) - np.count_nonzero(held))
    return Boundary(affine, net, found, added, 1 if thin is None else thin.parts)


def _framed(mask: NDArray[np.bool_], around: Box | None) -> tuple[NDArray[np.bool_], NDArray[np.int32]]:
    """Return the box of a mask with one layer of background around it, and its lowest voxel (x, y, z)."""
    box = box_of(mask, around)
    return np.pad(mask[box], 1), np.array([side.start - 1 for side in box[::-1]], np.int32)


def _filled(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Fill what the outside does not reach; a mask without contacts stays without them."""
    holes, filled = Runs.of(~RunMask.of([mask])), mask.copy()
    holes.fill(filled, ~holes.bordering, True)
    return filled


@dataclass(frozen=True)
class VoxelSurface:
    """A net after the fit in patient millimeters.

    Attributes
    ----------
    smoothed, mesh : TriMesh
        The surface before and after the fit, with the same faces.
    nearest : (n,) int32 array
        A crossing that draws each vertex.
    net_fit : NetFit
    cut_off : (m,) bool array
        Faces over which the volume is cut off.
    """

    smoothed: TriMesh
    mesh: TriMesh
    nearest: NDArray[np.int32]
    net_fit: NetFit
    cut_off: NDArray[np.bool_]


def voxel_surface(
    found: Boundary, settings: FitSettings, *, threads: int = 0, progress: Progress = silent
) -> VoxelSurface:
    """Let a net around the voxels come to rest on the crossings, and split its squares into triangles.

    Parameters
    ----------
    found : Boundary
    settings : FitSettings
        Stiffness, tolerance and most steps.
    threads : int
    progress : callable

    Returns
    -------
    VoxelSurface
        Closed, 2-manifold, outward but for the linings of cavities, and without self-intersections.
    """
    net = found.net
    made = settle(net, found.crossings, settings, threads=threads, progress=progress)
    smoothed, mesh, fours = triangulated(net, made, found.crossings, found.affine, threads)
    nearest = np.concatenate([net.fans[:, 0], fours])
    cut_off = of_triangles(found.crossings.cut_off, fours)
    return VoxelSurface(smoothed, mesh, nearest, made, cut_off)
