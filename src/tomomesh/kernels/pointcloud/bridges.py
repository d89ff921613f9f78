"""Loops that find the rims of holes in a sampled surface, and what spans them."""

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

SECTORS = 16
"""Directions around a point that are told apart. Six neighbors all around leave 60 degrees: three sectors that are
empty are 67."""
TANGENT = 0.41421356237309503
"""Tangent of the angle of a sector: pi / 8."""
STEEP = 0.5
"""Slope over which a bridge would leave the surface at its end. Chosen: half of it changes the distance by +6.8 %,
twice by 0.0 %."""
ALONG, BESIDE = 0.7, 2.5
"""Cosine of the angle between a bridge and the normal of a sample from which this lies on a side that turns away from
the bridge, as that of a slot does, and how far beside the bridge it is looked for, times the spacing."""
SAME_SIDE = 0.5
"""Cosine of the angle between the normals over which two rims belong together. Chosen: half of it changes the distance
by +0.1 %, twice by +5.3 %."""


@kernel("i8(f8[:,::1], f8[::1])")
def sector(axes: Floats, step: Floats) -> int:
    """Return the sector of a step (3,) in the plane of two axes (2, 3): the quadrant, and a quarter of it."""
    u = v = 0.0
    for axis in range(3):
        u += axes[0, axis] * step[axis]
        v += axes[1, axis] * step[axis]
    quadrant = 0
    if u < 0.0:
        quadrant, u, v = 2, -u, -v
    if v < 0.0:
        quadrant, u, v = quadrant + 3, -v, u
    quarter = np.int64(v > TANGENT * u) if v < u else 2 + np.int64(u < TANGENT * v)
    return int((4 * quadrant + quarter) % SECTORS)


@kernel("b1(i8, i8)")
def is_open(sectors: int, towards: int) -> bool:
    """Tell whether a sector and the two beside it are empty."""
    three = (1 << towards) | (1 << ((towards + 1) % SECTORS)) | (1 << ((towards + SECTORS - 1) % SECTORS))
    return (sectors & three) == 0


@kernel("void(f8[:,::1], i8[::1], i4[::1], f8[::1], f8, i8[::1], i8, i8)")
def full_sectors(
    samples: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    sight: float,
    sectors: Integers,
    begin: int,
    end: int,
) -> None:
    """Find in which directions each point has neighbors.

    Parameters
    ----------
    samples : (p, 7) float array
        Position, unit normal, spacing; in the order of their cubes.
    blocks, start, frame : arrays
        See `tomomesh.kernels.pointcloud.samples`.
    sight : float
        How far to look, times the spacing.
    sectors : (p,) int64 array
        Result: one bit a direction in the point's plane.
    begin, end : int
        Points to work on.
    """
    found, axes, step = np.empty(MOST, np.int64), np.empty((2, 3)), np.empty(3)
    for p in range(begin, end):
        tangents(samples[p, 3:6], axes)
        count = gather(samples, blocks, start, frame, samples[p], sight * samples[p, 6], found)
        sectors[p] = 0
        for n in range(count):
            q = found[n]
            if q != p:
                for axis in range(3):
                    step[axis] = samples[q, axis] - samples[p, axis]
                sectors[p] |= 1 << sector(axes, step)


@kernel("b1(f8[:,::1], i8, f8[::1], f8, i8[::1], i8)")
def meets_side(samples: Floats, p: int, step: Floats, length: float, found: Integers, count: int) -> bool:
    """Tell whether a sample beside a step (3,) from p on faces along it: both ends then lie at the edge of a slot."""
    for n in range(count):
        r = found[n]
        along = across = facing = 0.0
        for axis in range(3):
            there = samples[r, axis] - samples[p, axis]
            along += there * step[axis] / length
            across += there**2
            facing += samples[r, 3 + axis] * step[axis] / length
        beside = across - along**2 < (BESIDE * samples[p, 6]) ** 2
        if beside and 0.0 < along < length and abs(facing) > ALONG:
            return True
    return False


@kernel("i8(f8[:,::1], i8[::1], i4[::1], f8[::1], i8[::1], f8, f8, f8[:,::1], i8, i8)")
def bridge(
    samples: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    sectors: Integers,
    span: float,
    gap: float,
    places: Floats,
    begin: int,
    end: int,
) -> int:
    """Lay places on straight lines across holes, from rim to rim.

    Parameters
    ----------
    samples : (p, 7) float array
        Position, unit normal, spacing; in the order of their cubes.
    blocks, start, frame : arrays
    sectors : (p,) int64 array
        From `full_sectors`.
    span : float
        Longest bridge, times the spacing.
    gap : float
        Largest distance of the places.
    places : (b, 3) float array
        Result; none are written where the array is too short.
    begin, end : int
        Points to work on.

    Returns
    -------
    int
        Places that there are.
    """
    found, axes, other = np.empty(MOST, np.int64), np.empty((2, 3)), np.empty((2, 3))
    step = np.empty(3)
    total = 0
    for p in range(begin, end):
        rim = False
        for towards in range(SECTORS):
            rim |= is_open(sectors[p], towards)
        if not rim:
            continue
        tangents(samples[p, 3:6], axes)
        count = gather(samples, blocks, start, frame, samples[p], span * samples[p, 6], found)
        for n in range(count):
            q = found[n]
            if q <= p:
                continue
            length = here = there = same = 0.0
            for axis in range(3):
                step[axis] = samples[q, axis] - samples[p, axis]
                length += step[axis] ** 2
                here += step[axis] * samples[p, 3 + axis]
                there += step[axis] * samples[q, 3 + axis]
                same += samples[p, 3 + axis] * samples[q, 3 + axis]
            length = np.sqrt(length)
            pieces = np.int64(length / gap) + 1
            if pieces < 2 or max(abs(here), abs(there)) > STEEP * length or abs(same) < SAME_SIDE:
                continue
            if not is_open(sectors[p], sector(axes, step)):
                continue
            tangents(samples[q, 3:6], other)
            if not is_open(sectors[q], (sector(other, step) + SECTORS // 2) % SECTORS):
                continue
            if meets_side(samples, p, step, length, found, count):
                continue
            for piece in range(1, pieces):
                if total < len(places):
                    for axis in range(3):
                        places[total, axis] = samples[p, axis] + step[axis] * piece / pieces
                total += 1
    return total
