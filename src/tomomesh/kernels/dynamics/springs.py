"""Loops along the sides of squares: means of neighbors, and the steps of a mesh that is drawn to a surface."""

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
    own: float,
    result: Floats,
    begin: int,
    end: int,
) -> None:
    """Move each vertex to a weighted mean of itself and its neighbors.

    Parameters
    ----------
    vertices : (n, 3) float array
    start, neighbors : arrays
        The neighbors of vertex v are ``neighbors[start[v]:start[v + 1]]``.
    own : float
        Weight of the vertex itself; its neighbors share the rest.
    result : (n, 3) float array
    begin, end : int
        Vertices to work on.
    """
    for v in range(begin, end):
        share = (1 - own) / (start[v + 1] - start[v])
        for axis in range(3):
            total = 0.0
            for n in range(start[v], start[v + 1]):
                total += vertices[neighbors[n], axis]
            result[v, axis] = own * vertices[v, axis] + share * total


@kernel(
    "void(f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], i8[::1], i4[::1], f8[::1], f8[:,::1], f8[::1], i8, i8)"
)
def advance(
    places: Floats,
    velocities: Floats,
    origins: Floats,
    projections: Floats,
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

    The attraction acts along the normal of the surface. The springs act within it, so that they even the mesh out and
    shrink nothing: those to the neighbors, and one to where the vertex was held, without which the mesh would creep
    for ever. Where a vertex has no projection its springs act in all directions.

    Parameters
    ----------
    places, velocities, origins : (n, 3) float arrays
        Position and velocity of each vertex, and where it is held; the velocities are changed in place.
    projections : (n, 4) float array
        Height over the surface at the anchor, and its unit normal there; zeros where there is none.
    anchors : (n, 3) float array
        Where each vertex was projected.
    start, neighbors : arrays
        From `list_neighbors`.
    rates : (4,) float array
        Time step, damping over critical damping, longest step that a vertex may take, and the share that the spring
        to where the vertex is held has of the stiffness of all its springs.
    result : (n, 3) float array
        The positions after the step.
    sums : (7,) float array
        Result over these vertices: largest speed, largest acceleration; the sums of kinetic energy, potential
        energy and height; how many were slowed, and how many have no projection.
    begin, end : int
        Vertices to work on.
    """
    h, damping, limit, restoring = rates[0], rates[1], rates[2], rates[3]
    pull, total = np.empty(3), np.empty(3)
    sums[:] = 0.0
    for v in range(begin, end):
        count = start[v + 1] - start[v]
        along = projections[v, 0]
        tension = speed = change = drawn = 0.0
        total[:] = 0.0
        for n in range(start[v], start[v + 1] if restoring < 1.0 else start[v]):
            for axis in range(3):
                total[axis] += places[neighbors[n], axis]
        for axis in range(3):
            speed += velocities[v, axis] ** 2
        slow = min(1.0, limit / max(h * np.sqrt(speed), 1e-300))
        for axis in range(3):
            pull[axis] = (1 - restoring) * total[axis] / count + restoring * origins[v, axis] - places[v, axis]
            along += projections[v, 1 + axis] * (places[v, axis] - anchors[v, axis])
            tension += projections[v, 1 + axis] * pull[axis]
            drawn += projections[v, 1 + axis] ** 2
        for axis in range(3):
            pull[axis] -= tension * projections[v, 1 + axis]
            sums[3] += 0.5 * pull[axis] ** 2
            pull[axis] -= along * projections[v, 1 + axis] + 2 * damping * slow * velocities[v, axis]
            change += pull[axis] ** 2
        sums[0] = max(sums[0], slow * np.sqrt(speed))
        sums[1] = max(sums[1], np.sqrt(change))
        sums[2] += 0.5 * slow * slow * speed
        sums[3] += 0.5 * along * along
        sums[4] += abs(along)
        sums[5] += slow < 1.0
        sums[6] += drawn == 0.0
        for axis in range(3):
            velocity = slow * velocities[v, axis]
            result[v, axis] = places[v, axis] + h * velocity
            velocities[v, axis] = velocity + h * pull[axis]
