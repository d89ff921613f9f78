"""A mesh as levels of detail, each in the cells of a grid twice as wide as the one before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ....model.mesh import TriMesh
from ....slabs.patches.clipping import CellGrid, Clipped, clipped, cut_along
from ..cells import weld

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from ....slabs.keep import Kept
    from ....slabs.patches.patch import Patches

    Floats = NDArray[np.float64]
    Cell = tuple[int, ...]
    Simplify = Callable[[TriMesh, int], TriMesh]

FEWER = 4
"""Faces of a level for one of the next, whose details are twice as large."""


@dataclass(frozen=True)
class Fragment:
    """The faces of a level that lie in a cell.

    Attributes
    ----------
    level : int
        0 is the mesh itself.
    cell : (x, y, z)
        In the grid of the level.
    mesh : TriMesh
    """

    level: int
    cell: Cell
    mesh: TriMesh


def fragments(patches: Patches, grid: CellGrid, levels: int, simplify: Simplify) -> Iterator[Fragment]:
    """Hand out the fragments of all levels, those of the finest first, each level along a Z-order curve.

    Fragments of one level fit together: where a mesh is simplified its border stays. How the mesh was cut into slabs
    changes nothing, for each cell's faces are sorted.

    Parameters
    ----------
    patches : Patches
    grid : CellGrid
        Of the finest level.
    levels : int
    simplify : callable
        Returns a mesh with about so many faces, whose borders are those of the one it is given, to the last bit.
    """
    made = _finest(patches, grid)
    for level in range(levels):
        kept: dict[Cell, Kept] = {}
        for cell, corners in made:
            kept[cell] = patches.slabs.each(_same, [corners])[0]
            yield Fragment(level, cell, _welded(corners))
        finer = CellGrid(grid.origin, grid.side * 2**level)
        made = _coarser(patches, kept, finer, simplify)


def _same(corners: Floats) -> Floats:
    return corners


def _finest(patches: Patches, grid: CellGrid) -> Iterator[tuple[Cell, Floats]]:
    """Yield the faces (m, 3, 3) in each cell of the finest level."""
    kept = patches.each(clipped, [grid])
    holding: dict[Cell, list[Any]] = {}
    for one, cells in zip(kept, patches.slabs.fetch(patches.slabs.each(_cells, kept)), strict=True):
        for cell in map(tuple, cells.tolist()):
            holding.setdefault(cell, []).append(one)
    for cell in along_curve(holding):
        yield cell, _sorted(np.concatenate([patches.slabs.fetch([one])[0].of(cell) for one in holding[cell]]))


def _cells(found: Clipped) -> NDArray[np.int64]:
    return found.cells


def _coarser(
    patches: Patches, kept: dict[Cell, Kept], finer: CellGrid, simplify: Simplify
) -> Iterator[tuple[Cell, Floats]]:
    """Yield the faces of the level above another, cut along the planes of that other's cells."""
    children: dict[Cell, list[Kept]] = {}
    for cell, one in kept.items():
        children.setdefault(tuple(place // 2 for place in cell), []).append(one)
    for cell in along_curve(children):
        mesh = _welded(np.concatenate(patches.slabs.fetch(children[cell])))
        yield cell, _sorted(cut_along(simplify(mesh, len(mesh.faces) // FEWER).corners, finer))


def _sorted(corners: Floats) -> Floats:
    """Sort faces (m, 3, 3), of which each begins with its lowest corner."""
    lowest = np.lexsort(corners.transpose(2, 0, 1)[::-1], axis=1)[:, 0]
    turned = np.take_along_axis(corners, ((lowest[:, None] + np.arange(3)) % 3)[:, :, None], axis=1)
    return np.asarray(turned[np.lexsort(turned.reshape(-1, 9).T[::-1])])


def _welded(corners: Floats) -> TriMesh:
    """Join equal corners (m, 3, 3); faces that are lines by rounding are left out."""
    places, numbers = weld(corners.reshape(-1, 3))
    faces = numbers.reshape(-1, 3)
    return TriMesh(places, faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)])


def along_curve(cells: Any) -> list[Cell]:
    """Sort cells along a Z-order curve (Morton 1966), on which x turns fastest."""
    return sorted(cells, key=_place)


def _place(cell: Cell) -> int:
    return sum(((number >> bit) & 1) << (3 * bit + axis) for axis, number in enumerate(cell) for bit in range(21))
