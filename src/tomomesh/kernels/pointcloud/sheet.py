"""Loops that find where the samples of an open surface end."""

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

DIRECTIONS = 32
"""Directions around a sample in which a disk is laid beside it. Chosen: half of it changes the distance by +3.3 %; for
twice of it a word has too few bits."""
BEND = 0.5
"""Sine of the angle between two planes from which a neighbor is unfolded about the line where they meet. Chosen: half
of it changes the distance by -1.3 %, twice nothing."""
STEEP = 0.5
"""Slope over which a neighbor that faces alike lies on another sheet. Chosen: half and twice of it change no case of
benchmarks/constants.py."""


@kernel("f8(f8[::1], f8[::1])")
def dot(a: Floats, b: Floats) -> float:
    """Return the scalar product of two vectors (3,)."""
    product: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


@kernel("void(f8[::1], f8[::1], f8[::1])")
def cross(a: Floats, b: Floats, product: Floats) -> None:
    """Return the vector product of two vectors (3,)."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        product[i] = a[j] * b[k] - a[k] * b[j]


@kernel("void(f8[:,::1], i8[::1], i4[::1], f8[::1], f8, f8[:,::1], f8[::1], i8, i8)")
def flatten(
    samples: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    sight: float,
    normals: Floats,
    rough: Floats,
    begin: int,
    end: int,
) -> None:
    """Give each sample the normal, of its own and its neighbors', whose plane through it passes closest to them.

    The sum of distances, not squares, takes one flank of a crease and leaves the other; a normal that noise has
    tilted, as it does at a border, is outvoted.

    Parameters
    ----------
    samples : (p, 7) float array
        Position, unit normal of either sign, spacing; in the order of their blocks.
    blocks, start, frame : arrays
        See `tomomesh.kernels.pointcloud.samples`.
    sight : float
        How far to look, times the spacing.
    normals : (p, 3) float array
        Result.
    rough : (p,) float array
        Result: mean distance from that plane, over the spacing.
    begin, end : int
        Samples to work on.
    """
    found, step = np.empty(MOST, np.int64), np.empty(3)
    for p in range(begin, end):
        count = gather(samples, blocks, start, frame, samples[p], sight * samples[p, 6], found)
        least = np.inf
        for n in range(count):
            total = 0.0
            for other in range(count):
                for axis in range(3):
                    step[axis] = samples[found[other], axis] - samples[p, axis]
                total += abs(dot(step, samples[found[n], 3:6]))
            if total < least:
                least = total
                normals[p] = samples[found[n], 3:6]
        rough[p] = least / (count * samples[p, 6])


@kernel("b1(f8[::1], f8[::1], f8[::1], f8[:,::1], f8[:,::1], f8[::1])")
def unfold(step: Floats, here: Floats, there: Floats, axes: Floats, room: Floats, flat: Floats) -> bool:
    """Lay a neighbor into the plane of a sample, as far from it as it is along the surface.

    Where the planes of the two meet at an angle, the neighbor's is turned about their common line: exact over a
    crease and over a cylinder. Where they are all but parallel, the neighbor keeps its distance.

    Parameters
    ----------
    step : (3,) float array
        From the sample to the neighbor.
    here, there : (3,) float arrays
        Their normals, of either sign.
    axes : (2, 3) float array
        Of the sample's plane.
    room : (2, 3) float array
        To work in.
    flat : (2,) float array
        Result: where the neighbor lies along the axes.

    Returns
    -------
    bool
        Whether it lies on the same sheet.
    """
    line, across = room[0], room[1]
    cross(here, there, line)
    sine, height = np.sqrt(dot(line, line)), dot(step, here)
    flat[0], flat[1] = dot(step, axes[0]), dot(step, axes[1])
    if sine < BEND:
        length = np.sqrt(dot(step, step))
        stretch = length / max(np.sqrt(flat[0] ** 2 + flat[1] ** 2), 1e-300)
        flat[0], flat[1] = flat[0] * stretch, flat[1] * stretch
        return bool(abs(height) <= STEEP * length)
    for axis in range(3):
        line[axis] /= sine
    cross(line, here, across)
    away = dot(step, there) / dot(across, there)
    away += np.copysign(abs(height) / sine, away)
    along = dot(step, line)
    for n in range(2):
        flat[n] = along * dot(line, axes[n]) + away * dot(across, axes[n])
    return True


@kernel("void(f8[:,::1], i8[::1], i4[::1], f8[::1], f8, i8[::1], f8[::1], i8, i8)")
def find_disks(
    samples: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    radius: float,
    beyond: Integers,
    radii: Floats,
    begin: int,
    end: int,
) -> None:
    """Find the directions in which a disk that touches a sample, in its plane, holds no other.

    Parameters
    ----------
    samples : (p, 7) float array
        Position, unit normal of either sign, spacing; in the order of their blocks.
    blocks, start, frame : arrays
        See `tomomesh.kernels.pointcloud.samples`.
    radius : float
        Of the disks, times the largest spacing within twice that.
    beyond : (p,) int64 array
        Result: one bit a direction; n of `DIRECTIONS` is n turns / `DIRECTIONS` from the first axis of `tangents`.
    radii : (p,) float array
        Result: radii of the disks.
    begin, end : int
        Samples to work on.
    """
    found, axes, room = np.empty(MOST, np.int64), np.empty((2, 3)), np.empty((2, 3))
    step, flat = np.empty(3), np.empty(2)
    angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    u, v = np.cos(angles), np.sin(angles)
    for p in range(begin, end):
        spacing = samples[p, 6]
        for n in range(gather(samples, blocks, start, frame, samples[p], 2 * radius * spacing, found)):
            spacing = max(spacing, samples[found[n], 6])
        radii[p] = radius * spacing
        tangents(samples[p, 3:6], axes)
        left = (1 << DIRECTIONS) - 1
        for n in range(gather(samples, blocks, start, frame, samples[p], 2 * radii[p], found)):
            for axis in range(3):
                step[axis] = samples[found[n], axis] - samples[p, axis]
            if found[n] == p or not unfold(step, samples[p, 3:6], samples[found[n], 3:6], axes, room, flat):
                continue
            squared = flat[0] ** 2 + flat[1] ** 2
            for way in range(DIRECTIONS):
                if squared < 2 * radii[p] * (flat[0] * u[way] + flat[1] * v[way]):
                    left &= ~(1 << way)
            if left == 0:
                break
        beyond[p] = left


@kernel("void(f8[:,::1], f8[:,::1], i8[::1], i4[::1], f8[::1], f8, f8[::1], i8, i8)")
def find_depths(
    places: Floats,
    disks: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    reach: float,
    depth: Floats,
    begin: int,
    end: int,
) -> None:
    """Find how far each place lies from the disks that hold no sample.

    Parameters
    ----------
    places : (n, 3) float array
    disks : (d, 7) float array
        Middle, unit normal, radius; in the order of their blocks.
    blocks, start, frame : arrays
    reach : float
        Distance from a middle that is looked at.
    depth : (n,) float array
        Result: negative within a disk; infinite where none is near.
    begin, end : int
        Places to work on.
    """
    found, step = np.empty(MOST, np.int64), np.empty(3)
    for v in range(begin, end):
        depth[v] = np.inf
        for n in range(gather(disks, blocks, start, frame, places[v], reach, found)):
            disk = disks[found[n]]
            for axis in range(3):
                step[axis] = places[v, axis] - disk[axis]
            length = np.sqrt(dot(step, step))
            if abs(dot(step, disk[3:6])) <= STEEP * max(length, disk[6]):
                depth[v] = min(depth[v], length - disk[6])
