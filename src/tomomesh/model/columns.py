"""(n, k) arrays with few columns: as kernels take them, and reduced column by column.

Along the rows numpy takes twenty times as long.
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike, NDArray

Kind = TypeVar("Kind", bound=np.generic)

PART = 100_000
"""Rows worked on together. Only memory and time depend on it."""


def box(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest and the highest corner of the box around points (n, k), one at least."""
    return np.array([column.min() for column in points.T]), np.array([column.max() for column in points.T])


def cells_at(
    points: NDArray[np.float64], origin: NDArray[np.float64], edge: NDArray[np.float64] | float
) -> NDArray[np.int64]:
    """Return the cell of each point (n, k) in a lattice of an edge, (n, k); cell 0 begins at the origin."""
    return np.floor((points - origin) / edge).astype(np.int64)


def carried(
    points: NDArray[np.float64], matrix: NDArray[np.float64], shift: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return points (n, 3), each times a matrix (3, 3) and shifted by (3,); themselves where neither moves them.

    Not as a product of matrices: BLAS has its threads wait for so few columns, and takes three times as long and more.
    """
    if np.array_equal(matrix, np.eye(3)) and not shift.any():
        return points
    return np.asarray(np.einsum("nj,jk->nk", points, matrix) + shift)


def any_of(rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which rows (n, k) have any true column, (n,)."""
    return reduce(np.logical_or, rows.T)


def mean_over(values: NDArray[np.float64], rows: NDArray[np.integer[Any]]) -> NDArray[np.float64]:
    """Average values (n,) over rows of their numbers (m, k), part by part, for what is taken is many times as large."""
    found = np.empty(len(rows))
    for part in parts_of(len(rows)):
        values[rows[part]].mean(axis=1, out=found[part])
    return found


def parts_of(count: int) -> Iterator[slice]:
    """Part so many rows into some, which bounds the memory of what is made of them."""
    return (slice(start, start + PART) for start in range(0, count, PART))


def for_kernels(numbers: ArrayLike, kind: type[Kind]) -> NDArray[Kind]:
    """Return numbers of one type, row after row, aligned and writable; a copy only where they are not."""
    return np.require(numbers, kind, ["C", "A", "W"])
