"""Loops of a mesh that is drawn to the surface under its samples: feet, springs, steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .compile import kernel
from .samples import gather

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

SIGHT = 2.5
"""Standard deviations of a Gaussian weight that are looked at."""
MOST = 1024
"""Samples that are looked at."""
LONGER = 1.25
"""How many times as far is looked where samples are far, most."""
FACING = 0.2
"""Cosine of the angle between a sample's normal and the mesh's under which the sample belongs to another side."""


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
        See `tomomesh.kernels.samples`.
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
def find_foot(
    samples: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    place: Floats,
    normal: Floats,
    reach: float,
    foot: Floats,
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
    foot : (4,) float array
        Result: height, and the unit normal of the surface.
    found, weights : (m,) int64 and float arrays
        Room to work in.

    Returns
    -------
    bool
        Whether there was any sample.
    """
    count = gather(samples, blocks, start, frame, place, reach, found)
    foot[:] = 0.0
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
        width = samples[p, 6]
        weights[n] = facing * facing * np.exp(-0.5 * (squared - 0.75 * over * over) / (width * width))
        total += weights[n]
        for axis in range(3):
            foot[1 + axis] += weights[n] * samples[p, 3 + axis]
    length = np.sqrt(foot[1] ** 2 + foot[2] ** 2 + foot[3] ** 2)
    if total < 1e-12 or length == 0.0:
        return False
    for axis in range(3):
        foot[1 + axis] /= length
    for n in range(count):
        p = found[n]
        height = 0.0
        for axis in range(3):
            height += (place[axis] - samples[p, axis]) * (samples[p, 3 + axis] + foot[1 + axis])
        foot[0] += 0.5 * weights[n] * height / total
    return True


@kernel("void(f8[:,::1], f8[:,::1], i4[::1], f8[:,::1], i8[::1], i4[::1], f8[::1], f8[:,::1], f8[:,::1], i8, i8)")
def first_feet(
    places: Floats,
    normals: Floats,
    nearest: NDArray[np.int32],
    samples: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    feet: Floats,
    anchors: Floats,
    begin: int,
    end: int,
) -> None:
    """Take the plane of the sample nearest to each place for its first foot.

    Where that sample faces elsewhere, as the other side of a thin part does, the foot is sought (see `find_foot`).

    Parameters
    ----------
    places, normals : (n, 3) float arrays
    nearest : (n,) int32 array
        The sample nearest to each place, -1 where there is none.
    samples, blocks, start, frame : arrays
    feet : (n, 4) float array
        Result: height over the surface at the anchor, and unit normal; zeros where there is no sample.
    anchors : (n, 3) float array
        Result: where the height was measured.
    begin, end : int
        Places to work on.
    """
    found, weights = np.empty(MOST, np.int64), np.empty(MOST)
    for v in range(begin, end):
        p = nearest[v]
        feet[v], anchors[v] = 0.0, places[v]
        if p < 0:
            continue
        facing = squared = 0.0
        for axis in range(3):
            facing += normals[v, axis] * samples[p, 3 + axis]
            squared += (places[v, axis] - samples[p, axis]) ** 2
        if facing >= FACING:
            feet[v, 1:], anchors[v] = samples[p, 3:6], samples[p, :3]
            continue
        reach = SIGHT * samples[p, 6] + np.sqrt(squared)
        if not find_foot(samples, blocks, start, frame, places[v], normals[v], reach, feet[v], found, weights):
            feet[v] = 0.0


@kernel("void(f8[:,::1], i4[::1], f8[:,::1], i8[::1], i4[::1], f8[::1], f8, f8[:,::1], f8[:,::1], i8, i8)")
def renew_feet(
    places: Floats,
    nearest: NDArray[np.int32],
    samples: Floats,
    blocks: Integers,
    start: NDArray[np.int32],
    frame: Floats,
    stale: float,
    feet: Floats,
    anchors: Floats,
    begin: int,
    end: int,
) -> None:
    """Seek the feet of those places anew that have moved some way from where theirs were sought.

    Parameters
    ----------
    places : (n, 3) float array
    nearest : (n,) int32 array
        A sample near each place, which tells how far to look; -1 where there is none.
    samples, blocks, start, frame : arrays
    stale : float
        The way.
    feet, anchors : (n, 4) and (n, 3) float arrays
        Changed in place; a place without a foot gets none.
    begin, end : int
        Places to work on.
    """
    found, weights, foot = np.empty(MOST, np.int64), np.empty(MOST), np.empty(4)
    for v in range(begin, end):
        moved = drawn = away = 0.0
        for axis in range(3):
            moved += (places[v, axis] - anchors[v, axis]) ** 2
            drawn += feet[v, 1 + axis] ** 2
        if moved <= stale * stale or drawn == 0.0 or nearest[v] < 0:
            continue
        for axis in range(3):
            away += (places[v, axis] - samples[nearest[v], axis]) ** 2
        reach = SIGHT * samples[nearest[v], 6]
        reach = min(max(1.01 * np.sqrt(away), reach), LONGER * reach)
        if find_foot(samples, blocks, start, frame, places[v], feet[v, 1:], reach, foot, found, weights):
            feet[v], anchors[v] = foot, places[v]
        else:
            feet[v], anchors[v] = 0.0, places[v]


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


@kernel("void(f8[:,::1], i4[:,::1], f8[:,::1])")
def quad_normals(vertices: Floats, quads: NDArray[np.int32], normals: Floats) -> None:
    """Find unit normals (n, 3) at the vertices: the sum of the vector areas of the squares around each."""
    normals[:] = 0.0
    for q in range(len(quads)):
        a, b, c, d = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        for axis in range(3):
            one, two = (axis + 1) % 3, (axis + 2) % 3
            area = (vertices[c, one] - vertices[a, one]) * (vertices[d, two] - vertices[b, two])
            area -= (vertices[c, two] - vertices[a, two]) * (vertices[d, one] - vertices[b, one])
            for corner in range(4):
                normals[quads[q, corner], axis] += area
    for v in range(len(normals)):
        length = np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2)
        for axis in range(3):
            normals[v, axis] /= max(length, 1e-300)


@kernel("void(f8[:,::1], f8[:,::1], i4[:,::1], f8, f8[:,::1], i4[:,::1], f8[:,::1])")
def split_quads(
    vertices: Floats,
    normals: Floats,
    quads: NDArray[np.int32],
    share: float,
    rise: Floats,
    faces: NDArray[np.int32],
    raised: Floats,
) -> None:
    """Split squares by the diagonals nearer to the surface, and raise their corners by a share of the sagitta.

    A chord d between places with normals m and n lies (n - m) d / 8 below the middle of the arc.

    Parameters
    ----------
    vertices, normals : (n, 3) float arrays
    quads : (q, 4) int32 array
    share : float
    rise : (n, 2) float array
        Zeros; room for sum and number of the sagittas at each vertex.
    faces : (2q, 3) int32 array
        Result.
    raised : (n, 3) float array
        Result: where the vertices then are.
    """
    sagitta = np.empty(2)
    for q in range(len(quads)):
        for one in range(2):
            a, c = quads[q, one], quads[q, one + 2]
            sagitta[one] = 0.0
            for axis in range(3):
                sagitta[one] += (normals[c, axis] - normals[a, axis]) * (vertices[c, axis] - vertices[a, axis]) / 8
        turn = int(abs(sagitta[1]) < abs(sagitta[0]))
        for corner in range(4):
            rise[quads[q, corner], 0] += 0.5 * (sagitta[0] + sagitta[1])
            rise[quads[q, corner], 1] += 1.0
        for half in range(2):
            faces[2 * q + half, 0] = quads[q, turn]
            faces[2 * q + half, 1] = quads[q, (turn + half + 1) % 4]
            faces[2 * q + half, 2] = quads[q, (turn + half + 2) % 4]
    for v in range(len(vertices)):
        for axis in range(3):
            raised[v, axis] = vertices[v, axis] + share * rise[v, 0] / max(rise[v, 1], 1.0) * normals[v, axis]


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
