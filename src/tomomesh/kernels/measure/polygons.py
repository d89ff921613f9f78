"""Points and closed polygons in a plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@kernel("void(f8[:,::1], f8[:,::1], b1[::1])")
def inside_polygon(ring: NDArray[np.float64], points: NDArray[np.float64], inside: NDArray[np.bool_]) -> None:
    """Tell which points lie inside a polygon, by the parity of the sides that a ray along +x crosses.

    Parameters
    ----------
    ring : (u, 2) float array
    points : (n, 2) float array
    inside : (n,) bool array
        Result.
    """
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        inside[n] = False
        last = len(ring) - 1
        for i in range(len(ring)):
            if (ring[i, 1] > y) != (ring[last, 1] > y):
                share = (y - ring[i, 1]) / (ring[last, 1] - ring[i, 1])
                if x < ring[i, 0] + share * (ring[last, 0] - ring[i, 0]):
                    inside[n] = not inside[n]
            last = i


@kernel("void(f8[:,::1], f8[:,::1], f8[::1])")
def distance_to_polygon(ring: NDArray[np.float64], points: NDArray[np.float64], distance: NDArray[np.float64]) -> None:
    """Find the distance of points to the line of a polygon.

    Parameters
    ----------
    ring : (u, 2) float array
    points : (n, 2) float array
    distance : (n,) float array
        Result.
    """
    for n in range(len(points)):
        best = np.inf
        last = len(ring) - 1
        for i in range(len(ring)):
            length = along = 0.0
            for axis in range(2):
                side = ring[last, axis] - ring[i, axis]
                length += side * side
                along += side * (points[n, axis] - ring[i, axis])
            share = min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0
            squared = 0.0
            for axis in range(2):
                nearest = ring[i, axis] + share * (ring[last, axis] - ring[i, axis])
                squared += (points[n, axis] - nearest) ** 2
            best = min(best, squared)
            last = i
        distance[n] = np.sqrt(best)


@kernel("i8(f8[::1], f8)")
def first_from(rising: Floats, value: float) -> int:
    """Return how many of rising numbers lie below a value."""
    low, high = 0, len(rising)
    while low < high:
        middle = (low + high) // 2
        if rising[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


@kernel("void(f8[:,::1], f8[::1], f8[::1], b1[:,::1])")
def turn_lattice(ring: Floats, x: Floats, y: Floats, inside: NDArray[np.bool_]) -> None:
    """Tell which places of a lattice lie inside a polygon.

    Parameters
    ----------
    ring : (u, 2) float array
    x, y : (columns,) and (rows,) float arrays
        Rising.
    inside : (rows, columns) bool array
        False on entry. Result.
    """
    last = len(ring) - 1
    for i in range(len(ring)):
        ax, ay, bx, by = ring[last, 0], ring[last, 1], ring[i, 0], ring[i, 1]
        for row in range(first_from(y, min(ay, by)), first_from(y, max(ay, by))):
            column = first_from(x, ax + (y[row] - ay) / (by - ay) * (bx - ax))
            if column < len(x):
                inside[row, column] = not inside[row, column]
        last = i
    for row in range(len(y)):
        for column in range(1, len(x)):
            inside[row, column] ^= inside[row, column - 1]


@kernel("void(f8[:,::1], f8[:,::1])")
def step_evenly(line: Floats, places: Floats) -> None:
    """Place points at equal steps along an open line, its ends kept.

    Parameters
    ----------
    line : (p, d) float array
        One point at least.
    places : (n, d) float array
        Result; two at least.
    """
    way = np.zeros(len(line))
    for i in range(1, len(line)):
        squared = 0.0
        for axis in range(line.shape[1]):
            squared += (line[i, axis] - line[i - 1, axis]) ** 2
        way[i] = way[i - 1] + np.sqrt(squared)
    last, side = len(places) - 1, 0
    for n in range(len(places)):
        wanted = way[-1] * (n / last)
        while side < len(line) - 2 and way[side + 1] < wanted:
            side += 1
        onward = min(side + 1, len(line) - 1)
        length = way[onward] - way[side]
        share = min((wanted - way[side]) / length, 1.0) if length > 0.0 else 0.0
        for axis in range(line.shape[1]):
            places[n, axis] = line[side, axis] + share * (line[onward, axis] - line[side, axis])
    places[last] = line[-1]
