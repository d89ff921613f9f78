"""Contours in planes about one axis, as rotating probes and radial scans draw them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..measure.polygon import along, area, evenly
from .direction import FEWEST, axes_across, some_of
from .rings import outline
from .slices import APART, PARTED, SLICES, STRAYS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

MOST = 200_000
"""Points among which planes about an axis are looked for: contours that somebody draws have fewer."""
ROUNDS, KEPT = 12, 0.8
"""Rounds of the fit of the axis, and the share of the steps that each goes by: near the axis, where the planes meet,
the nearest point may be of another plane. Chosen, on ellipsoids in 3 to 12 planes with noise of 0 to .23 sampling
distances: half and twice of the rounds change nothing; half of the share finds two more of the noisy,
all steps lose one."""
TWINS = 1e-6
"""Sampling distances within which two points count as one, as where planes meet: the step between tells nothing."""
MEET = 0.35
"""Farthest that most lines may pass from the axis, times the sine of their angle to it, in extents of the cloud: a
noise of a quarter of the sampling distance leaves .2 (measured), lines in all directions .78."""
SLANTED = 0.1
"""Least length of the axis beside its moment, in extents of the cloud: planes that are parallel meet at infinity."""
NEAR = 2.0
"""Sampling distances from the axis within which nobody can tell of which plane a point is, at least. Chosen: half of
it changes none of these ellipsoids, twice moves them by .0001 of the radius."""
DOUBT = 4.0
"""Deviations that the points have from their planes, beside the distance of two planes: nearer to the axis than that
they are mixed up. Chosen: half of it refuses one of these ellipsoids, twice nothing."""
FARTHER = 1.0, 0.5
"""Shares of the median distance from the axis, in turn, from which on points tell the planes: in noise the far ones
tell them best, but a half plane near whose side the axis runs has none. Measured on ellipsoids in 7 to 15 half planes
about an axis a third off: the first alone refuses one of five."""
WIDEST = np.pi / 2
"""Widest angle between two half planes that is spanned. Chosen: half of it refuses three planes, twice nothing."""
MISSING = 4.5
"""Widest angle too, in medians of them, as in stacks: three planes may be missing, and what is bent as a C stays so."""


@dataclass(frozen=True)
class HalfPlanes:
    """Outlines in half planes about an axis.

    Attributes
    ----------
    origin : (3,) float array
    axes : (3, 3) float array
        Two directions across the axis, and the axis: one a row.
    angles : (h,) float array
        Of the half planes, rising within one turn.
    curves : (h, s, 2) float array
        Distance from the axis and height along it; evenly along each outline, from one end on the axis to the other,
        or around.
    spacing : float
        Distance of neighboring points.
    """

    origin: Floats
    axes: Floats
    angles: Floats
    curves: Floats
    spacing: float


def half_planes(positions: Floats) -> HalfPlanes | None:
    """Find the outlines of a cloud whose points lie in planes about one axis, far apart beside their sampling.

    The step from a point to the nearest other lies in the plane of both, so that its line meets the axis: with the step
    t from p, the axis' direction u and its moment m,  u . (p x t) + m . t = 0  (Pluecker 1865), which is linear in u
    and m.

    Parameters
    ----------
    positions : (n, 3) float array
        Their order changes nothing.

    Returns
    -------
    HalfPlanes or None
        None for any other cloud, and where an outline does not close or is of several pieces.
    """
    if not 6 * SLICES <= len(positions) <= MOST:
        return None
    middle = (positions.min(axis=0) + positions.max(axis=0)) / 2
    tree = scipy.spatial.cKDTree(positions - middle)
    drawn = np.unique(some_of(tree.data), axis=0)  # each repeat would be asked for all of the others
    if len(drawn) < len(positions) and not _about_axis(drawn, tree)[1]:
        return None
    local = np.unique(tree.data, axis=0)
    found, each = _about_axis(local, scipy.spatial.cKDTree(local))
    if found is None:
        return None
    origin, axes, placed, spacing = found
    outlines = (_outlines(placed, *planes, spacing) for planes in each)
    made = next((one for one in outlines if one is not None), None)
    if made is None:
        return None
    angles, curves = made
    return HalfPlanes(origin + middle, axes, angles, curves, spacing)


def _about_axis(
    some: Floats, tree: scipy.spatial.cKDTree
) -> tuple[tuple[Floats, Floats, Floats, float] | None, list[tuple[Floats, NDArray[np.int64], float]]]:
    """Return a place on the axis, directions across and along it, points by these, and their spacing; and the planes.

    None where there is no axis, and no planes where some points of a cloud lie in none.
    """
    line = _axis(some, tree)
    if line is None:
        return None, []
    spacing = float(np.median(tree.query(some, k=[3])[0]))
    placed = (some - line[0]) @ line[1].T
    each = (_planes(placed, spacing, far) for far in FARTHER)
    return (*line, placed, spacing), [planes for planes in each if planes is not None]


def _axis(some: Floats, tree: scipy.spatial.cKDTree) -> tuple[Floats, Floats] | None:
    """Return a place on the line that the lines along most steps meet, and directions across and along it.

    None where they meet none, or one at infinity.
    """
    away, nearest = map(np.asarray, tree.query(some, k=[2, 3]))
    apart = away[:, 0] > TWINS * np.median(away[:, 1])
    if apart.sum() < FEWEST:
        return None
    local, steps = some[apart], (tree.data[nearest[:, 0]] - some)[apart]
    extent = float(np.abs(tree.data).max())
    ahead = steps / np.sqrt((steps**2).sum(axis=1, keepdims=True))
    rows = np.hstack([np.cross(local / extent, ahead), ahead])
    kept = np.ones(len(rows), np.bool_)
    for _ in range(ROUNDS):
        line = np.linalg.eigh(rows[kept].T @ rows[kept])[1][:, 0]
        off = np.abs(rows @ line)
        kept = off <= np.quantile(off, KEPT)
    u, m = line[:3], line[3:]
    length = float(np.sqrt(u @ u))
    if length < SLANTED or off[kept].max() > MEET:
        return None
    ahead = u / length * np.sign(u[np.argmax(np.abs(u))])
    return np.cross(u, m) / length**2 * extent, axes_across(ahead)


def _planes(placed: Floats, spacing: float, least: float) -> tuple[Floats, NDArray[np.int64], float] | None:
    """Return the angles of the planes, rising from 0 to pi, the plane of each point, and how near is too near.

    None where the points are in no such planes. Points that are too near to the axis have plane -1. The planes are told
    by points that are farther from it than the `least` share of the median.
    """
    radius = np.hypot(placed[:, 0], placed[:, 1])
    angle = np.arctan2(placed[:, 1], placed[:, 0]) % np.pi
    far = radius >= max(least * float(np.median(radius)), NEAR * spacing)
    if far.sum() < SLICES:
        return None
    wide = float(np.median(radius[far]))
    order = np.sort(angle[far])
    gaps = np.diff(order, append=order[0] + np.pi)
    cuts = np.flatnonzero(gaps > spacing / wide)
    if len(cuts) < SLICES or np.median(gaps[cuts]) * wide < APART * spacing or gaps[cuts].max() > WIDEST:
        return None
    starts = order[(cuts + 1) % len(order)]
    number = np.searchsorted(np.sort(starts), angle[far], side="right") % len(cuts)
    doubled = np.exp(2j * angle[far]) * radius[far] ** 2
    sums = np.bincount(number, doubled.real) + 1j * np.bincount(number, doubled.imag)
    middles = np.sort(np.angle(sums) / 2 % np.pi)
    turn = (angle[:, None] - middles + np.pi / 2) % np.pi - np.pi / 2
    plane = np.abs(turn).argmin(axis=1)
    off = radius * np.sin(turn[np.arange(len(plane)), plane])
    if np.mean(np.abs(off[far]) > PARTED * spacing) > STRAYS:
        return None
    least = float(np.diff(middles, append=middles[0] + np.pi).min())
    near = max(NEAR * spacing, DOUBT * float(np.sqrt(np.mean(off[far] ** 2))) / least)
    return middles, np.where(radius > near, plane, -1), near


def _outlines(
    placed: Floats, middles: Floats, plane: NDArray[np.int64], near: float, spacing: float
) -> tuple[Floats, Floats] | None:
    """Return the angles of the half planes, and their outlines; None where these are not one piece each."""
    caps = _caps(placed[plane < 0], near, spacing)
    if caps is None:
        return None
    across = np.arange(-near, near + spacing / 2, spacing)
    found: list[tuple[float, Floats]] = []
    for k, angle in enumerate(middles.tolist()):
        ahead = np.array([np.cos(angle), np.sin(angle)])
        own = placed[plane == k]
        points = [np.column_stack([own[:, :2] @ ahead, own[:, 2]])]
        drawn = [way for way in (1, -1) if (way * points[0][:, 0] > 0).any()]
        points += [np.column_stack([across, _height(cap, across[:, None] * ahead)]) for cap in caps]
        both = np.concatenate(points)
        curves = _halves(both if len(drawn) == 2 else _mirrored(both, drawn[0]), on_axis=len(caps) > 0)
        if curves is None:
            return None
        found += [(angle, curves[0]) if way > 0 else (angle + np.pi, curves[1]) for way in drawn]
    angles = np.sort([angle for angle, _ in found])
    turn = np.diff(angles, append=angles[0] + 2 * np.pi)
    if turn.max() > min(WIDEST, MISSING * float(np.median(turn))):
        return None
    count = max(8, int(np.ceil(max(float(along(curve)[-1]) for _, curve in found) / spacing)))
    found.sort(key=lambda one: one[0])
    return angles, np.stack([evenly(curve, count) for _, curve in found])


def _mirrored(points: Floats, way: int) -> Floats:
    """Give a plane that has an outline on one side of the axis the same on the other."""
    kept = points[way * points[:, 0] >= 0]
    return np.concatenate([kept, kept * np.array([-1.0, 1.0])])


def _caps(points: Floats, near: float, spacing: float) -> list[Floats] | None:
    """Fit heights  c . (1, x, y, x^2 + y^2)  to the points near the axis at both ends; none where it meets nothing."""
    if len(points) == 0:
        return []
    order = np.argsort(points[:, 2], kind="stable")
    cuts = np.flatnonzero(np.diff(points[order, 2]) > near + spacing) + 1
    ends = np.split(points[order], cuts)
    if len(ends) != 2 or min(map(len, ends)) < 2:
        return None
    fitted = (np.linalg.lstsq(_terms(end[:, :2]), end[:, 2], rcond=None)[0] for end in ends)
    return [np.asarray(cap, np.float64) for cap in fitted]


def _terms(places: Floats) -> Floats:
    return np.column_stack([np.ones(len(places)), places, (places**2).sum(axis=1)])


def _height(cap: Floats, places: Floats) -> Floats:
    return np.asarray(_terms(places) @ cap)


def _halves(points: Floats, *, on_axis: bool) -> tuple[Floats, Floats] | None:
    """Return the outline on either side of the axis, distance and height; None unless there is one on each."""
    distinct = np.unique(points, axis=0)
    inside = outline(distinct)
    rings = [distinct[ring] for ring in inside.rings]
    if inside.open or len(rings) != (1 if on_axis else 2):
        return None
    if on_axis:
        return _cut(rings[0])
    sides = sorted(rings, key=lambda ring: float(ring[:, 0].mean()))
    if sides[0][:, 0].max() >= 0 or sides[1][:, 0].min() <= 0:
        return None
    return _begun(sides[1]), _begun(sides[0] * np.array([-1.0, 1.0])[None])


def _cut(ring: Floats) -> tuple[Floats, Floats] | None:
    """Cut a ring where it crosses the axis, twice, into two outlines from the upper end to the lower."""
    nearly = np.where(ring[:, 0] == 0, 1e-300, ring[:, 0])
    following = np.roll(np.column_stack([nearly, ring[:, 1]]), -1, axis=0)
    crossing = np.flatnonzero(nearly * following[:, 0] < 0)
    if len(crossing) != 2:
        return None
    share = nearly[crossing] / (nearly[crossing] - following[crossing, 0])
    height = ring[crossing, 1] + share * (following[crossing, 1] - ring[crossing, 1])
    first, second = crossing.tolist()
    one = ring[first + 1 : second + 1]
    other = np.concatenate([ring[second + 1 :], ring[: first + 1]])
    pole = [np.array([[0.0, float(z)]]) for z in height]
    sides = [np.concatenate([pole[0], one, pole[1]]), np.concatenate([pole[1], other, pole[0]])]
    sides = [side if side[0, 1] >= side[-1, 1] else side[::-1] for side in sides]
    right = [side for side in sides if side[:, 0].sum() > 0]
    left = [side * np.array([-1.0, 1.0]) for side in sides if side[:, 0].sum() <= 0]
    return (right[0], left[0]) if len(right) == len(left) == 1 else None


def _begun(ring: Floats) -> Floats:
    """Turn a ring so that it runs around from its outer side, and close it."""
    turned = ring if area(ring) > 0 else ring[::-1]
    center = turned.mean(axis=0)
    away = np.abs(np.arctan2(turned[:, 1] - center[1], turned[:, 0] - center[0]))
    begun = np.roll(turned, -int(np.argmin(away)), axis=0)
    return np.concatenate([begun, begun[:1]])
