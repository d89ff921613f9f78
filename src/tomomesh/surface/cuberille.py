"""Cuberille by surface tracking (Gordon & Udupa 1989; the paper's Fig. 8a)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.cells import track_surfaces
from ..model.cubes import SIDE, cells_of, keys_of
from ..model.mesh import QuadMesh
from .neighbors import DIRECTIONS, column_of, neighbor_table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.cubes import CubeGrid


CRUMB = 0.01
"""Share of the outer surfaces' cubes under which one that encloses nothing is debris, and left out."""


@dataclass(frozen=True)
class Cuberille:
    """The tracked surfaces of a cube set.

    Attributes
    ----------
    mesh : QuadMesh
        The faces that were taken; `mesh.cubes` are positions in the grid's keys.
    surfaces : int
        Surfaces found, cavities included.
    volumes : (s,) int64 array
        Signed volume of each, cubes; negative for cavities.
    taken : (s,) bool array
        Which surfaces the mesh holds.
    debris : int
        Crumbs among the outer surfaces, which were left out.
    """

    mesh: QuadMesh
    surfaces: int
    volumes: NDArray[np.int64]
    taken: NDArray[np.bool_]
    debris: int

    @property
    def cavities(self) -> int:
        """Linings of cavities among the surfaces that were taken."""
        return int((self.volumes[self.taken] < 0).sum())

    @property
    def enclosed(self) -> int:
        """Cubes inside the surfaces that were taken."""
        return int(self.volumes[self.taken].sum())


def _turns() -> NDArray[np.int32]:
    """List, for each direction and side of a face, where tracking may go on (see `track_surfaces`)."""
    rows = []
    for direction in DIRECTIONS:
        for ahead in (d for d in DIRECTIONS if not np.dot(d, direction)):
            outward = tuple(np.add(ahead, direction).tolist())
            back = DIRECTIONS.index(tuple(-n for n in ahead))
            columns = [
                column_of(outward),
                column_of(ahead),
                back,
                DIRECTIONS.index(ahead),
                column_of(direction),
            ]
            rows.append(columns)
    return np.array(rows, np.int32)


def _corners() -> NDArray[np.int64]:
    """Return the corners (x, y, z) of the unit cube's faces, counter-clockwise from outside, (6, 4, 3)."""
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    faces = np.zeros((6, 4, 3), np.int64)
    for n, direction in enumerate(DIRECTIONS):
        axis = int(np.flatnonzero(direction)[0])
        faces[n, :, axis] = direction[axis] > 0
        faces[n, :, [(axis + 1) % 3, (axis + 2) % 3]] = (square if direction[axis] > 0 else square[::-1]).T
    return faces


TURNS, CORNERS = _turns(), _corners()


def track(grid: CubeGrid, *, surface: str = "outer") -> Cuberille:
    """Track the closed surfaces of the cubes from face to face, and take the outer ones.

    Parameters
    ----------
    grid : CubeGrid
        Well composed (see `tomomesh.surface.composition`), so that the result is a 2-manifold.
    surface : {"outer", "all"}
        The surfaces that nothing surrounds, or all, with the linings of cavities.

    Returns
    -------
    Cuberille
        Closed, outward; faces in the order of their cubes.
    """
    labels = np.full((len(grid.keys), 6), -1, np.int32)
    count = track_surfaces(neighbor_table(grid.keys), TURNS, labels)
    cube, direction = np.nonzero(labels >= 0)
    label = labels[cube, direction]
    cells = grid.cells
    volumes = _volumes(cells[cube, 0], direction, label, count)
    outermost = _outermost(cells, cube, direction, label, volumes)
    debris = _debris(cube, label, volumes, outermost)
    taken = np.ones(count, bool) if surface == "all" else outermost & ~debris
    keep = taken[label]
    return Cuberille(_quads(grid, cells, cube[keep], direction[keep]), count, volumes, taken, int(debris.sum()))


def _volumes(
    x: NDArray[np.int64], direction: NDArray[np.int64], label: NDArray[np.int32], count: int
) -> NDArray[np.int64]:
    """Return the signed volume of each surface in cubes, exactly: the sum of x over its faces across x."""
    volumes = np.zeros(count, np.int64)
    left, right = direction == 0, direction == 1
    np.subtract.at(volumes, label[left], x[left])
    np.add.at(volumes, label[right], x[right] + 1)
    return volumes


def _outermost(
    cells: NDArray[np.int64],
    cube: NDArray[np.int64],
    direction: NDArray[np.int64],
    label: NDArray[np.int32],
    volumes: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Tell which surfaces enclose volume and lie inside no other such surface.

    Walks along -x from the lowest cube of each surface, and counts the outward surfaces entered and left.
    """
    outward = volumes > 0
    if outward.sum() == 1:
        return outward
    wall = (direction < 2) & outward[label]
    at = keys_of(cells[cube[wall]]) + (direction[wall] == 1)
    rank = np.argsort(at, kind="stable")
    entered = np.concatenate([[0], np.cumsum(np.where(direction[wall][rank] == 0, 1, -1))])
    _, first = np.unique(label, return_index=True)
    seed = keys_of(cells[cube[first]])
    row = seed - seed % SIDE
    inside = entered[np.searchsorted(at[rank], seed)] - entered[np.searchsorted(at[rank], row)]
    return np.asarray(outward & (inside == 0))


def _debris(
    cube: NDArray[np.int64], label: NDArray[np.int32], volumes: NDArray[np.int64], outermost: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Tell which surfaces are crumbs: small, and around nothing but the cubes that bear their own faces."""
    pairs = np.unique(label.astype(np.int64) * (int(cube.max()) + 1) + cube)
    bearing = np.bincount(pairs // (int(cube.max()) + 1), minlength=len(volumes))
    small = bearing < CRUMB * bearing[outermost].sum()
    return np.asarray(outermost & small & (volumes <= bearing))


def _quads(grid: CubeGrid, cells: NDArray[np.int64], cube: NDArray[np.int64], direction: NDArray[np.int64]) -> QuadMesh:
    """Make one vertex of the corners that faces share."""
    corners = (cells[cube][:, None, :] + CORNERS[direction]).reshape(-1, 3)
    keys, quads = np.unique(keys_of(corners), return_inverse=True)
    vertices = grid.origin + cells_of(keys) * grid.cell_mm
    return QuadMesh(vertices, quads.reshape(-1, 4).astype(np.int64), cube)
