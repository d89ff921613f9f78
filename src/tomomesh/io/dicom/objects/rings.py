"""Polygons as rings of points: corners alone do not tell how a contour runs between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

NO_AREA = 1e-9
"""Polygons of less area, in shares of their squared length, enclose nothing: far above the rounding of doubles (1e-16),
and far below a sliver a thousand times as long as wide (2.5e-4)."""
SLIT = 0.05
"""Corners nearer than this share of a polygon's median side are one. A tenth of what a contour's own detail could be:
with twice of it nothing changes, as long as no side is that short."""
FEWEST_POINTS = 24
"""Points that a ring gets at least: a circle's polygon of so many has 1.1 % less area."""


def vector_area(polygon: Floats) -> Floats:
    """Return the area of a closed polygon (u, 3) in space times its normal, (3,) (Newell)."""
    local = polygon - polygon[0]
    return np.asarray(np.cross(local, np.roll(local, -1, axis=0)).sum(axis=0) / 2)


def perimeter(polygon: Floats) -> float:
    """Return the length of a closed polygon (u, 3)."""
    return float(_sides(polygon).sum())


def parted(polygon: Floats) -> list[Floats]:
    """Part a polygon (u, 3) where it returns to one of its corners.

    A keyhole, an inner ring that is joined to the outer one by a slit, becomes two rings, and the slit nothing. Corners
    nearer than `SLIT` times the median side are one, as the two banks of a slit may be drawn apart.

    Returns
    -------
    list of (u, 3) float arrays
        Those that enclose an area; none where the whole polygon is flat.
    """
    chain: list[tuple[float, ...]] = []
    place: dict[tuple[float, ...], int] = {}
    found = []
    for corner in map(tuple, _joined(polygon).tolist()):
        start = place.setdefault(corner, len(chain))
        if start < len(chain):
            found.append(chain[start:])
            for passed in chain[start + 1 :]:
                del place[passed]
            del chain[start + 1 :]
        else:
            chain.append(corner)
    rings = [np.array(ring) for ring in [*found, chain] if len(ring) > 2]
    return [ring for ring in rings if np.linalg.norm(vector_area(ring)) > NO_AREA * perimeter(ring) ** 2]


def _joined(polygon: Floats) -> Floats:
    """Move corners (u, 3) that are all but the same to the first of them."""
    sides = _sides(polygon)
    near = SLIT * float(np.median(sides[sides > 0])) if (sides > 0).any() else 0.0
    joined = polygon.copy()
    for one, other in sorted(scipy.spatial.cKDTree(polygon).query_pairs(near)):
        joined[other] = joined[one]
    return joined


def thinned(ring: Floats, distance: float) -> Floats:
    """Leave out corners of a ring (u, 3) that follow others within a distance along it; `FEWEST_POINTS` stay."""
    along = np.concatenate([[0.0], np.cumsum(_sides(ring))])
    lot = np.floor(along / min(distance, along[-1] / FEWEST_POINTS))
    return np.asarray(ring[np.diff(lot[:-1], prepend=-1.0) > 0])


def pieces_of(ring: Floats, distance: float) -> NDArray[np.float64]:
    """Return into how many pieces each side of a ring (u, 3) is to be cut, for points about so far apart."""
    sides = _sides(ring)
    return np.maximum(np.rint(sides / min(distance, float(sides.sum()) / FEWEST_POINTS)), 1)


def filled(ring: Floats, pieces: NDArray[np.int64]) -> Floats:
    """Return the points that cut each side of a ring (u, 3) into equal pieces, its corners among them."""
    start = np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = (np.arange(len(start)) - start) / np.repeat(pieces, pieces)
    way = np.roll(ring, -1, axis=0) - ring
    return np.asarray(np.repeat(ring, pieces, axis=0) + share[:, None] * np.repeat(way, pieces, axis=0))


def _sides(polygon: Floats) -> Floats:
    return np.asarray(np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1))
