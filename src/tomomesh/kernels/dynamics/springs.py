"""Loops along the sides of squares: means of neighbors, and the steps of a mesh that is drawn to feet."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]


@kernel("void(i4[:,::1], i8[::1], i4[::1])")
def list_neighbors(quads: NDArray[np.int32], start: Integers, neighbors: NDArray[np.int32]) -> None:
    """List the neighbors of each vertex along the sides of the squares.

    Parameters
    ----------
    quads : (q, 4) int32 array
        A closed 2-manifold: every side belongs to two squares, which run through it in opposite directions.
    start : (n + 1,) int64 array
        Where the neighbors of each vertex begin, from the number of squares around it.
    neighbors : (4q,) int32 array
        Result.
    """
    filled = np.zeros(len(start) - 1, np.int32)
    for q in range(len(quads)):
        for corner in range(4):
            v = quads[q, corner]
            neighbors[start[v] + filled[v]] = quads[q, (corner + 1) % 4]
            filled[v] += 1


@kernel("void(f8[:,::1], i8[::1], i4[::1], f8, f8[:,::1], i8, i8)")
def average(
    vertices: Floats,
    start: Integers,
    neighbors: NDArray[np.int32],
    share: float,
    result: Floats,
    begin: int,
    end: int,
) -> None:
    """Move each vertex a share of the way to the mean of its neighbors.

    Parameters
    ----------
    vertices : (n, 3) float array
    start, neighbors : arrays
        From `list_neighbors`.
    share : float
    result : (n, 3) float array
    begin, end : int
        Vertices to work on.
    """
    for v in range(begin, end):
        count = start[v + 1] - start[v]
        for axis in range(3):
            total = 0.0
            for n in range(start[v], start[v + 1]):
                total += vertices[neighbors[n], axis]
            result[v, axis] = vertices[v, axis] + share * (total / count - vertices[v, axis])


@kernel(
    "void(f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], i8[::1], i4[::1], f8[::1], f8[:,::1], f8[::1], i8, i8)"
)
def advance(
    places: Floats,
    velocities: Floats,
    origins: Floats,
    feet: Floats,
    anchors: Floats,
    start: Integers,
    neighbors: NDArray[np.int32],
    rates: Floats,
    result: Floats,
    sums: Floats,
    begin: int,
    end: int,
) -> None:
    """Take one step of the dynamic mesh: x += h x', x' += h x'' (eq. 5-7, explicit Euler).

    The attraction acts along the normal of the foot. The springs act within the surface there, so that they even
    the mesh out and shrink nothing: those to the neighbors, and one to where the vertex came from, without which
    the mesh would creep for ever. Where a vertex has no foot its springs act in all directions.

    Parameters
    ----------
    places, velocities, origins : (n, 3) float arrays
        Position and velocity of each vertex, and where it came from; the velocities are changed in place.
    feet : (n, 4) float array
        Height over the surface at the anchor, and its unit normal there; zeros where there is no foot.
    anchors : (n, 3) float array
        Where each foot was sought.
    start, neighbors : arrays
        From `list_neighbors`.
    rates : (5,) float array
        Time step, damping over critical damping, longest step that a vertex may take, stiffness of the spring to
        where it came from over that of all others, and the speed from which a vertex counts as moving.
    result : (n, 3) float array
        The positions after the step.
    sums : (8,) float array
        Result over these vertices: largest speed, largest acceleration; the sums of kinetic energy, potential
        energy and height; how many were slowed, have no foot, and still move.
    begin, end : int
        Vertices to work on.
    """
    h, damping, limit, hold = rates[0], rates[1], rates[2], rates[3]
    pull, total = np.empty(3), np.empty(3)
    sums[:] = 0.0
    for v in range(begin, end):
        count = start[v + 1] - start[v]
        along = feet[v, 0]
        tension = speed = change = drawn = 0.0
        total[:] = 0.0
        for n in range(start[v], start[v + 1]):
            for axis in range(3):
                total[axis] += places[neighbors[n], axis]
        for axis in range(3):
            pull[axis] = (total[axis] / count + hold * origins[v, axis]) / (1 + hold) - places[v, axis]
            along += feet[v, 1 + axis] * (places[v, axis] - anchors[v, axis])
            tension += feet[v, 1 + axis] * pull[axis]
            drawn += feet[v, 1 + axis] ** 2
        for axis in range(3):
            pull[axis] -= tension * feet[v, 1 + axis]
            sums[3] += 0.5 * pull[axis] ** 2
            pull[axis] -= along * feet[v, 1 + axis] + 2 * damping * velocities[v, axis]
            speed += velocities[v, axis] ** 2
            change += pull[axis] ** 2
        slow = min(1.0, limit / max(h * np.sqrt(speed), 1e-300))
        sums[0] = max(sums[0], slow * np.sqrt(speed))
        sums[1] = max(sums[1], np.sqrt(change))
        sums[2] += 0.5 * slow * slow * speed
        sums[3] += 0.5 * along * along
        sums[4] += abs(along)
        sums[5] += slow < 1.0
        sums[6] += drawn == 0.0
        sums[7] += max(speed, change) > rates[4] ** 2
        for axis in range(3):
            velocity = slow * velocities[v, axis]
            result[v, axis] = places[v, axis] + h * velocity
            velocities[v, axis] = velocity + h * pull[axis]
