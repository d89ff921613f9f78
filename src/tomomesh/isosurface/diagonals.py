"""Triangles from the squares of a net, without self-intersections, and placed in space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels.isosurface.diagonals import NEITHER, OPEN, allow_diagonals, choose_diagonals, list_normals, split_squares
from ..kernels.threads import in_blocks
from ..model.mesh import TriMesh
from .means import BLOCK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .crossings import LevelCrossings
    from .surface_nets import Net, NetFit

ROUNDS = (0, 1, 0)
"""Squares at even and at odd places choose in turn, with regard to those that have chosen. Measured: one round less, or
two more, change the area of a ball by less than 0.1 %."""


def triangulated(
    net: Net, made: NetFit, crossings: LevelCrossings, affine: NDArray[np.float64], threads: int = 0
) -> tuple[TriMesh, TriMesh, NDArray[np.int32]]:
    """Split every square by the diagonal that bends it least, and place the net before and after in space.

    Where neither diagonal would keep a square between its two voxels, it is split into four at its crossing. So no
    two faces meet but at their sides: a square stays in the octahedron of its two voxels and its four vertices, each
    in a cell of its own, and the octahedra do not overlap (after Ju & Udeshi 2006).

    Parameters
    ----------
    net : Net
    made : NetFit
    crossings : LevelCrossings
    affine : (4, 4) float array
        Voxel indices to millimeters.
    threads : int

    Returns
    -------
    start, mesh : TriMesh
        The same faces over the vertices before and after: two a square in the order of the squares, then the other
        two of those that are split into four, whose crossings are the last vertices.
    fours : (f,) int32 array
        The squares that are split into four.
    """
    before, after = (placed(indices, affine, threads) for indices in (made.start, made.positions))
    choice = _diagonals(net, made, crossings, after, threads)
    fours, outward = np.flatnonzero(choice == NEITHER).astype(np.int32), right_handed(affine)
    halves = _halves(net.quads, choice, outward, threads)
    quarters = _quarters(net.quads[fours], len(after))[:, :, slice(None, None, 1 if outward else -1)]
    halves[fours] = quarters[:, :2]
    faces = np.concatenate([halves.reshape(-1, 3), quarters[:, 2:].reshape(-1, 3)])
    added = placed(crossings.positions[fours], affine, threads)
    start, mesh = (TriMesh(np.concatenate([vertices, added]), faces) for vertices in (before, after))
    return start, mesh, fours


def _diagonals(
    net: Net, made: NetFit, crossings: LevelCrossings, after: NDArray[np.float64], threads: int
) -> NDArray[np.uint8]:
    """Choose a diagonal for every square, (q,): 0, 1 or `NEITHER`."""
    allowed = np.empty(len(net.quads), np.uint8)

    def allow(start: int, stop: int) -> None:
        allow_diagonals(made.positions, net.quads, crossings.positions, net.directions, allowed, start, stop)

    in_blocks(allow, len(allowed), block=BLOCK, threads=threads)
    choice, odd = np.where(allowed > 0, np.uint8(OPEN), np.uint8(NEITHER)), _is_odd(net)
    normals = np.empty((len(allowed), 4, 3), np.float32)
    in_blocks(
        lambda start, stop: list_normals(after, net.quads, normals, start, stop), len(normals), block=BLOCK,
        threads=threads,
    )  # fmt: skip
    for count, parity in enumerate(ROUNDS):
        choice = _chosen(net, normals, allowed, choice, odd == parity, threads, alone=count == 0)
    return choice


def _is_odd(net: Net) -> NDArray[np.bool_]:
    """Tell which squares (q,) lie at odd places: neighbors in a plane take turns, whichever part of a study is seen."""
    return np.asarray((net.inner.sum(axis=1) + (net.directions & 1)) % 2 == 1)


def _chosen(
    net: Net,
    normals: NDArray[np.float32],
    allowed: NDArray[np.uint8],
    choice: NDArray[np.uint8],
    turns: NDArray[np.bool_],
    threads: int,
    *,
    alone: bool,
) -> NDArray[np.uint8]:
    """Let some of the squares choose, each alone or with regard to its neighbors."""
    chosen = np.empty_like(choice)

    def work(start: int, stop: int) -> None:
        choose_diagonals(normals, net.twins, allowed, choice, turns, alone, chosen, start, stop)

    in_blocks(work, len(choice), block=BLOCK, threads=threads)
    return chosen


def _halves(quads: NDArray[np.int32], choice: NDArray[np.uint8], outward: bool, threads: int) -> NDArray[np.int64]:
    """Split squares (q, 4) by the diagonal from corner 0 or 1 into two triangles each, (q, 2, 3); or turn them over."""
    halves = np.empty((len(quads), 2, 3), np.int64)
    in_blocks(
        lambda start, stop: split_squares(quads, choice, outward, halves, start, stop),
        len(quads), block=BLOCK, threads=threads,
    )  # fmt: skip
    return halves


def _quarters(quads: NDArray[np.int32], first: int) -> NDArray[np.int64]:
    """Split squares (q, 4) into four triangles each at centers that are numbered from `first`: (q, 4, 3)."""
    centers = np.broadcast_to(first + np.arange(len(quads))[:, None], quads.shape)
    return np.stack([quads, np.roll(quads, -1, axis=1), centers], axis=2).astype(np.int64)


def placed(indices: NDArray[np.float64], affine: NDArray[np.float64], threads: int = 0) -> NDArray[np.float64]:
    """Carry indices (n, 3) to millimeters; in blocks, for which one thread is quicker than a matrix library's many."""
    found, turn = np.empty_like(indices), np.ascontiguousarray(affine[:3, :3].T)

    def work(start: int, stop: int) -> None:
        np.matmul(indices[start:stop], turn, out=found[start:stop])
        found[start:stop] += affine[:3, 3]

    in_blocks(work, len(indices), block=BLOCK, threads=threads)
    return found


def right_handed(affine: NDArray[np.float64]) -> bool:
    """Tell whether the axes of the indices are right-handed in space."""
    return bool(np.linalg.det(affine[:3, :3]) > 0)
