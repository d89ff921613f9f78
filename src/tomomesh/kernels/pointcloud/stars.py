"""Loops that lay triangles between samples and their neighbors along the surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from .linear_algebra import tangents
from .samples import MOST, gather

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

STEEP, ACROSS = 0.5, 0.95
"""Slope over which a neighbor lies on another sheet: where the normals agree, and where the surface has an edge between
them, across which a step leaves both faces of a cube by .71."""
SAME_SIDE = 0.5
"""Cosine of the angle between the normals over which they agree."""


@kernel("i8(f8[:,::1], i8, i8[::1], i8, f8[:,::1])")
def spread_out(samples: Floats, p: int, found: Integers, count: int, places: Floats) -> int:
    """Lay the neighbors of a sample that are of its sheet into its plane (k, 2), as far from it as they are.

    Their numbers take the first places of `found`; returns how many there are.
    """
    axes, step = np.empty((2, 3)), np.empty(3)
    tangents(samples[p, 3:6], axes)
    kept = 0
    for n in range(count):
        q = found[n]
        squared = here = there = same = u = v = 0.0
        for axis in range(3):
            step[axis] = samples[q, axis] - samples[p, axis]
            squared += step[axis] ** 2
            here += step[axis] * samples[p, 3 + axis]
            there += step[axis] * samples[q, 3 + axis]
            same += samples[p, 3 + axis] * samples[q, 3 + axis]
            u += step[axis] * axes[0, axis]
            v += step[axis] * axes[1, axis]
        length = np.sqrt(squared)
        steep = STEEP if abs(same) > SAME_SIDE else ACROSS
        if length == 0.0 or max(abs(here), abs(there)) > steep * length:
            continue
        longer = length / np.sqrt(u * u + v * v)
        places[kept, 0], places[kept, 1] = longer * u, longer * v
        found[kept] = q
        kept += 1
    return kept


@kernel("i8(f8[:,::1], i8, i8, f8)")
def beside(places: Floats, count: int, one: int, way: float) -> int:
    """Return the Delaunay neighbor of the origin after another, counter-clockwise for a way of 1; -1 if there is none.

    The triangle of the origin, that one and the next holds no other in its circle where its angle at the next is the
    largest.
    """
    best, least = -1, np.inf
    for n in range(count):
        area = way * (places[one, 0] * places[n, 1] - places[one, 1] * places[n, 0])
        if area <= 0.0:
            continue
        squared = places[n, 0] ** 2 + places[n, 1] ** 2
        cotangent = (squared - places[one, 0] * places[n, 0] - places[one, 1] * places[n, 1]) / area
        if cotangent < least:
            best, least = n, cotangent
    return best


@kernel("i8(f8[:,::1], i8, i8, i8, f8, f8[:,::1], i8)")
def fill_triangle(samples: Floats, a: int, b: int, c: int, gap: float, places: Floats, total: int) -> int:
    """Lay places over a triangle, no farther apart than a gap, as far as there is room; return how many there are."""
    longest = 0.0
    for one, two in ((a, b), (b, c), (c, a)):
        squared = 0.0
        for axis in range(3):
            squared += (samples[one, axis] - samples[two, axis]) ** 2
        longest = max(longest, np.sqrt(squared))
    pieces = np.int64(longest / gap) + 1
    x, y, z, share = samples[a, 0], samples[a, 1], samples[a, 2], 1.0 / pieces
    ux, uy, uz = share * (samples[b, 0] - x), share * (samples[b, 1] - y), share * (samples[b, 2] - z)
    vx, vy, vz = share * (samples[c, 0] - x), share * (samples[c, 1] - y), share * (samples[c, 2] - z)
    for i in range(pieces + 1):
        for j in range(pieces + 1 - i):
            if total < len(places):
                places[total, 0], places[total, 1] = x + i * ux + j * vx, y + i * uy + j * vy
                places[total, 2] = z + i * uz + j * vz
            total += 1
    return total


@kernel("i8(f8[:,::1], i8, f8[::1], f8[::1], i8[::1], i8[::1], i8)")
def take_cubes(
    places: Floats, count: int, lowest: Floats, cell: Floats, steps: Integers, taken: Integers, total: int
) -> int:
    """Take the cubes of some places into a table of keys, (2^h,) with room for all; return how many it then holds."""
    last, mask = np.int64(-1), len(taken) - 1
    a, b, c = 1.0 / cell[0], 1.0 / cell[1], 1.0 / cell[2]
    for n in range(count):
        key = steps[3] + steps[0] * np.int64(np.floor(a * (places[n, 0] - lowest[0])))
        key += steps[1] * np.int64(np.floor(b * (places[n, 1] - lowest[1])))
        key += steps[2] * np.int64(np.floor(c * (places[n, 2] - lowest[2])))
        if key == last:
            continue
        last, at = key, (key ^ key >> 17 ^ key >> 34) & mask  # bits of all three axes
        while taken[at] >= 0 and taken[at] != key:
            at = (at + 1) & mask
        if taken[at] < 0:
            taken[at] = key
            total += 1
    return total


@kernel("i8(f8[:,::1], i8[::1], i4[::1], f8[::1], f8, f8[::1], f8[::1], f8, i8[::1], f8[:,::1], i8[::1], i8, i8)")
def lay_stars(
    samples: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    sight: float,
    lowest: Floats,
    cell: Floats,
    gap: float,
    steps: Integers,
    places: Floats,
    taken: Integers,
    begin: int,
    end: int,
) -> int:
    """Find the cubes of the Delaunay triangles of each sample and its neighbors, in its plane.

    Parameters
    ----------
    samples : (p, 7) float array
        Position, unit normal, spacing; in the order of their cubes.
    blocks, start, frame : arrays
        See `tomomesh.kernels.pointcloud.samples`.
    sight : float
        How far to look, times the spacing.
    lowest, cell : (3,) float arrays
        Lowest corner of cube (0, 0, 0), and the edges of the cubes.
    gap : float
        Largest distance of the places on a triangle.
    steps : (4,) int64 array
        What a step along each axis adds to a cube's key, and the key of cube (0, 0, 0); none is negative.
    places : (b, 3) float array
        Room for those of one triangle.
    taken : (2^h,) int64 array
        -1 on entry. Result: the keys among others of -1, in no order.
    begin, end : int
        Samples to work on.

    Returns
    -------
    int
        0, or 1 where the table is too short to be half empty, or 2 where the places are too few.
    """
    found, flat = np.empty(MOST, np.int64), np.empty((MOST, 2))
    total = 0
    for p in range(begin, end):
        count = gather(samples, blocks, start, frame, samples[p], sight * samples[p, 6], found)
        count = spread_out(samples, p, found, count, flat)
        first, least = -1, np.inf
        for n in range(count):
            squared = flat[n, 0] ** 2 + flat[n, 1] ** 2
            if squared < least:
                first, least = n, squared
        if first < 0:
            continue
        for way in (1.0, -1.0):
            one, closed = first, False
            for _ in range(count):
                two = beside(flat, count, one, way)
                if two < 0:
                    break
                laid = fill_triangle(samples, p, found[one], found[two], gap, places, 0)
                if laid > len(places):
                    return 2
                if 2 * (total + laid) > len(taken):
                    return 1
                total = take_cubes(places, laid, lowest, cell, steps, taken, total)
                closed = two == first
                if closed:
                    break
                one = two
            if closed:
                break
    return 0
