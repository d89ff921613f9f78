"""The faces of a mesh cut along the planes of a grid, so that each piece lies in one cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .patch import MeshPatch

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]


@dataclass(frozen=True)
class CellGrid:
    """Cubes of one side, counted from a corner.

    Attributes
    ----------
    origin : (3,) float array
    side : float
    """

    origin: Floats
    side: float

    def planes(self, numbers: Ints, axis: int) -> Floats:
        """Return where planes (n,) across an axis lie, which the cells of those numbers begin with."""
        return np.asarray(self.origin[axis] + numbers * self.side, np.float64)

    def cells(self, corners: Floats) -> Ints:
        """Return the cell (m, 3) of each face (m, 3, 3) that lies in one."""
        return np.asarray(np.floor((corners.mean(axis=1) - self.origin) / self.side), np.int64)


@dataclass(frozen=True)
class Clipped:
    """Faces in the order of their cells.

    Attributes
    ----------
    cells : (c, 3) int64 array
        Each once.
    first : (c + 1,) int64 array
        The faces of cell n are those from ``first[n]`` to ``first[n + 1]``.
    corners : (m, 3, 3) float64 array
    """

    cells: Ints
    first: Ints
    corners: Floats

    def of(self, cell: tuple[int, ...]) -> Floats:
        """Return the faces (m, 3, 3) in a cell."""
        at = np.flatnonzero((self.cells == cell).all(axis=1))
        return self.corners[self.first[at[0]] : self.first[at[0] + 1]] if len(at) else self.corners[:0]


def clipped(patch: MeshPatch, grid: CellGrid) -> Clipped:
    """Cut the faces of a patch along a grid, and sort them by its cells."""
    corners = cut_along(patch.vertices[patch.faces], grid)
    cells, which = np.unique(grid.cells(corners), axis=0, return_inverse=True)
    count = np.bincount(which.reshape(-1), minlength=len(cells))
    return Clipped(cells, np.cumsum([0, *count]), corners[np.argsort(which.reshape(-1), kind="stable")])


def cut_along(corners: Floats, grid: CellGrid) -> Floats:
    """Cut faces (m, 3, 3) along the planes of a grid, those that lie in one cell already stay as they are.

    An edge is cut at the same places, to the last bit, in both faces that have it, so the pieces fit together.
    """
    for axis in range(3):
        corners = _cut_across(corners, grid, axis)
    return corners


def _cut_across(corners: Floats, grid: CellGrid, axis: int) -> Floats:
    done = []
    while len(corners):
        along = corners[:, :, axis]
        low, high = along.min(axis=1), along.max(axis=1)
        number = np.floor((low - grid.origin[axis]) / grid.side).astype(np.int64)
        number += grid.planes(number, axis) <= low
        plane = grid.planes(number, axis)
        number += plane <= low
        plane = grid.planes(number, axis)
        crossing = (plane > low) & (plane < high)
        below, above = _cut(corners[crossing], plane[crossing], axis)
        done += [corners[~crossing], below]
        corners = above
    return np.concatenate([corners, *done])


def _cut(corners: Floats, plane: Floats, axis: int) -> tuple[Floats, Floats]:
    """Cut faces (m, 3, 3), each by a plane (m,) between its lowest and its highest corner, into those on both sides."""
    side = np.sign(corners[:, :, axis] - plane[:, None]).astype(np.int64)
    touching = (side == 0).any(axis=1)
    # the corner on the plane, else the one that has its side for itself
    alone = np.where(touching[:, None], side == 0, side == -np.sign(side.sum(axis=1))[:, None]).argmax(axis=1)
    order = (alone[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(corners, order[:, :, None], axis=1).swapaxes(0, 1)
    one, other = np.take_along_axis(side, order, axis=1).T[:2]
    to_c = _between(np.where(touching[:, None], b, a), c, plane, axis)
    to_b = _between(a, b, plane, axis)
    two, three = touching, ~touching
    parts = [
        (a[two], b[two], to_c[two], other[two]), (a[two], to_c[two], c[two], -other[two]),
        (a[three], to_b[three], to_c[three], one[three]), (to_b[three], b[three], c[three], -one[three]),
        (to_b[three], c[three], to_c[three], -one[three]),
    ]  # fmt: skip
    made = np.concatenate([np.stack(part[:3], axis=1) for part in parts])
    sides = np.concatenate([part[3] for part in parts])
    return made[sides < 0], made[sides > 0]


def _between(one: Floats, other: Floats, plane: Floats, axis: int) -> Floats:
    """Return where edges meet planes (m,), counted from the lower end, so that no direction changes it."""
    upward = (one[:, axis] <= other[:, axis])[:, None]
    low, high = np.where(upward, one, other), np.where(upward, other, one)
    rise = high[:, axis] - low[:, axis]
    share = (plane - low[:, axis]) / np.where(rise > 0, rise, 1.0)
    found = low + share[:, None] * (high - low)
    found[:, axis] = plane
    return np.asarray(found)
