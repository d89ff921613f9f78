"""Partition of space into cubes (the paper's page 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import EmptyError, ResourceError
from ..kernels.pointcloud.sweep import neighbor_distances
from ..kernels.threads import in_blocks
from ..model.columns import box, cells_at, parts_of
from ..model.cubes import MARGIN, SIDE, CubeGrid, keys_of

if TYPE_CHECKING:
    from numpy.typing import NDArray


ASKED = 5_000
"""Points whose neighbors are sought to find the sampling distance of all: where distances vary by a fifth, the
median of so many is that of all within .4 %."""
BLOCK = 250
"""Of them, those worked on in one call: far below 100 ms."""

FLAT = 1e-6
"""Thickness of points, over a length that is given, under which they count as flat: more than what
rounding leaves of a plane, and no cube is as thin."""


def partition(positions: NDArray[np.float64], cell_mm: NDArray[np.float64]) -> CubeGrid:
    """Flag the cubes that hold points, and register the points of each.

    Parameters
    ----------
    positions : (n, 3) float array
        Any unstructured points; their order does not matter.
    cell_mm : (3,) float array
        Edge of the cubes along x, y and z.

    Returns
    -------
    CubeGrid

    Raises
    ------
    EmptyError, ResourceError
        As `cubes_over`.
    """
    origin, keys = cubes_over(positions, cell_mm)
    order = np.lexsort((*positions.T, keys))
    present, first = np.unique(keys[order], return_index=True)
    return CubeGrid(present, origin, cell_mm, order, np.append(first, len(keys)))


def cubes_over(
    positions: NDArray[np.float64], cell_mm: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the lowest corner of cell (0, 0, 0), and the key of the cube that holds each point, (n,).

    Parameters
    ----------
    positions : (n, 3) float array
        The lowest lies in the middle of its cube.
    cell_mm : (3,) float array

    Raises
    ------
    EmptyError
        Without points.
    ResourceError
        Where the cubes are too small to be numbered; names the smallest edge.
    """
    if len(positions) == 0:
        raise EmptyError("there are no points", expected="at least one")
    low, high = box(positions)
    widest = (high - low).max()
    if (widest / cell_mm).max() > SIDE - 2 * MARGIN - 2:
        raise ResourceError(
            "the cubes are too small for the extent of the points",
            found=f"cell = {cell_mm.min():g}",
            expected=f"at least {widest / (SIDE - 2 * MARGIN - 2):g}",
            hint="a larger --cell-mm",
        )
    origin = low - 0.5 * cell_mm
    keys = np.empty(len(positions), np.int64)
    for part in parts_of(len(positions)):
        keys[part] = keys_of(cells_at(positions[part], origin, cell_mm))
    return origin, keys


def is_flat(positions: NDArray[np.float64], length: float) -> bool:
    """Tell whether points lie in a plane, on a line or at one place, up to a millionth of a length."""
    return dimensions(positions, length) < 3


def dimensions(positions: NDArray[np.float64], length: float) -> int:
    """Return 3 for points in space, 2 in a plane, 1 on a line and 0 at one place, up to a millionth of a length."""
    centered = positions - positions.mean(axis=0)
    variance = np.linalg.svd(centered.T @ centered / len(positions), compute_uv=False)
    return int(np.count_nonzero(variance > (FLAT * length) ** 2))


def sampling_distance(positions: NDArray[np.float64], *, neighbors: int = 6, threads: int = 0) -> float:
    """Estimate the distance of neighboring samples of a surface, from their positions alone.

    If points lie s apart, so that each owns s^2 of the surface, the k-th neighbor is about s sqrt(k / pi)
    away, on a grid as well as for points thrown at random. The median over some of the points is returned.

    Parameters
    ----------
    positions : (n, 3) float array
        Each once.
    neighbors, threads : int

    Returns
    -------
    float
        In the unit of the positions; 1 where there are not two points.
    """
    k = min(neighbors, len(positions) - 1)
    if k < 1:
        return 1.0
    low, high = box(positions)
    axis, stride = int(np.argmax(high - low)), -(-len(positions) // ASKED)
    along = positions[np.argsort(positions[:, axis], kind="stable")]
    distance = np.empty(len(range(0, len(along), stride)))
    in_blocks(
        lambda begin, end: neighbor_distances(along, axis, k, stride, distance, begin, end),
        len(distance),
        block=BLOCK,
        threads=threads,
    )
    return float(np.median(distance) * np.sqrt(np.pi / k))
