"""Loops over sparse sets of cubes, 8 x 8 x 8 to a block and one bit to a cube.

A *bitmask* is a (b + s, 8) uint64 array: one word for each plane of a block, bit 8 y + x of word z for its cube
(x, y, z). The last s rows stand for the pieces of space that have no blocks: the first is all that lies outside the
objects, and each of the others is inside one. A table (b, 27) of rows tells the neighbors of each block, in the
order of `tomomesh.cuberille.neighbors.OFFSETS`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Bitmask = NDArray[np.uint64]
    Table = NDArray[np.int32]

ONE, EIGHT, SEVEN, LONG = np.uint64(1), np.uint64(8), np.uint64(7), np.uint64(56)
"""Steps within a word of 8 x 8 cubes: to the next along x, the next along y, and to the other end of either."""
FIRST_COLUMN, LAST_COLUMN = np.uint64(0x0101010101010101), np.uint64(0x8080808080808080)
"""The cubes of x = 0 and of x = 7."""
PAIRS, FOURS, EIGHTS = np.uint64(0x5555555555555555), np.uint64(0x3333333333333333), np.uint64(0x0F0F0F0F0F0F0F0F)
"""Every other bit, two bits and four bits: bits are counted in pairs, fours and eights (Warren 2002)."""
TWO, FOUR = np.uint64(2), np.uint64(4)
"""Bits by which those are moved."""
FIRST_ROW, ZERO, ALL = np.uint64(0xFF), np.uint64(0), np.uint64(0xFFFFFFFFFFFFFFFF)
"""The cubes of y = 0, none, and all."""


@kernel("i8(u8)")
def popcount(word: np.uint64) -> int:
    """Count the bits of a word."""
    word = word - ((word >> ONE) & PAIRS)
    word = (word & FOURS) + ((word >> TWO) & FOURS)
    word = (word + (word >> FOUR)) & EIGHTS
    word = word + (word >> EIGHT)
    word = word + (word >> np.uint64(16))
    word = word + (word >> np.uint64(32))
    return int(word & np.uint64(127))


@kernel("u8(u8, u8, i8)")
def along_x(word: np.uint64, beyond: np.uint64, step: int) -> np.uint64:
    """Return for every cube of a word its neighbor at x + step; `beyond` is the word of the block there."""
    if step == 1:
        return ((word & ~FIRST_COLUMN) >> ONE) | ((beyond & FIRST_COLUMN) << SEVEN)
    if step == -1:
        return ((word & ~LAST_COLUMN) << ONE) | ((beyond & LAST_COLUMN) >> SEVEN)
    return word


@kernel("u8(u8, u8, i8)")
def along_y(word: np.uint64, beyond: np.uint64, step: int) -> np.uint64:
    """Return for every cube of a word its neighbor at y + step; `beyond` is the word of the block there."""
    if step == 1:
        return (word >> EIGHT) | (beyond << LONG)
    if step == -1:
        return (word << EIGHT) | (beyond >> LONG)
    return word


@kernel("u8(u8[:,::1], i4[:,::1], i8, i8, i8, i8, i8)")
def neighbor(bitmask: Bitmask, table: Table, block: int, z: int, dx: int, dy: int, dz: int) -> np.uint64:
    """Return for the cubes of one word their neighbors at (x + dx, y + dy, z + dz), steps of -1, 0 or 1."""
    plane = z + dz
    column = 13 + 9 * (plane >> 3)
    plane &= 7
    here = along_y(bitmask[table[block, column], plane], bitmask[table[block, column + 3 * dy], plane], dy)
    if dx == 0:
        return here
    side = column + dx
    return along_x(
        here, along_y(bitmask[table[block, side], plane], bitmask[table[block, side + 3 * dy], plane], dy), dx
    )


@kernel("void(u8[:,::1], i4[:,::1], i8, u8[:,::1], i8, i8)")
def grow_along(bitmask: Bitmask, table: Table, axis: int, grown: Bitmask, begin: int, end: int) -> None:
    """Add the two neighbors of every cube along one axis; three axes make a box.

    Parameters
    ----------
    bitmask : (b + s, 8) uint64 array
    table : (b, 27) int32 array
    axis : int
        0, 1, 2 for x, y, z.
    grown : (b + s, 8) uint64 array
        Result.
    begin, end : int
        Blocks to work on.
    """
    dx, dy, dz = int(axis == 0), int(axis == 1), int(axis == 2)
    for b in range(begin, end):
        for z in range(8):
            both = neighbor(bitmask, table, b, z, dx, dy, dz) | neighbor(bitmask, table, b, z, -dx, -dy, -dz)
            grown[b, z] = bitmask[b, z] | both


@kernel("b1(u8[:,::1], i4[:,::1], u8[:,::1], i8)")
def flood_block(open_: Bitmask, table: Table, reached: Bitmask, b: int) -> bool:
    """Flood one block to its end; tell whether anything in it changed."""
    changed, again = False, True
    while again:
        again = False
        for z in range(8):
            word = reached[b, z]
            sides = neighbor(reached, table, b, z, 1, 0, 0) | neighbor(reached, table, b, z, -1, 0, 0)
            sides |= neighbor(reached, table, b, z, 0, 1, 0) | neighbor(reached, table, b, z, 0, -1, 0)
            sides |= neighbor(reached, table, b, z, 0, 0, 1) | neighbor(reached, table, b, z, 0, 0, -1)
            grown = word | (sides & open_[b, z])
            if grown != word:
                reached[b, z] = grown
                again = changed = True
    return changed


@kernel("b1(u8[:,::1], i8, i8)")
def touches(reached: Bitmask, b: int, column: int) -> bool:
    """Tell whether a block is reached along the side that a column of its table stands for."""
    if column == 4 or column == 22:
        return bool(reached[b, 7 * (column > 13)] != ZERO)
    side = LAST_COLUMN if column == 14 else FIRST_COLUMN
    if column == 10 or column == 16:
        side = FIRST_ROW << (LONG if column == 16 else ZERO)
    touched = ZERO
    for z in range(8):
        touched |= reached[b, z] & side
    return bool(touched != ZERO)


@kernel("void(u8[:,::1], i4[:,::1], u8[:,::1], b1[::1], i8[::1], i8[::1], i8)")
def flood(
    open_: Bitmask,
    table: Table,
    reached: Bitmask,
    waiting: NDArray[np.bool_],
    queue: NDArray[np.int64],
    line: NDArray[np.int64],
    most: int,
) -> None:
    """Walk over faces from the cubes that are reached to open ones, for some blocks of those that wait.

    Parameters
    ----------
    open_ : (b + s, 8) uint64 array
        Cubes that may be entered.
    table : (b, 27) int32 array
    reached : (b + s, 8) uint64 array
        Where to start, the rows for space without blocks among it. Result: what is reached; all, once none waits.
    waiting : (b,) bool array
        The blocks that wait: all on entry. Changed in place, as the next two.
    queue : (b,) int64 array
        A ring of those that wait, in their order.
    line : (2,) int64 array
        Where the first of them stands, and how many there are.
    most : int
        Blocks to work on.

    Notes
    -----
    A block is worked on until nothing in it changes, and again whenever a neighbor of it has changed.
    """
    count = len(table)
    head, length = line[0], line[1]
    for _ in range(most):
        if length == 0:
            break
        b = queue[head]
        head, length = (head + 1) % count, length - 1
        waiting[b] = False
        if not flood_block(open_, table, reached, b):
            continue
        for column in (4, 10, 12, 14, 16, 22):
            there = table[b, column]
            if there < count:
                if not waiting[there]:
                    waiting[there] = True
                    queue[(head + length) % count] = there
                    length += 1
            elif reached[there, 0] == ZERO and open_[there, 0] == ALL and touches(reached, b, column):
                reached[there] = ALL
                for any_ in range(count):
                    if not waiting[any_]:
                        waiting[any_] = True
                        queue[(head + length) % count] = any_
                        length += 1
    line[0], line[1] = head, length


@kernel("i8(u8[:,::1], i4[:,::1], u8[:,::1], u8[:,::1], i8, i8)")
def compose(solid: Bitmask, table: Table, near: Bitmask, filled: Bitmask, begin: int, end: int) -> int:
    """Fill every contact along an edge only or at a corner only, once (Latecki 1997).

    Parameters
    ----------
    solid : (b + s, 8) uint64 array
    table : (b, 27) int32 array
    near : (b + s, 8) uint64 array
        Empty cubes among whose 26 neighbors are solid ones.
    filled : (b + s, 8) uint64 array
        `solid` on entry. Result: the same and the cubes added.
    begin, end : int
        Blocks to work on.

    Returns
    -------
    int
        Cubes added.

    Notes
    -----
    An empty cube is filled where it is one of the two empty cubes of a 2 x 2 square whose others are solid
    across the diagonal; one of the two opposite empty corners of a 2 x 2 x 2 block; or one of the six empty cubes
    of a block of which two opposite corners alone are solid.
    """
    added = 0
    for b in range(begin, end):
        for z in range(8):
            if near[b, z] == ZERO:
                continue
            fill = ZERO
            for dz in (-1, 1):
                up = neighbor(solid, table, b, z, 0, 0, dz)
                for dy in (-1, 1):
                    side = neighbor(solid, table, b, z, 0, dy, 0)
                    slope = neighbor(solid, table, b, z, 0, dy, dz)
                    fill |= side & up & ~slope
                    for dx in (-1, 1):
                        ahead = neighbor(solid, table, b, z, dx, 0, 0)
                        turn = neighbor(solid, table, b, z, dx, dy, 0)
                        rise = neighbor(solid, table, b, z, dx, 0, dz)
                        corner = neighbor(solid, table, b, z, dx, dy, dz)
                        fill |= (ahead & side & ~turn) | (ahead & up & ~rise)
                        fill |= ahead & side & up & slope & turn & rise & ~corner
                        fill |= ahead & slope & ~(side | up | turn | rise | corner)
                        fill |= side & rise & ~(ahead | up | turn | slope | corner)
                        fill |= up & turn & ~(ahead | side | slope | rise | corner)
            fill &= near[b, z]
            filled[b, z] = solid[b, z] | fill
            added += popcount(fill)
    return added


@kernel("void(u8[:,::1], i8[:,::1], i8[:,::1], i8[:,::1])")
def list_cubes(
    bitmask: Bitmask, blocks: NDArray[np.int64], before: NDArray[np.int64], cells: NDArray[np.int64]
) -> None:
    """List the cubes of a bitmask, block by block.

    Parameters
    ----------
    bitmask : (b + s, 8) uint64 array
    blocks : (b, 3) int64 array
        Positions (x, y, z) of the blocks, in blocks.
    before : (b, 8) int64 array
        Cubes before each word.
    cells : (c, 3) int64 array
        Result: positions (x, y, z).
    """
    for b in range(len(blocks)):
        for z in range(8):
            word, n = bitmask[b, z], before[b, z]
            while word != ZERO:
                bit = popcount((word & (~word + ONE)) - ONE)
                cells[n, 0] = 8 * blocks[b, 0] + (bit & 7)
                cells[n, 1] = 8 * blocks[b, 1] + (bit >> 3)
                cells[n, 2] = 8 * blocks[b, 2] + z
                word &= word - ONE
                n += 1
