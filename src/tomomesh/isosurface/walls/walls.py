"""All walls of a label map at rest, and the mesh of each label: the squares that bound it, turned outward."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...model.mesh import TriMesh
from ...progress import Progress, silent
from ..crossings import LevelCrossings, beyond_border, kinds_of
from ..diagonals import of_triangles, triangulated
from ..settle import settle
from ..surface_nets import Net
from ..voxels import Boundary, VoxelSurface
from .block import LabelBlock
from .net import net_between, places_between

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...model.sliced import Sliced
    from ...segmentation.labels import Labelled
    from ...settings import FitSettings
    from ..settle import NetFit
    from .net import WallNet

    Ints = NDArray[np.int64]
    Marks = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class WallBoundary(Boundary):
    """The boundary of a label, and where its walls have come to rest.

    Attributes
    ----------
    made : VoxelSurface
    beyond : (q,) int64 array
        The label before each square; 0 where there is none.
    lost : int
        Voxels that went to other labels so that no two of theirs touch along an edge or at a corner alone; `added`
        counts those that came from others.
    """

    made: VoxelSurface
    beyond: Ints
    lost: int = 0


@dataclass(frozen=True)
class Walls:
    """The walls between all labels of a map, at rest.

    Attributes
    ----------
    block : LabelBlock
    net : WallNet
    crossings : LevelCrossings
    fit : NetFit
    start, mesh : TriMesh
        All squares before and after the fit, split into triangles as `triangulated` does it, each once.
    fours : (f,) int32 array
        The squares that are split into four.
    order, first : (2 q,), (n + 2,) int64 array
        Squares label by label, and how many there are of those before.
    """

    block: LabelBlock
    net: WallNet
    crossings: LevelCrossings
    fit: NetFit
    start: TriMesh
    mesh: TriMesh
    fours: NDArray[np.int32]
    order: Ints
    first: Ints

    def of(self, number: int) -> WallBoundary | None:
        """Return the boundary of a label; None where it has no voxel, or not any more."""
        index = self.block.index(number)
        squares = np.sort(self.order[self.first[index] : self.first[index + 1]])
        if index == 0 or not len(squares):
            return None
        turned = self.net.labels[squares, 1] == index
        used, net = self._net(squares, turned)
        crossings = LevelCrossings(
            self.crossings.positions[squares], self._kinds(net), stepped=True, bending=self.crossings.bending
        )  # fmt: skip
        beyond = np.append(0, self.block.numbers)[self.net.labels[squares, np.where(turned, 0, 1)]]
        made, lost = (
            self._made(squares, turned, used, net, crossings),
            int(np.count_nonzero(self.block.before == index)),
        )
        return WallBoundary(
            self.block.affine, net, crossings, self._given_to(index), self.block.parts, made=made, beyond=beyond,
            lost=lost,
        )  # fmt: skip

    def _net(self, squares: Ints, turned: Marks) -> tuple[NDArray[np.int32], Net]:
        """Return the vertices of some squares, and the net that they are once those that are marked are turned."""
        net = self.net
        quads = net.quads[squares]
        quads[turned] = quads[turned, ::-1]
        used, places = np.unique(quads, return_inverse=True)
        quads = places.reshape(quads.shape).astype(np.int32)
        inner = net.inner[squares] + net.steps[squares] * turned[:, None]
        low, none = net.low[used], np.empty((0, 0), np.int32)
        links = _links(low, quads)
        return used, Net(low, links, none, quads, none, inner, net.directions[squares] ^ turned)

    def _made(
        self, squares: Ints, turned: Marks, used: NDArray[np.int32], net: Net, crossings: LevelCrossings
    ) -> VoxelSurface:
        fours = np.flatnonzero(np.isin(self.fours, squares))
        of_fours = np.searchsorted(squares, self.fours[fours])
        quarters = 2 * len(self.net.quads) + 2 * fours[:, None] + (0, 1)
        chosen = np.concatenate([(2 * squares[:, None] + (0, 1)).ravel(), quarters.ravel()])
        faces = self.mesh.faces[chosen]
        back = of_triangles(turned, of_fours)
        faces[back] = faces[back, ::-1]
        vertices = np.concatenate([used, len(self.net.low) + fours])
        place = np.empty(len(self.mesh.vertices), np.int64)
        place[vertices] = np.arange(len(vertices))
        start, mesh = (TriMesh(one.vertices[vertices], place[faces]) for one in (self.start, self.mesh))
        nearest = np.concatenate([_first_squares(net), of_fours]).astype(np.int32)
        return VoxelSurface(start, mesh, nearest, self.fit, of_triangles(crossings.cut_off, of_fours))

    def _kinds(self, net: Net) -> NDArray[np.uint8]:
        """Tell what the crossings of a label's net are."""
        beyond = beyond_border(net.inner, net.steps, self.block.shape)
        voxels = np.ravel_multi_index(tuple((net.inner - self.block.low).T[::-1]), self.block.labels.shape)
        return kinds_of(np.isin(voxels, self.block.given), beyond)

    def _given_to(self, index: int) -> int:
        return int(np.count_nonzero(self.block.labels.reshape(-1)[self.block.given] == index))


def walls_between(
    labels: Labelled, settings: FitSettings, *, inside: Sliced | None = None, divide: bool = False, threads: int = 0,
    progress: Progress = silent,
) -> Walls:  # fmt: skip
    """Let the walls between all labels of a map come to rest half way between their voxels.

    Parameters
    ----------
    labels : Labelled
    settings : FitSettings
        Stiffness, tolerance and most steps.
    inside : (K, J, I) bool array or RunMask, optional
        The voxels that may have a label.
    divide : bool
        Whether voxels of thick slices are divided first.
    threads : int
    progress : callable

    Returns
    -------
    Walls
    """
    block = LabelBlock.of(labels, inside, divide=divide, threads=threads)
    net = net_between(block, threads)
    crossings = places_between(net, block, threads)
    fit = settle(net, crossings, settings, threads=threads, progress=progress)
    start, mesh, fours = triangulated(net, fit, crossings, block.affine, threads)
    both = net.labels.T.ravel()
    order = np.argsort(both, kind="stable") % len(net.quads)
    first = np.append(0, np.cumsum(np.bincount(both, minlength=len(block.numbers) + 1)))
    return Walls(block, net, crossings, fit, start, mesh, fours, order, first)


def _links(low: NDArray[np.int32], quads: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the neighbors of vertices (n, 3) along the sides of squares (q, 4), by direction (n, 6); -1 for none."""
    links = np.full((len(low), 6), -1, np.int32)
    for side in range(4):
        here, there = quads[:, side], quads[:, (side + 1) % 4]
        step = low[there] - low[here]
        axis = np.abs(step).argmax(axis=1)
        ahead = step[np.arange(len(step)), axis] > 0
        links[here, 2 * axis + ahead] = there
        links[there, 2 * axis + ~ahead] = here
    return links


def _first_squares(net: Net) -> Ints:
    """Return the first square of each vertex (n,)."""
    found = np.empty(len(net.low), np.int64)
    squares = np.arange(len(net.quads))[::-1]
    found[net.quads[::-1].ravel()] = np.repeat(squares, 4)
    return found
