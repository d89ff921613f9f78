"""The springs of a net: averages over neighbors, and moves that stay within cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Numbers = NDArray[np.float64]
    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]
    Places = NDArray[np.uint32]
    Directions = NDArray[np.uint8]


@kernel("void(f8[:,::1], i4[:,::1], f8[:,::1], i8, i8)")
def mean_of(
    values: NDArray[np.float64], members: NDArray[np.int32], means: NDArray[np.float64], start: int, stop: int
) -> None:
    """Average rows of an array over lists of them.

    Parameters
    ----------
    values : (n, 3) float array
    members : (m, s) int32 array
        Rows of `values`; -1 stands for none.
    means : (m, 3) float array
        Result; 0 where there are none.
    start, stop : int
        Lists to work on.

    Notes
    -----
    The axes are summed side by side, which takes 0.4 of the time that a loop over them does.
    """
    for m in range(start, stop):
        x = y = z = 0.0
        count = 0
        for s in range(members.shape[1]):
            n = members[m, s]
            if n >= 0:
                x += values[n, 0]
                y += values[n, 1]
                z += values[n, 2]
                count += 1
        share = 1.0 / max(count, 1)
        means[m, 0], means[m, 1], means[m, 2] = x * share, y * share, z * share


@kernel("void(f8[::1], i4[:,::1], f8[::1], i8, i8)")
def mean_of_numbers(values: Numbers, members: Ints, means: Numbers, start: int, stop: int) -> None:
    """Average numbers (n,) over lists of them (m, s), see `mean_of`: (m,)."""
    for m in range(start, stop):
        total, count = 0.0, 0
        for s in range(members.shape[1]):
            n = members[m, s]
            if n >= 0:
                total, count = total + values[n], count + 1
        means[m] = total / max(count, 1)


@kernel("void(f8[:,::1], i4[:,::1], f8[:,::1], u1[::1], f8[::1], i8, i8)")
def fall_short(
    places: Floats, quads: Ints, crossings: Floats, directions: Directions, short: Numbers, start: int, stop: int
) -> None:
    """Find how far the middle of each square lies before its crossing, on the way out.

    Parameters
    ----------
    places : (n, 3) float array
        The vertices.
    quads : (q, 4) int32 array
    crossings : (q, 3) float array
    directions : (q,) uint8 array
        From inside to outside.
    short : (q,) float array
        Result.
    start, stop : int
        Squares to work on.
    """
    for f in range(start, stop):
        axis, sign = directions[f] >> 1, 1.0 if directions[f] & 1 else -1.0
        a, b, c, d = quads[f, 0], quads[f, 1], quads[f, 2], quads[f, 3]
        middle = 0.25 * (places[a, axis] + places[b, axis] + places[c, axis] + places[d, axis])
        short[f] = sign * (crossings[f, axis] - middle)


@kernel("void(f8[::1], u1[::1], i4[:,::1], f8[::1], f8[:,::1], i8, i8)")
def draw_out(
    lengths: Numbers, directions: Directions, fans: Ints, shares: Numbers, goals: Floats, start: int, stop: int
) -> None:
    """Move the goals (n, 3) of vertices by the mean over their squares (n, 6) of how far these (q,) are drawn out."""
    for v in range(start, stop):
        for s in range(fans.shape[1]):
            f = fans[v, s]
            if f >= 0:
                outward = shares[v] if directions[f] & 1 else -shares[v]
                goals[v, directions[f] >> 1] += outward * lengths[f]


@kernel("void(i4[:,::1], i4[:,::1], i4[:,::1], u4[:,::1], u4[:,::1], f8[::1], i8, i8)")
def list_rings(
    links: Ints, fans: Ints, quads: Ints, beside: Places, aslant: Places, shares: Numbers, start: int, stop: int
) -> None:
    """List the vertices around each one; it stands for itself where there are fewer than six.

    Parameters
    ----------
    links : (n, 6) int32 array
        Neighbors along the sides of squares; -1 for none.
    fans : (n, 6) int32 array
        The squares around each vertex, as many as it has neighbors, then -1.
    quads : (q, 4) int32 array
    beside, aslant : (n, 6) uint32 array
        Results: the neighbors, and the opposite corners of the squares.
    shares : (n,) float array
        Result: one over their number.
    start, stop : int
        Vertices to work on.
    """
    for v in range(start, stop):
        count = 0
        for s in range(6):
            n, f = links[v, s], fans[v, s]
            beside[v, s], aslant[v, s] = n if n >= 0 else v, v
            count += n >= 0
            for corner in range(4 if f >= 0 else 0):
                if quads[f, corner] == v:
                    aslant[v, s] = quads[f, corner + 2 & 3]
        shares[v] = 1.0 / count


@kernel("UniTuple(f8, 3)(f8[:,::1], u4[:,::1], f8, i8)")
def lean_of(values: Floats, around: Places, share: float, v: int) -> tuple[float, float, float]:
    """Return by how much the mean of what is around a vertex, see `list_rings`, is more than its own value (n, 3)."""
    a, b, c, d, e, f = around[v, 0], around[v, 1], around[v, 2], around[v, 3], around[v, 4], around[v, 5]
    x = (values[a, 0] + values[b, 0]) + (values[c, 0] + values[d, 0]) + (values[e, 0] + values[f, 0])
    y = (values[a, 1] + values[b, 1]) + (values[c, 1] + values[d, 1]) + (values[e, 1] + values[f, 1])
    z = (values[a, 2] + values[b, 2]) + (values[c, 2] + values[d, 2]) + (values[e, 2] + values[f, 2])
    return (x - 6 * values[v, 0]) * share, (y - 6 * values[v, 1]) * share, (z - 6 * values[v, 2]) * share


@kernel("void(f8[:,::1], u4[:,::1], f8[::1], f8[:,::1], i8, i8)")
def lean(values: Floats, around: Places, shares: Numbers, leaning: Floats, start: int, stop: int) -> None:
    """Find for each vertex by how much the mean of what is around is more, see `lean_of`."""
    for v in range(start, stop):
        leaning[v, 0], leaning[v, 1], leaning[v, 2] = lean_of(values, around, shares[v], v)


@kernel("void(f8[:,::1], f8[:,::1], u4[:,::1], f8[::1], f8, f8, f8[:,::1], i8, i8)")
def add_term(
    last: Floats, before: Floats, beside: Places, shares: Numbers, times: float, coefficient: float, total: Floats,
    start: int, stop: int,
) -> None:  # fmt: skip
    """Add the next term of a Chebyshev series in the mean over neighbors.

    Parameters
    ----------
    last, before : (n, 3) float array
        The last two terms; `before` becomes the next,  times mean(last) - (times - 1) before.
    beside, shares
        Of `list_rings`.
    times : float
        1 for the first term after the constant one, 2 for all others.
    coefficient : float
    total : (n, 3) float array
        Becomes more by that many times the next.
    start, stop : int
        Vertices to work on.
    """
    for v in range(start, stop):
        x, y, z = lean_of(last, beside, shares[v], v)
        before[v, 0] = times * (last[v, 0] + x) - (times - 1.0) * before[v, 0]
        before[v, 1] = times * (last[v, 1] + y) - (times - 1.0) * before[v, 1]
        before[v, 2] = times * (last[v, 2] + z) - (times - 1.0) * before[v, 2]
        total[v, 0] += coefficient * before[v, 0]
        total[v, 1] += coefficient * before[v, 1]
        total[v, 2] += coefficient * before[v, 2]


@kernel("UniTuple(f8, 3)(f8[:,::1], f8[:,::1], f8, f8, f8, f8, i8, i8)")
def moved_in_cell(
    places: Floats, moved: Floats, force: float, share: float, momentum: float, margin: float, v: int, axis: int
) -> tuple[float, float, float]:
    """Return where a vertex goes along an axis, see `move_in_cells`, how far that is, and how much more than last."""
    place = places[v, axis]
    last, low = place - moved[v, axis], np.floor(place)
    after = min(max(place + share * force + momentum * last, low + margin), low + (1.0 - margin))
    return after, after - place, after - place - last


@kernel(
    "void(f8[:,::1], f8[:,::1], u4[:,::1], u4[:,::1], f8[::1], f8[:,::1], b1, f8, f8, f8, f8, f8[:,::1], f8[::1], "
    "i8, i8)"
)
def move_in_cells(
    places: Floats, goals: Floats, beside: Places, aslant: Places, shares: Numbers, values: Floats, bends: bool,
    stiff: float, share: float, momentum: float, margin: float, moved: Floats, sums: Numbers, start: int, stop: int,
) -> None:  # fmt: skip
    """Move vertices by the pull of their squares and by what springs resist, but for what would leave their cells.

    The middles of a vertex' squares have the mean  (x + 2 mean x_j + mean x_k) / 4,  of its own place, its neighbors'
    and that of the squares' opposite corners; so no square is looked at.

    Parameters
    ----------
    places : (n, 3) float array
        Where the vertices are, within their cells, which begin at whole numbers.
    goals : (n, 3) float array
        Means of where their squares are drawn to.
    beside, aslant, shares
        Of `list_rings`.
    values, stiff
        What springs resist is so many times the mean of the neighbors' values (n, 3) less a vertex' own.
    bends : bool
        Whether the values are how the places lean, see `lean`; else they are the places.
    share : float
        Part of the forces' sum that a vertex goes.
    momentum : float
        Part of its last move by which it goes on.
    margin : float
        How far a vertex keeps from the faces of its cell.
    moved : (n, 3) float array
        Where they were before the last step; afterwards, where they are after this one.
    sums : (3,) float array
        Result over these vertices: longest move, its largest change since the last one, half the sum of squares.
    start, stop : int
        Vertices to work on.
    """
    longest, changed, energy = 0.0, 0.0, 0.0
    for v in range(start, stop):
        x, y, z = lean_of(values, beside, shares[v], v)
        a, b, c = lean_of(places, aslant, shares[v], v)
        p, q, r = (values[v, 0], values[v, 1], values[v, 2]) if bends else (x, y, z)
        x = goals[v, 0] - places[v, 0] - 0.25 * (2.0 * p + a) + stiff * x
        y = goals[v, 1] - places[v, 1] - 0.25 * (2.0 * q + b) + stiff * y
        z = goals[v, 2] - places[v, 2] - 0.25 * (2.0 * r + c) + stiff * z
        x, p, a = moved_in_cell(places, moved, x, share, momentum, margin, v, 0)
        y, q, b = moved_in_cell(places, moved, y, share, momentum, margin, v, 1)
        z, r, c = moved_in_cell(places, moved, z, share, momentum, margin, v, 2)
        moved[v, 0], moved[v, 1], moved[v, 2] = x, y, z
        speed = p * p + q * q + r * r
        longest, changed, energy = max(longest, speed), max(changed, a * a + b * b + c * c), energy + 0.5 * speed
    sums[0], sums[1], sums[2] = np.sqrt(longest), np.sqrt(changed), energy


@kernel("void(b1[:,:,::1], i4[:,::1], i4[:,::1], i8, b1[::1], i8, i8)")
def end_soon(
    mask: NDArray[np.bool_],
    inner: NDArray[np.int32],
    steps: NDArray[np.int32],
    depth: int,
    found: NDArray[np.bool_],
    start: int,
    stop: int,
) -> None:
    """Tell which voxels (q, 3) have one outside, or the mask's end, within so many steps (q, 3) back.

    Parameters
    ----------
    mask : (K, J, I) bool array
    inner, steps : (q, 3) int32 array
        As (x, y, z).
    depth : int
    found : (q,) bool array
        Result.
    start, stop : int
        Voxels to work on.
    """
    for f in range(start, stop):
        found[f] = False
        for n in range(1, depth + 1):
            x, y, z = inner[f, 0] - n * steps[f, 0], inner[f, 1] - n * steps[f, 1], inner[f, 2] - n * steps[f, 2]
            within = 0 <= x < mask.shape[2] and 0 <= y < mask.shape[1] and 0 <= z < mask.shape[0]
            if not within or not mask[z, y, x]:
                found[f] = True
                break
