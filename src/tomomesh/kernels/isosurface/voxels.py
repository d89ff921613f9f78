"""Loops over the voxels of a mask, and over the cells between eight voxels that hold its surface.

The corners of a cell are numbered x + 2 y + 4 z; bit n of its case is set where corner n is inside. Directions are
numbered -x, +x, -y, +y, -z, +z.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel("i8(b1[:,:,::1], i8, i8, i8)")
def column_of_corners(mask: NDArray[np.bool_], z: int, y: int, x: int) -> int:
    """Return the bits of the four corners of a cell that have the smaller x."""
    near = int(mask[z, y, x]) | int(mask[z, y + 1, x]) << 2
    return near | int(mask[z + 1, y, x]) << 4 | int(mask[z + 1, y + 1, x]) << 6


@kernel("void(b1[:,:,::1], b1[::1], i8[::1], i8, i8)")
def count_cells(
    mask: NDArray[np.bool_], wanted: NDArray[np.bool_], count: NDArray[np.int64], start: int, stop: int
) -> None:
    """Count the cells of some cases in each layer between two slices.

    Parameters
    ----------
    mask : (K, J, I) bool array
    wanted : (256,) bool array
        The cases to count.
    count : (K - 1,) int64 array
        Result.
    start, stop : int
        Layers to work on.
    """
    for z in range(start, stop):
        found = 0
        for y in range(mask.shape[1] - 1):
            left = column_of_corners(mask, z, y, 0)
            for x in range(mask.shape[2] - 1):
                right = column_of_corners(mask, z, y, x + 1)
                found += wanted[left | right << 1]
                left = right
        count[z] = found


@kernel("void(b1[:,:,::1], b1[::1], i8[::1], i4[:,::1], u1[::1], i8, i8)")
def list_cells(
    mask: NDArray[np.bool_],
    wanted: NDArray[np.bool_],
    first: NDArray[np.int64],
    cells: NDArray[np.int32],
    cases: NDArray[np.uint8],
    start: int,
    stop: int,
) -> None:
    """List the cells of some cases in the order of z, then y, then x.

    Parameters
    ----------
    mask, wanted, start, stop
        As in `count_cells`.
    first : (K - 1,) int64 array
        Cells in the layers before.
    cells : (n, 3) int32 array
        Result: the voxel (x, y, z) in the lowest corner of each cell.
    cases : (n,) uint8 array
        Result.
    """
    for z in range(start, stop):
        n = first[z]
        for y in range(mask.shape[1] - 1):
            left = column_of_corners(mask, z, y, 0)
            for x in range(mask.shape[2] - 1):
                right = column_of_corners(mask, z, y, x + 1)
                case = left | right << 1
                if wanted[case]:
                    cells[n, 0], cells[n, 1], cells[n, 2] = x, y, z
                    cases[n] = case
                    n += 1
                left = right


@kernel("void(i4[:,::1], u1[::1], b1[:,::1], i4[:,:,::1], i4[:,::1])")
def link_cells(
    cells: NDArray[np.int32],
    cases: NDArray[np.uint8],
    linked: NDArray[np.bool_],
    latest: NDArray[np.int32],
    table: NDArray[np.int32],
) -> None:
    """Find the neighbors of cells with which they share sides of faces.

    Parameters
    ----------
    cells : (n, 3) int32 array
        Ordered by z, then y, then x.
    cases : (n,) uint8 array
    linked : (256, 6) bool array
        Whether a cell of a case shares one in a direction; the cell there does so too.
    latest : (2, J, I) int32 array
        -1 everywhere; overwritten: the cell that was last seen at a place of even and of odd layers.
    table : (n, 6) int32 array
        Result: the neighbor in each direction, -1 where none is linked, or none is there.
    """
    for v in range(len(cells)):
        x, y, z, case = cells[v, 0], cells[v, 1], cells[v, 2], cases[v]
        for axis in range(3):
            table[v, 2 * axis], table[v, 2 * axis + 1] = -1, -1
            if linked[case, 2 * axis]:
                before = v - 1 if axis == 0 else latest[z & 1, y - 1, x] if axis == 1 else latest[z - 1 & 1, y, x]
                table[v, 2 * axis] = before
                if before >= 0:  # else the first of these layers is not the first there is
                    table[before, 2 * axis + 1] = v
        latest[z & 1, y, x] = v


@kernel("void(i4[:,::1], u1[::1], i8[::1], i4[:,::1], u1[::1], i8, i8)")
def list_borders(
    cells: NDArray[np.int32],
    cases: NDArray[np.uint8],
    first: NDArray[np.int64],
    inner: NDArray[np.int32],
    directions: NDArray[np.uint8],
    start: int,
    stop: int,
) -> None:
    """List the lines between voxels inside and outside: the cell whose lowest corner is one of the two owns it.

    Parameters
    ----------
    cells : (n, 3) int32 array
        The voxel (x, y, z) in the lowest corner of each cell.
    cases : (n,) uint8 array
    first : (n,) int64 array
        Lines of the cells before.
    inner : (q, 3) int32 array
        Result: the voxel inside.
    directions : (q,) uint8 array
        Result: the direction from inside to outside.
    start, stop : int
        Cells to work on.
    """
    for v in range(start, stop):
        f = first[v]
        low = cases[v] & 1
        for axis in range(3):
            if cases[v] >> (1 << axis) & 1 != low:
                inner[f, 0], inner[f, 1], inner[f, 2] = cells[v, 0], cells[v, 1], cells[v, 2]
                inner[f, axis] += 1 - low
                directions[f] = 2 * axis + low
                f += 1


@kernel("void(u1[::1], i4[:,::1], i8[::1], i4[:,::1], i8, i8)")
def list_faces(
    cases: NDArray[np.uint8],
    table: NDArray[np.int32],
    first: NDArray[np.int64],
    quads: NDArray[np.int32],
    start: int,
    stop: int,
) -> None:
    """List the square faces between voxels inside and outside, in the order of `list_borders`.

    The corners of a face are the four cells around the line that it crosses.

    Parameters
    ----------
    cases, first
        As in `list_borders`.
    table : (n, 6) int32 array
        Neighboring cells by direction.
    quads : (q, 4) int32 array
        Result: the cells around, counter-clockwise seen from outside where the axes are right-handed.
    start, stop : int
        Cells to work on.
    """
    for v in range(start, stop):
        f = first[v]
        low = cases[v] & 1
        for axis in range(3):
            if cases[v] >> (1 << axis) & 1 == low:
                continue
            b, c = (axis + 1) % 3, (axis + 2) % 3
            before = table[v, 2 * b]
            beside = table[v, 2 * c]
            quads[f, 0] = v
            quads[f, 1] = before if low else beside
            quads[f, 2] = table[before, 2 * c]
            quads[f, 3] = beside if low else before
            f += 1


@kernel("void(u1[::1], i4[:,::1], i8[::1], i4[:,::1], i4[:,::1], i8, i8)")
def list_fans(
    cases: NDArray[np.uint8],
    table: NDArray[np.int32],
    first: NDArray[np.int64],
    fans: NDArray[np.int32],
    twins: NDArray[np.int32],
    start: int,
    stop: int,
) -> None:
    """List the faces around every cell, and those beyond their sides.

    Parameters
    ----------
    cases, table, first, start, stop
        As in `list_faces`.
    fans : (n, 6) int32 array
        Result: the faces that have the cell as a corner, then -1.
    twins : (q, 4) int32 array
        Result: the face beyond each side, times four, plus the number of its own side there. Side n is that from corner
        n to the next.

    Notes
    -----
    In a well-composed set a cell has six faces at most. Of the two that share a side, one runs from the cell to its
    neighbor there, and the other back; each side is written by the cell in which it begins.
    """
    leaving, coming = np.zeros(6, np.int64), np.zeros(6, np.int64)
    for v in range(start, stop):
        n = 0
        for edge in range(12):
            axis = edge >> 2
            b, c = (axis + 1) % 3, (axis + 2) % 3
            up, on = edge & 1, edge >> 1 & 1
            corner = up << b | on << c
            low = cases[v] >> corner & 1
            if low == cases[v] >> (corner | 1 << axis) & 1:
                continue
            owner = table[v, 2 * b + 1] if up else v
            owner = table[owner, 2 * c + 1] if on else owner
            rank = first[owner]
            for earlier in range(axis):
                rank += (cases[owner] ^ cases[owner] >> (1 << earlier)) & 1
            fans[v, n] = rank
            n += 1
            place = 2 * on + (up ^ on) if low else 2 * up + (up ^ on)
            along_b = (up ^ on) != low
            leaving[2 * b + up if along_b else 2 * c + on] = 4 * rank + place
            coming[2 * c + on if along_b else 2 * b + up] = 4 * rank + (place - 1 & 3)
        fans[v, n:] = -1
        for direction in range(6):
            if table[v, direction] >= 0:
                side = leaving[direction]
                twins[side >> 2, side & 3] = coming[direction]
