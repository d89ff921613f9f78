"""Loops over the cells between the voxels of a label map, and over the squares between voxels of different labels.

An edge of a cell is the line between two of its voxels. Edges are numbered 4 a + u + 2 o: along axis a from the corner
that lies u up along the next axis and o along the one after. In the code of a cell, bit n is set where the two ends of
edge n differ, and bit n + 12 where the lower end has the larger label: a square lies before it, seen from the voxel of
the larger label. Directions and corners are numbered as in `tomomesh.kernels.isosurface.voxels`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Labels = NDArray[np.uint16]
    Ints = NDArray[np.int32]
    Codes = NDArray[np.uint32]


@kernel("i8(u4, i8)")
def bit(code: int, n: int) -> int:
    """Return a bit of a code as a signed number."""
    return int(code) >> n & 1


@kernel("b1(u2[:,:,::1], i8, i8, i8)")
def is_mixed(labels: Labels, z: int, y: int, x: int) -> bool:
    """Tell whether the eight voxels of a cell are not all of one label."""
    one = labels[z, y, x]
    near = one != labels[z, y, x + 1] or one != labels[z, y + 1, x] or one != labels[z, y + 1, x + 1]
    if near or one != labels[z + 1, y, x] or one != labels[z + 1, y, x + 1]:
        return True
    return bool(one != labels[z + 1, y + 1, x] or one != labels[z + 1, y + 1, x + 1])


@kernel("u4(u2[:,:,::1], i8, i8, i8)")
def code_of(labels: Labels, z: int, y: int, x: int) -> int:
    """Return the code of a cell."""
    code = 0
    for edge in range(12):
        axis = edge >> 2
        corner = (edge & 1) << (axis + 1) % 3 | (edge >> 1 & 1) << (axis + 2) % 3
        other = corner | 1 << axis
        one = labels[z + (corner >> 2), y + (corner >> 1 & 1), x + (corner & 1)]
        two = labels[z + (other >> 2), y + (other >> 1 & 1), x + (other & 1)]
        code |= (1 if one != two else 0) << edge | (1 if one > two else 0) << (edge + 12)
    return code


@kernel("void(u2[:,:,::1], i8[::1], i8, i8)")
def count_mixed(labels: Labels, count: NDArray[np.int64], start: int, stop: int) -> None:
    """Count the mixed cells in each layer between two slices.

    Parameters
    ----------
    labels : (K, J, I) uint16 array
    count : (K - 1,) int64 array
        Result.
    start, stop : int
        Layers to work on.
    """
    for z in range(start, stop):
        found = 0
        for y in range(labels.shape[1] - 1):
            for x in range(labels.shape[2] - 1):
                found += is_mixed(labels, z, y, x)
        count[z] = found


@kernel("void(u2[:,:,::1], i8[::1], i4[:,::1], u4[::1], i8, i8)")
def list_mixed(
    labels: Labels, first: NDArray[np.int64], cells: Ints, codes: Codes, start: int, stop: int
) -> None:  # fmt: skip
    """List the mixed cells in the order of z, then y, then x.

    Parameters
    ----------
    labels, start, stop
        As in `count_mixed`.
    first : (K - 1,) int64 array
        Cells in the layers before.
    cells : (n, 3) int32 array
        Result: the voxel (x, y, z) in the lowest corner of each cell.
    codes : (n,) uint32 array
        Result.
    """
    for z in range(start, stop):
        n = first[z]
        for y in range(labels.shape[1] - 1):
            for x in range(labels.shape[2] - 1):
                if is_mixed(labels, z, y, x):
                    cells[n, 0], cells[n, 1], cells[n, 2] = x, y, z
                    codes[n] = code_of(labels, z, y, x)
                    n += 1


@kernel("void(u2[:,:,::1], i4[:,::1], u1[::1], b1[::1], i8, i8)")
def find_contacts(
    labels: Labels, cells: Ints, joining: NDArray[np.uint8], found: NDArray[np.bool_], start: int, stop: int
) -> None:
    """Tell in which cells voxels of a label other than 0 touch along an edge or at a corner alone.

    Parameters
    ----------
    labels : (K, J, I) uint16 array
    cells : (n, 3) int32 array
    joining : (256,) uint8 array
        Not 0 for the cases of a label's corners, as bits, that have a contact.
    found : (n,) bool array
        Result.
    start, stop : int
        Cells to work on.
    """
    corners = np.zeros(8, np.int64)
    for v in range(start, stop):
        x, y, z = cells[v, 0], cells[v, 1], cells[v, 2]
        for n in range(8):
            corners[n] = labels[z + (n >> 2), y + (n >> 1 & 1), x + (n & 1)]
        found[v] = False
        for n in range(8):
            case = 0
            for other in range(8):
                case |= (1 if corners[other] == corners[n] else 0) << other
            found[v] |= corners[n] > 0 and joining[case] > 0


@kernel("void(i4[:,::1], u4[::1], i4[:,::1], i8[::1], i4[:,::1], i4[:,::1], u1[::1], i8, i8)")
def list_squares(
    cells: Ints, codes: Codes, table: Ints, first: NDArray[np.int64], quads: Ints, inner: Ints,
    directions: NDArray[np.uint8], start: int, stop: int,
) -> None:  # fmt: skip
    """List the squares between voxels of different labels.

    Parameters
    ----------
    cells : (n, 3) int32 array
        The voxel (x, y, z) in the lowest corner of each cell.
    codes : (n,) uint32 array
    table : (n, 6) int32 array
        Neighboring cells by direction.
    first : (n,) int64 array
        Squares of the cells before: a cell owns those before its lowest corner.
    quads : (q, 4) int32 array
        Result: the cells around, counter-clockwise seen from the smaller label where the axes are right-handed.
    inner : (q, 3) int32 array
        Result: the voxel of the larger label.
    directions : (q,) uint8 array
        Result: the direction from it to the other.
    start, stop : int
        Cells to work on.
    """
    for v in range(start, stop):
        f = first[v]
        for axis in range(3):
            if not bit(codes[v], 4 * axis):
                continue
            low = bit(codes[v], 4 * axis + 12)
            before, beside = table[v, 2 * ((axis + 1) % 3)], table[v, 2 * ((axis + 2) % 3)]
            quads[f, 0] = v
            quads[f, 1] = before if low else beside
            quads[f, 2] = table[before, 2 * ((axis + 2) % 3)]
            quads[f, 3] = beside if low else before
            inner[f, 0], inner[f, 1], inner[f, 2] = cells[v, 0], cells[v, 1], cells[v, 2]
            inner[f, axis] += 1 - low
            directions[f] = 2 * axis + low
            f += 1


@kernel("i8(u4[::1], i4[:,::1], i8[::1], i8, i8)")
def square_before(codes: Codes, table: Ints, first: NDArray[np.int64], v: int, edge: int) -> int:
    """Return the number of the square before an edge of a cell, whose two ends differ; see `list_squares`."""
    axis = edge >> 2
    owner = table[v, 2 * ((axis + 1) % 3) + 1] if edge & 1 else v
    owner = table[owner, 2 * ((axis + 2) % 3) + 1] if edge >> 1 & 1 else owner
    rank = first[owner]
    for earlier in range(axis):
        rank += bit(codes[owner], 4 * earlier)
    return int(rank)


@kernel("void(u4[::1], i4[:,::1], i8[::1], u1[::1], i4[:,::1], i4[:,::1], i8, i8)")
def list_sheets(
    codes: Codes, table: Ints, first: NDArray[np.int64], junctions: NDArray[np.uint8], fans: Ints, twins: Ints,
    start: int, stop: int,
) -> None:  # fmt: skip
    """List the squares around every cell that lies in one wall, and those beyond the sides of each.

    Parameters
    ----------
    codes, table, first, start, stop
        As in `list_squares`.
    junctions : (n,) uint8 array
        Bit n is set where three walls or more meet in the side of the cell in direction n.
    fans : (n, 6) int32 array
        Result: the squares that have the cell as a corner, then -1; none where walls meet.
    twins : (q, 4) int32 array
        Result: as `tomomesh.kernels.isosurface.voxels.list_fans` writes it, but sides where walls meet are left alone.
    """
    leaving, coming = np.zeros(6, np.int64), np.zeros(6, np.int64)
    for v in range(start, stop):
        n = 0
        fans[v, :] = -1
        for edge in range(12):
            if not bit(codes[v], edge):
                continue
            rank = square_before(codes, table, first, v, edge)
            if junctions[v] == 0:
                fans[v, n] = rank
            n += 1
            low, up, on = bit(codes[v], edge + 12), edge & 1, edge >> 1 & 1
            b, c = ((edge >> 2) + 1) % 3, ((edge >> 2) + 2) % 3
            place = 2 * on + (up ^ on) if low else 2 * up + (up ^ on)
            along_b = (up ^ on) != low
            leaving[2 * b + up if along_b else 2 * c + on] = 4 * rank + place
            coming[2 * c + on if along_b else 2 * b + up] = 4 * rank + (place - 1 & 3)
        for direction in range(6):
            if table[v, direction] >= 0 and not bit(junctions[v], direction):
                side = leaving[direction]
                twins[side >> 2, side & 3] = coming[direction]


@kernel("void(u2[:,:,::1], i4[:,::1], i4[:,::1], i8, b1[::1], i8, i8)")
def end_within(
    labels: Labels, places: Ints, steps: Ints, depth: int, found: NDArray[np.bool_], start: int, stop: int
) -> None:
    """Tell which voxels (q, 3) have one of another label, or the map's end, within so many steps (q, 3).

    Parameters
    ----------
    labels : (K, J, I) uint16 array
    places, steps : (q, 3) int32 array
        As (x, y, z).
    depth : int
    found : (q,) bool array
        Result.
    start, stop : int
        Voxels to work on.
    """
    for f in range(start, stop):
        own = labels[places[f, 2], places[f, 1], places[f, 0]]
        found[f] = False
        for n in range(1, depth + 1):
            x, y, z = places[f, 0] + n * steps[f, 0], places[f, 1] + n * steps[f, 1], places[f, 2] + n * steps[f, 2]
            within = 0 <= x < labels.shape[2] and 0 <= y < labels.shape[1] and 0 <= z < labels.shape[0]
            if not within or labels[z, y, x] != own:
                found[f] = True
                break
