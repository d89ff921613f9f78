"""Triangles from the squares of a net, without self-intersections, and placed in space."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..kernels.isosurface.diagonals import NEITHER, OPEN, allow_diagonals, choose_diagonals, list_normals, split_squares
from ..model.mesh import TriMesh
from .means import over, whole

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .crossings import LevelCrossings
    from .means import Rows, Span
    from .settle import NetFit
    from .surface_nets import Net

    Floats = NDArray[np.float64]

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
    choice = diagonals(net, made.positions, crossings.positions, after, whole(len(net.quads)), threads)
    fours = fours_of(choice)
    faces = np.concatenate(split(net.quads, choice, right_handed(affine), len(after), threads))
    added = placed(crossings.positions[fours], affine, threads)
    start, mesh = (TriMesh(np.concatenate([vertices, added]), faces) for vertices in (before, after))
    return start, mesh, fours


def diagonals(
    net: Net, positions: Floats, borders: Floats, after: Floats, squares: Rows, threads: int = 0
) -> NDArray[np.uint8]:
    """Choose a diagonal for every square that is wanted, (q,): 0, 1 or `NEITHER`.

    Parameters
    ----------
    net : Net
    positions, after : (n, 3) float array
        The vertices, as voxel indices and in space.
    borders : (q, 3) float array
        The crossings, as voxel indices.
    squares : callable
        The squares that have to be known.
    threads : int
    """
    allowed, most = np.zeros(len(net.quads), np.uint8), squares(len(ROUNDS) - 1)
    normals = np.empty((len(allowed), 4, 3), np.float32)
    over(lambda a, b: allow_diagonals(positions, net.quads, borders, net.directions, allowed, a, b), most, threads)
    over(lambda a, b: list_normals(after, net.quads, normals, a, b), most, threads)
    choice, odd = np.where(allowed > 0, np.uint8(OPEN), np.uint8(NEITHER)), _is_odd(net)
    for count, parity in enumerate(ROUNDS):
        span = squares(len(ROUNDS) - 1 - count)
        choice = _chosen(net, normals, allowed, choice, odd == parity, span, threads, alone=count == 0)
    return choice


def fours_of(choice: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Return which squares neither of their diagonals may split, (f,)."""
    return np.flatnonzero(choice == NEITHER).astype(np.int32)


def _is_odd(net: Net) -> NDArray[np.bool_]:
    """Tell which squares (q,) lie at odd places: neighbors in a plane take turns, whichever part of a study is seen."""
    return np.asarray((net.inner.sum(axis=1) + (net.directions & 1)) % 2 == 1)


def _chosen(
    net: Net,
    normals: NDArray[np.float32],
    allowed: NDArray[np.uint8],
    choice: NDArray[np.uint8],
    turns: NDArray[np.bool_],
    span: Span,
    threads: int,
    *,
    alone: bool,
) -> NDArray[np.uint8]:
    """Let some of the squares choose, each alone or with regard to its neighbors."""
    chosen = np.empty_like(choice)
    over(
        lambda start, stop: choose_diagonals(normals, net.twins, allowed, choice, turns, alone, chosen, start, stop),
        span, threads,
    )  # fmt: skip
    return chosen


def split(
    quads: NDArray[np.int32], choice: NDArray[np.uint8], outward: bool, first: int, threads: int = 0
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Split squares into triangles.

    Parameters
    ----------
    quads : (q, 4) int32 array
    choice : (q,) uint8 array
        Of `diagonals`.
    outward : bool
        Whether the squares are counter-clockwise from outside; else they are turned over.
    first : int
        Number of the first of the vertices in the middle of squares that are split into four.
    threads : int

    Returns
    -------
    halves : (2 q, 3) int64 array
        Two triangles a square.
    quarters : (2 f, 3) int64 array
        The other two of those that are split into four.
    """
    fours, halves = fours_of(choice), np.empty((len(quads), 2, 3), np.int64)
    over(lambda start, stop: split_squares(quads, choice, outward, halves, start, stop), (0, len(quads)), threads)
    quarters = _quarters(quads[fours], first)[:, :, slice(None, None, 1 if outward else -1)]
    halves[fours] = quarters[:, :2]
    return halves.reshape(-1, 3), quarters[:, 2:].reshape(-1, 3)


def of_triangles(values: NDArray[Any], fours: NDArray[np.integer[Any]]) -> NDArray[Any]:
    """Return for each triangle, halves before quarters, the value (q,) of its square; see `split` and `fours_of`."""
    return np.concatenate([np.repeat(values, 2), np.repeat(values[fours], 2)])


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

    over(work, (0, len(indices)), threads)
    return found


def right_handed(affine: NDArray[np.float64]) -> bool:
    """Tell whether the axes of the indices are right-handed in space."""
    return bool(np.linalg.det(affine[:3, :3]) > 0)
