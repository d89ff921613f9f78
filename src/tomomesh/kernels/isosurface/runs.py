"""Loops over runs: the stretches of a mask's rows that it holds. See `tomomesh.isosurface.run_mask`.

Row ``J k + j`` is row j of slice k; its runs are those from ``begin[row]`` to before ``begin[row + 1]``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..compile import kernel
from ..measure.edges import find_roots, join

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Ints = NDArray[np.int32]
    Mask = NDArray[np.bool_]


@kernel("void(b1[:,:,:], i8[::1], i8, i8)")
def count_runs(mask: Mask, count: NDArray[np.int64], start: int, stop: int) -> None:
    """Count the runs in each row (K J,) of some slices."""
    rows, columns = mask.shape[1], mask.shape[2]
    for k in range(start, stop):
        for j in range(rows):
            found, last = 0, False
            for i in range(columns):
                here = mask[k, j, i]
                found += here and not last
                last = here
            count[k * rows + j] = found


@kernel("void(b1[:,:,:], i8[::1], i4[::1], i4[::1], i8, i8)")
def list_runs(mask: Mask, begin: NDArray[np.int64], starts: Ints, stops: Ints, start: int, stop: int) -> None:
    """List the first column of each run, and that behind its last, of some slices."""
    rows, columns = mask.shape[1], mask.shape[2]
    for k in range(start, stop):
        for j in range(rows):
            n, last = begin[k * rows + j], False
            for i in range(columns):
                here = mask[k, j, i]
                if here != last:
                    if here:
                        starts[n], stops[n] = i, columns
                        n += 1
                    else:
                        stops[n - 1] = i
                last = here


@kernel("void(i4[::1], i4[::1], i8, i8, i8, i8, i8, i4[::1])")
def join_rows(
    starts: Ints, stops: Ints, one: int, one_end: int, other: int, other_end: int, corner: int, roots: Ints
) -> None:
    """Join the runs of two rows that lie beside each other, or touch at a corner where that is 1 and not 0."""
    while one < one_end and other < other_end:
        if starts[one] < stops[other] + corner and starts[other] < stops[one] + corner:
            join(roots, one, other)
        if stops[one] < stops[other]:
            one += 1
        else:
            other += 1


@kernel("i8(i8[::1], i4[::1], i4[::1], i8, i8, i4[::1])")
def join_runs(begin: NDArray[np.int64], starts: Ints, stops: Ints, rows: int, corner: int, roots: Ints) -> int:
    """Join the runs that touch along faces, or along edges and at corners too where `corner` is 1 and not 0.

    Parameters
    ----------
    begin : (K J + 1,) int64 array
    starts, stops : (r,) int32 array
    rows : int
        Rows of a slice, J.
    corner : int
    roots : (r,) int32 array
        Its own numbers on entry. Result: the lowest run of the component that each belongs to.

    Returns
    -------
    int
        Number of components.
    """
    for row in range(len(begin) - 1):
        j = row % rows
        if j > 0:
            join_rows(starts, stops, begin[row], begin[row + 1], begin[row - 1], begin[row], corner, roots)
        for step in range(-corner, corner + 1):
            other = row - rows + step
            if row >= rows and 0 <= j + step < rows:
                join_rows(starts, stops, begin[row], begin[row + 1], begin[other], begin[other + 1], corner, roots)
    return int(find_roots(roots))


@kernel("void(b1[:,:,:], i8[::1], i4[::1], i4[::1], i8[::1], i8, i8)")
def count_in_runs(
    mask: Mask, begin: NDArray[np.int64], starts: Ints, stops: Ints, count: NDArray[np.int64], start: int, stop: int
) -> None:
    """Count the voxels of another mask in each run (r,) of some slices."""
    rows = mask.shape[1]
    for row in range(start * rows, stop * rows):
        k, j = row // rows, row % rows
        for n in range(begin[row], begin[row + 1]):
            count[n] = 0
            for i in range(starts[n], stops[n]):
                count[n] += mask[k, j, i]


@kernel("void(b1[:,:,:], i8[::1], i4[::1], i4[::1], b1[::1], b1, i8, i8)")
def fill_runs(
    mask: Mask, begin: NDArray[np.int64], starts: Ints, stops: Ints, marked: Mask, value: bool, start: int, stop: int
) -> None:
    """Give the voxels of marked runs (r,) of some slices a value."""
    rows = mask.shape[1]
    for row in range(start * rows, stop * rows):
        k, j = row // rows, row % rows
        for n in range(begin[row], begin[row + 1]):
            if marked[n]:
                for i in range(starts[n], stops[n]):
                    mask[k, j, i] = value
