"""Triangles that share corners, and nothing else: nearly all of those whose boxes meet."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..compile import kernel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Rows = NDArray[np.float64]

ROUNDING = 4e-15
"""Largest error of the computed numbers here, over the squares of the sides that they are made of: of twenty-four
roundings at most."""


@kernel("b1(f8[:,::1], i8, i8, i8, i8)")
def turned_away(rows: Rows, one: int, p: int, other: int, q: int) -> bool:
    """Tell whether a plane through a corner that two triangles share, one's p and the other's q, parts all others.

    The plane that is upright on the line between the middles of their far sides: it is none only where the two are
    slim, or lie over each other.
    """
    a, b, c, d = one + (p == 0), one + 2 - (p == 2), other + (q == 0), other + 2 - (q == 2)
    at_a = at_b = at_c = at_d = squares = 0.0
    for axis in range(3):
        corner = rows[one + p, axis]
        ax, bx, cx, dx = rows[a, axis] - corner, rows[b, axis] - corner, rows[c, axis] - corner, rows[d, axis] - corner
        across = cx + dx - ax - bx
        at_a, at_b, at_c, at_d = at_a + across * ax, at_b + across * bx, at_c + across * cx, at_d + across * dx
        squares += ax * ax + bx * bx + cx * cx + dx * dx
    least = ROUNDING * squares
    return (max(at_a, at_b) < -least) & (min(at_c, at_d) > least)


@kernel("b1(f8[:,::1], i8, i8, i8, i8)")
def spread_out(rows: Rows, a: int, b: int, c: int, d: int) -> bool:
    """Tell whether two triangles that share the side of corners a and b, and have c and d too, turn less than square.

    By the product of their heights over that side (Lagrange's identity).
    """
    along = there = back = both = squares = 0.0
    for axis in range(3):
        e, x, y = rows[b, axis] - rows[a, axis], rows[c, axis] - rows[a, axis], rows[d, axis] - rows[a, axis]
        along, there, back, both = along + e * e, there + e * x, back + e * y, both + x * y
        squares += x * x + y * y
    return along * both - there * back < -ROUNDING * along * squares


@kernel("b1(i4[:,::1], i8, i8, f8[:,::1], i8, i8)")
def only_touch(faces: NDArray[np.int32], face: int, neighbor: int, rows: Rows, one: int, other: int) -> bool:
    """Tell whether two faces surely have no more in common than the corners that they share.

    Parameters
    ----------
    faces : (m, 3) int32 array
    face, neighbor : int
    rows : (r, 3) float array
        Corners of triangles.
    one, other : int
        The rows where those of the two faces begin.
    """
    shared, p, q, before, beyond = 0, 0, 0, 0, 0
    for i in range(3):
        for j in range(3):
            if faces[face, i] == faces[neighbor, j]:
                shared, before, beyond, p, q = shared + 1, p, q, i, j
    if shared == 1:
        return bool(turned_away(rows, one, p, other, q))
    if shared == 2:
        return bool(spread_out(rows, one + p, one + before, one + 3 - p - before, other + 3 - q - beyond))
    return False
