"""(n, k) arrays with few columns: as kernels take them, and reduced column by column.

Along the rows numpy takes twenty times as long.
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

Kind = TypeVar("Kind", bound=np.generic)


def box(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest and the highest corner of the box around points (n, k), one at least."""
    return np.array([column.min() for column in points.T]), np.array([column.max() for column in points.T])


def cells_at(
    points: NDArray[np.float64], origin: NDArray[np.float64], edge: NDArray[np.float64] | float
) -> NDArray[np.int64]:
    """Return the cell of each point (n, k) in a lattice of an edge, (n, k); cell 0 begins at the origin."""
    return np.floor((points - origin) / edge).astype(np.int64)


def any_of(rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which rows (n, k) have any true column, (n,)."""
    return reduce(np.logical_or, rows.T)


def for_kernels(numbers: ArrayLike, kind: type[Kind]) -> NDArray[Kind]:
    """Return numbers of one type, row after row, aligned and writable; a copy only where they are not."""
    return np.require(numbers, kind, ["C", "A", "W"])
