"""Loops that project places onto the surface under the samples: how high each lies over it, along its normal there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel
from ..pointcloud.samples import MOST, SIGHT, gather
from .interpolation import FEWEST, NEAREST, height_between, nearest_facing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

LONGER = 1.25
"""Most that the reach grows where samples are far: at 2.25 x 1.25 = 2.8 widths a Gaussian weight is down to 2 %.
Chosen: half of it changes the distance by +35 %, twice by +7 %."""
LOW = 0.75
"""Height over the surface, widths of the weights, under which a place is put onto what goes through the samples: a half
of the sampling distance. What is higher lies where few samples face alike, at the rim of what is thin."""
FACING = 0.2
"""Cosine of the angle between a sample's normal and the mesh's under which the sample belongs to another side: 78
degrees, so that both planes of a sharp edge have a say and the back of a thin part has none. Chosen: half of it changes
the distance by +0.3 %, twice by -1.0 %."""


@kernel("void(f8[:,::1], f8[:,::1], i8[::1], i4[::1], f8[::1], i4[::1], i8, i8)")
def nearest_places(
    places: Floats,
    points: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    nearest: NDArray[np.int32],
    begin: int,
    end: int,
) -> None:
    """Find the point nearest to each place, within three cubes.

    Parameters
    ----------
    places : (n, 3) float array
    points : (p, 3) float array
        In the order of their cubes.
    blocks, start, frame : arrays
        See `tomomesh.kernels.pointcloud.samples`.
    nearest : (n,) int32 array
        Result: number of the point, -1 where there is none. The first of several at the same distance.
    begin, end : int
        Places to work on.
    """
    found = np.empty(MOST, np.int64)
    for v in range(begin, end):
        nearest[v] = -1
        for ring in range(1, 4):
            best = (ring * frame[3]) ** 2
            count = gather(points, blocks, start, frame, places[v], ring * frame[3], found)
            for n in range(count):
                p = found[n]
                squared = 0.0
                for axis in range(3):
                    squared += (points[p, axis] - places[v, axis]) ** 2
                if squared < best:
                    best = squared
                    nearest[v] = p
            if nearest[v] >= 0:
                break


@kernel("b1(f8[:,::1], i8[::1], i4[::1], f8[::1], f8[::1], f8[::1], f8, f8[::1], i8[::1], f8[::1])")
def project(
    samples: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    place: Floats,
    normal: Floats,
    reach: float,
    projection: Floats,
    found: Integers,
    weights: Floats,
) -> bool:
    """Find how high a place lies over the surface that the samples around it describe.

    The height is a mean, with Gaussian weights, of the heights over the samples' planes (Kolluri 2008), of which
    each is measured along the mean of the sample's own normal and the common one: then samples of a sphere give
    no height at all to any place on it.

    Parameters
    ----------
    samples : (p, 7) float array
        Position, normal that faces outward, standard deviation of its weight.
    blocks, start, frame : arrays
    place, normal : (3,) float arrays
        The normal of the mesh there: samples that face elsewhere have no say.
    reach : float
        How far to look.
    projection : (4,) float array
        Result: height, and the unit normal of the surface.
    found, weights : (m,) int64 and float arrays
        Room to work in.

    Returns
    -------
    bool
        Whether there was any sample.
    """
    count = gather(samples, blocks, start, frame, place, reach, found)
    projection[:] = 0.0
    total = 0.0
    for n in range(count):
        p = found[n]
        facing = over = squared = 0.0
        for axis in range(3):
            step = place[axis] - samples[p, axis]
            facing += normal[axis] * samples[p, 3 + axis]
            over += step * samples[p, 3 + axis]
            squared += step * step
        weights[n] = 0.0
        if facing < FACING:
            continue
        # Half as far above a sample counts as far as beside it: a vertex on its way down sees what it will see there.
        width = samples[p, 6]
        weights[n] = facing * facing * np.exp(-0.5 * (squared - 0.75 * over * over) / (width * width))
        total += weights[n]
        for axis in range(3):
            projection[1 + axis] += weights[n] * samples[p, 3 + axis]
    length = np.sqrt(projection[1] ** 2 + projection[2] ** 2 + projection[3] ** 2)
    if total < 1e-12 or length == 0.0:  # seven widths away
        return False
    for axis in range(3):
        projection[1 + axis] /= length
    for n in range(count):
        p = found[n]
        height = 0.0
        for axis in range(3):
            height += (place[axis] - samples[p, axis]) * (samples[p, 3 + axis] + projection[1 + axis])
        projection[0] += 0.5 * weights[n] * height / total
    return True


@kernel("void(f8[:,::1], f8[:,::1], i4[::1], f8[:,::1], i8[::1], i4[::1], f8[::1], f8[:,::1], f8[:,::1], i8, i8)")
def first_projections(
    places: Floats,
    normals: Floats,
    nearest: NDArray[np.int32],
    samples: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    projections: Floats,
    anchors: Floats,
    begin: int,
    end: int,
) -> None:
    """Take the plane of the sample nearest to each place for its first projection.

    Where that sample faces elsewhere, as the other side of a thin part does, the projection is sought (see `project`).

    Parameters
    ----------
    places, normals : (n, 3) float arrays
    nearest : (n,) int32 array
        The sample nearest to each place, -1 where there is none.
    samples, blocks, start, frame : arrays
    projections : (n, 4) float array
        Result: height over the surface at the anchor, and unit normal; zeros where there is no sample.
    anchors : (n, 3) float array
        Result: where the height was measured.
    begin, end : int
        Places to work on.
    """
    found, weights = np.empty(MOST, np.int64), np.empty(MOST)
    for v in range(begin, end):
        p = nearest[v]
        projections[v], anchors[v] = 0.0, places[v]
        if p < 0:
            continue
        facing = squared = 0.0
        for axis in range(3):
            facing += normals[v, axis] * samples[p, 3 + axis]
            squared += (places[v, axis] - samples[p, axis]) ** 2
        if facing >= FACING:
            projections[v, 1:], anchors[v] = samples[p, 3:6], samples[p, :3]
            continue
        reach = SIGHT * samples[p, 6] + np.sqrt(squared)
        if not project(samples, blocks, start, frame, places[v], normals[v], reach, projections[v], found, weights):
            projections[v] = 0.0


@kernel("void(f8[:,::1], i4[::1], f8[:,::1], i8[::1], i4[::1], f8[::1], f8, b1, f8[:,::1], f8[:,::1], i8, i8)")
def renew_projections(
    places: Floats,
    nearest: NDArray[np.int32],
    samples: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    stale: float,
    through: bool,
    projections: Floats,
    anchors: Floats,
    begin: int,
    end: int,
) -> None:
    """Project those places anew that have moved some way from where they last were projected.

    Parameters
    ----------
    places : (n, 3) float array
    nearest : (n,) int32 array
        A sample near each place, which tells how far to look; -1 where there is none.
    samples, blocks, start, frame : arrays
    stale : float
        The way.
    through : bool
        Whether the surface goes through the samples, where enough of them face alike.
    projections, anchors : (n, 4) and (n, 3) float arrays
        Changed in place; a place without a projection gets none.
    begin, end : int
        Places to work on.
    """
    found, weights, projection = np.empty(MOST, np.int64), np.empty(MOST), np.empty(4)
    near = np.empty((NEAREST, 4))
    for v in range(begin, end):
        moved = drawn = away = 0.0
        for axis in range(3):
            moved += (places[v, axis] - anchors[v, axis]) ** 2
            drawn += projections[v, 1 + axis] ** 2
        if moved < stale * stale or drawn == 0.0 or nearest[v] < 0:
            continue
        for axis in range(3):
            away += (places[v, axis] - samples[nearest[v], axis]) ** 2
        reach = SIGHT * samples[nearest[v], 6]
        # a hundredth more than the way to the nearest sample, or rounding would leave it out
        reach = min(max(1.01 * np.sqrt(away), reach), LONGER * reach)
        if through:
            seen = samples, blocks, start, frame
            wide = LONGER * SIGHT * samples[nearest[v], 6]
            kept = nearest_facing(*seen, places[v], projections[v, 1:], wide, found, near)
            height = height_between(near, kept) if kept >= FEWEST else np.nan
            if abs(height) < LOW * samples[nearest[v], 6]:
                projections[v, 0], anchors[v] = -height, places[v]
                continue
        if project(samples, blocks, start, frame, places[v], projections[v, 1:], reach, projection, found, weights):
            projections[v], anchors[v] = projection, places[v]
        else:
            projections[v], anchors[v] = 0.0, places[v]
