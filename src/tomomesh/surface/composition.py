"""Make a set of cubes well composed, so that its surface is a 2-manifold.

Cubes that touch only along an edge or at a corner make edges with four faces, or corners where two sheets meet
(Latecki 1997). Every block that holds such a contact is filled, until none is left.
"""

from __future__ import annotations

from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from ..model.cubes import key_step
from .neighbors import column_of, neighbor_table, once_each

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Offset = tuple[int, int, int]


def well_composed(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """Add the cubes that remove every contact along an edge only, or at a corner only.

    Parameters
    ----------
    keys : (c,) int64 array
        Rising.

    Returns
    -------
    (d,) int64 array
        All of `keys`, and the cubes added, rising. The result is the same for mirrored sets.
    """
    while True:
        present = np.ascontiguousarray((neighbor_table(keys) >= 0).T)
        added = [
            (keys[critical, None] + np.array([key_step(cell) for cell in block])).ravel()
            for block, critical in _critical_blocks(present)
            if critical.any()
        ]
        if not added:
            return keys
        keys = once_each(np.concatenate([keys, *added]))


def _critical_blocks(present: NDArray[np.bool_]) -> list[tuple[list[Offset], NDArray[np.bool_]]]:
    """Return the cells of each block around a cube, and the cubes (c,) for which it holds a contact.

    `present` is (27, c): which neighbors of the cubes are in the set.
    """
    pairs = [pair for a, b in combinations(range(3), 2) for pair in _signed(a, b)]
    blocks = [_edge_block(present, first, second) for first, second in pairs]
    return blocks + [found for x, y, z in product((-1, 1), repeat=3) for found in _corner_blocks(present, (x, y, z))]


def _signed(a: int, b: int) -> list[tuple[Offset, Offset]]:
    """Return the steps along two axes: forward along the first, both ways along the second."""
    return [(_unit(a, 1), _unit(b, sign)) for sign in (-1, 1)]


def _unit(axis: int, sign: int) -> Offset:
    x, y, z = (sign * (n == axis) for n in range(3))
    return x, y, z


def _edge_block(present: NDArray[np.bool_], first: Offset, second: Offset) -> tuple[list[Offset], NDArray[np.bool_]]:
    """Find cubes whose diagonal neighbor is present, and neither of the two between."""
    across = (first[0] + second[0], first[1] + second[1], first[2] + second[2])
    here, between, beside = (present[column_of(cell)] for cell in (across, first, second))
    return [first, second], here & ~between & ~beside


def _corner_blocks(present: NDArray[np.bool_], corner: Offset) -> list[tuple[list[Offset], NDArray[np.bool_]]]:
    """Find 2 x 2 x 2 blocks where two opposite cells alone are present, or alone are missing."""
    x, y, z = corner
    cells = [(x * a, y * b, z * c) for a, b, c in product((0, 1), repeat=3)][1:]
    has = {cell: present[column_of(cell)] for cell in cells}
    near = [cell for cell in cells if cell != corner]
    touching = has[corner] & ~np.logical_or.reduce([has[cell] for cell in near])
    found = [(near, touching)]
    for hole in near[: len(near) // 2]:
        opposite = (x - hole[0], y - hole[1], z - hole[2])
        others = [has[cell] for cell in cells if cell not in (hole, opposite)]
        found.append(([hole, opposite], ~has[hole] & ~has[opposite] & np.logical_and.reduce(others)))
    return found
