"""The springs of a net: averages over neighbors, and moves that stay within cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]


@kernel("void(f8[:,::1], i4[:,::1], f8[:,::1], i8, i8)")
def mean_of(
    values: NDArray[np.float64], members: NDArray[np.int32], means: NDArray[np.float64], start: int, stop: int
) -> None:
    """Average rows of an array over lists of them.

    Parameters
    ----------
    values : (n, 3) float array
    members : (m, s) int32 array
        Rows of `values`, one at least; -1 stands for none.
    means : (m, 3) float array
        Result.
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
        share = 1.0 / count
        means[m, 0], means[m, 1], means[m, 2] = x * share, y * share, z * share


@kernel("void(f8[:,::1], i4[:,::1], f8[:,::1], f8[:,::1], i8, i8)")
def pull_squares(places: Floats, quads: Ints, pulls: Floats, drawn: Floats, start: int, stop: int) -> None:
    """Find how far the middle of each square is from the place that it is drawn to.

    Parameters
    ----------
    places : (n, 3) float array
        The vertices.
    quads : (q, 4) int32 array
    pulls : (q, 3) float array
    drawn : (q, 3) float array
        Result.
    start, stop : int
        Squares to work on.
    """
    for f in range(start, stop):
        a, b, c, d = quads[f, 0], quads[f, 1], quads[f, 2], quads[f, 3]
        for axis in range(3):
            middle = places[a, axis] + places[b, axis] + places[c, axis] + places[d, axis]
            drawn[f, axis] = pulls[f, axis] - 0.25 * middle


@kernel("UniTuple(f8, 3)(f8[:,::1], i4[:,::1], i8)")
def lean_of(values: Floats, links: Ints, v: int) -> tuple[float, float, float]:
    """Return by how much the mean of a vertex' neighbors (n, 6) is more than its own value (n, 3)."""
    x = y = z = 0.0
    count = 0
    for s in range(links.shape[1]):
        n = links[v, s]
        if n >= 0:
            x, y, z, count = x + values[n, 0], y + values[n, 1], z + values[n, 2], count + 1
    share = 1.0 / count
    return x * share - values[v, 0], y * share - values[v, 1], z * share - values[v, 2]


@kernel("void(f8[:,::1], i4[:,::1], f8[:,::1], i8, i8)")
def lean(values: Floats, links: Ints, leaning: Floats, start: int, stop: int) -> None:
    """Find for each vertex by how much the mean of its neighbors is more, see `lean_of`."""
    for v in range(start, stop):
        leaning[v, 0], leaning[v, 1], leaning[v, 2] = lean_of(values, links, v)


@kernel(
    "void(f8[:,::1], f8[:,::1], i4[:,::1], f8[:,::1], i4[:,::1], f8, f8, f8[:,::1], f8, f8[:,::1], f8[:,::1], "
    "f8[::1], i8, i8)"
)
def move_in_cells(
    places: Floats, drawn: Floats, fans: Ints, values: Floats, links: Ints, stiff: float, share: float, low: Floats,
    margin: float, moves: Floats, moved: Floats, sums: NDArray[np.float64], start: int, stop: int,
) -> None:  # fmt: skip
    """Move vertices by the pull of their squares and by what springs resist, but for what would leave their cells.

    Parameters
    ----------
    places : (n, 3) float array
        Where the vertices are.
    drawn : (q, 3) float array
        See `pull_squares`.
    fans : (n, 6) int32 array
        The squares around each vertex, then -1.
    values, links, stiff
        What springs resist is so many times the mean of the neighbors' values (n, 3) less a vertex' own.
    share : float
        Part of the forces' sum that a vertex goes.
    low : (n, 3) float array
        Lowest corners of their cells, whose edge is 1.
    margin : float
        How far a vertex keeps from the faces of its cell.
    moves : (n, 3) float array
        How far each moved last; afterwards, how far it moves now.
    moved : (n, 3) float array
        Result: where they are then.
    sums : (3,) float array
        Result over these vertices: longest move, its largest change since the last one, half the sum of squares.
    start, stop : int
        Vertices to work on.
    """
    force = np.empty(3)
    longest, changed, energy = 0.0, 0.0, 0.0
    for v in range(start, stop):
        x = y = z = 0.0
        count = 0
        for s in range(fans.shape[1]):
            f = fans[v, s]
            if f < 0:
                break
            x, y, z, count = x + drawn[f, 0], y + drawn[f, 1], z + drawn[f, 2], count + 1
        part = 1.0 / count
        force[0], force[1], force[2] = x * part, y * part, z * part
        x, y, z = lean_of(values, links, v)
        force[0], force[1], force[2] = force[0] + x * stiff, force[1] + y * stiff, force[2] + z * stiff
        speed = change = 0.0
        for axis in range(3):
            place = places[v, axis] + force[axis] * share
            place = min(max(place, low[v, axis] + margin), low[v, axis] + (1 - margin))
            move = place - places[v, axis]
            speed += move * move
            change += (move - moves[v, axis]) ** 2
            moved[v, axis], moves[v, axis] = place, move
        longest, changed, energy = max(longest, speed), max(changed, change), energy + 0.5 * speed
    sums[0], sums[1], sums[2] = np.sqrt(longest), np.sqrt(changed), energy
