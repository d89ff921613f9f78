"""Closed curves in a plane: noise taken off, drawn finely, and the distance to them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..measure.polygon import side_lengths

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

WEIGHTS = np.concatenate([[0.0], 10.0 ** np.arange(-3, 5.1, 0.25)])
"""Weights of the third differences among which generalized cross-validation chooses."""
LONG = 1.5
"""Medians over which a side of a ring is a gap, and gets points. Chosen: half of it changes the distance by +22.6 %,
twice by -4.0 %."""
DENSE = 0.25
"""Distance of the points on a fine curve, in pixels. Chosen: half of it changes the distance by +0.4 %, twice by
-0.2 %."""
NEAR = 3.0
"""Pixels from a curve within which distances are exact. Chosen: half of it changes the distance by +2.5 %, twice by
+10.4 %."""


def without_noise(ring: Floats) -> Floats:
    """Take the noise off a closed curve by Whittaker's smoother (1923).

    Minimizes  sum |x - y|^2 + w sum |third differences|^2,  which on a ring is a filter of its Fourier coefficients;
    w by generalized cross-validation (Craven & Wahba 1979). What is smooth stays where it is: the radius of a ring of
    u points changes by w (2 pi / u)^6.

    Parameters
    ----------
    ring : (u, 2) float array

    Returns
    -------
    (u, 2) float array
    """
    count = len(ring)
    spectrum = np.fft.fft(ring[:, 0] + 1j * ring[:, 1])
    rough = (2 - 2 * np.cos(2 * np.pi * np.fft.fftfreq(count))) ** 3
    lost = WEIGHTS[1:, None] * rough / (1 + WEIGHTS[1:, None] * rough)
    score = (np.abs(spectrum * lost) ** 2).sum(axis=1) / lost.sum(axis=1) ** 2
    smooth = np.fft.ifft(spectrum * (1 - lost[np.argmin(score)]))
    return np.stack([smooth.real, smooth.imag], axis=1)


def redrawn(ring: Floats, distance: float) -> Floats:
    """Draw a closed curve through the points of a ring, with points no farther apart than a distance.

    A periodic cubic spline over the roots of the chords (centripetal: Lee 1989), which neither overshoots at uneven
    points nor cuts off the bulge between them.
    """
    closed = np.concatenate([ring, ring[:1]])
    chord = np.sqrt((np.diff(closed, axis=0) ** 2).sum(axis=1))
    knots = np.concatenate([[0.0], np.cumsum(np.sqrt(chord))])
    pieces = np.maximum(np.ceil(chord / distance), 1).astype(np.int64)
    first = np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = (np.arange(len(first)) - first) / np.repeat(pieces, pieces)
    place = np.repeat(knots[:-1], pieces) + share * np.repeat(np.diff(knots), pieces)
    return np.asarray(scipy.interpolate.CubicSpline(knots, closed, bc_type="periodic")(place))


def fine_curve(ring: Floats, distance: float) -> Floats:
    """Bridge the gaps of a ring (u, 2), take its noise off and draw it finely."""
    even = redrawn(ring, LONG * float(np.median(side_lengths(ring))))
    smooth = without_noise(even)
    apart = (smooth != np.roll(smooth, -1, axis=0)).any(axis=1)
    return redrawn(smooth[apart], distance)


def chord(curve: Floats) -> Floats:
    """Return points from one end of an open curve (p, 2) to the other, as far apart as its own."""
    distance = np.asarray(scipy.spatial.cKDTree(curve).query(curve, k=[2])[0])
    between = scipy.spatial.distance.squareform(scipy.spatial.distance.pdist(curve))
    tree = scipy.sparse.csgraph.minimum_spanning_tree(between)
    ways = scipy.sparse.csgraph.dijkstra(tree, directed=False)
    first = int(np.argmax(ways[0]))
    last = int(np.argmax(ways[first]))
    way = curve[last] - curve[first]
    count = int(np.hypot(*way) / np.median(distance))
    return np.asarray(curve[first] + np.arange(1, count)[:, None] / max(count, 1) * way)


@dataclass(frozen=True)
class Moments:
    """Area of what curves enclose, its centroid (2,), and the radius of a disk as spread out."""

    area: float
    center: Floats
    radius: float


def moments_of(curves: Sequence[Floats]) -> Moments:
    """Integrate over what curves enclose, each with the inside on its left (Green's theorem)."""
    origin = curves[0][0]
    p = np.concatenate(list(curves)) - origin
    q = np.concatenate([np.roll(curve, -1, axis=0) for curve in curves]) - origin
    cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    area = float(cross.sum() / 2)
    center = ((p + q) * cross[:, None]).sum(axis=0) / (6 * area)
    second = float((cross * (p * p + p * q + q * q).sum(axis=1)).sum() / (12 * area))
    return Moments(area, origin + center, float(np.sqrt(max(2 * (second - (center**2).sum()), 0.0))))


def mask_of(
    curves: Sequence[Floats], pixel: float, low: NDArray[np.int64], high: NDArray[np.int64], shift: Floats
) -> NDArray[np.bool_]:
    """Tell which pixels (x, y) from low to high lie inside of curves that are shifted; those must lie within."""
    moved = [(curve + shift) / pixel - low for curve in curves]
    return _filled(moved, tuple((high - low)[::-1].tolist()))


@dataclass(frozen=True)
class Field:
    """Signed distances on the pixels around a center, negative inside.

    Attributes
    ----------
    low : (2,) int64 array
        The first pixel (x, y), relative to the center's.
    values : (J, I) float32 array
        Distances in pixels.
    """

    low: NDArray[np.int64]
    values: NDArray[np.float32]

    @property
    def high(self) -> NDArray[np.int64]:
        """One past the last pixel (x, y)."""
        return self.low + self.values.shape[::-1]

    def over(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return the distances over other pixels; beyond the known ones the way to them is added."""
        columns, rows = (np.arange(low[a], high[a]) for a in (0, 1))
        x, y = (np.clip(n, self.low[a], self.high[a] - 1) for a, n in ((0, columns), (1, rows)))
        way = np.hypot((columns - x)[None, :], (rows - y)[:, None])
        known = self.values[np.ix_(y - self.low[1], x - self.low[0])]
        return np.asarray(known + way, np.float32)


def field_of(curves: Sequence[Floats], center: Floats, pixel: float, margin: int) -> Field:
    """Measure the signed distance to fine curves.

    Parameters
    ----------
    curves : sequence of (u, 2) float arrays
        Points `DENSE` pixels apart.
    center : (2,) float array
        The middle of pixel (0, 0).
    pixel : float
        Edge of a pixel.
    margin : int
        Pixels around the curves.

    Returns
    -------
    Field
        Exact within `NEAR` pixels of the curves, and within a pixel farther away.
    """
    local = [(curve - center) / pixel for curve in curves]
    every = np.concatenate(local)
    low = np.floor(every.min(axis=0)).astype(np.int64) - margin
    shape = tuple((np.ceil(every.max(axis=0)).astype(np.int64) + margin + 1 - low)[::-1].tolist())
    moved = [curve - low for curve in local]
    inside = _filled(moved, shape)
    away = _distance(moved, shape)
    return Field(low, np.where(inside, -away, away).astype(np.float32))


def _filled(curves: Sequence[Floats], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Tell which pixels lie inside of curves, by the sides crossed along each row; no side may cross two rows."""
    p = np.concatenate(list(curves))
    q = np.concatenate([np.roll(curve, -1, axis=0) for curve in curves])
    row = np.floor(np.maximum(p[:, 1], q[:, 1])).astype(np.int64)
    crossed = np.floor(np.minimum(p[:, 1], q[:, 1])) < row
    p, q, row = p[crossed], q[crossed], row[crossed]
    x = p[:, 0] + (row - p[:, 1]) / (q[:, 1] - p[:, 1]) * (q[:, 0] - p[:, 0])
    at = row * shape[1] + np.ceil(x).astype(np.int64)
    toggles = np.bincount(at, minlength=shape[0] * shape[1]).reshape(shape)
    return np.asarray(np.cumsum(toggles, axis=1) % 2 == 1)


def _distance(curves: Sequence[Floats], shape: tuple[int, ...]) -> Floats:
    """Measure how far pixels are from curves."""
    points = np.concatenate(list(curves))
    sides = np.stack([np.concatenate([np.roll(curve, n, axis=0) for curve in curves]) - points for n in (-1, 1)])
    column, row = np.rint(points).astype(np.int64).T
    holder = np.full(shape, -1, np.int64)
    holder[row[::-1], column[::-1]] = np.arange(len(points))[::-1]
    y, x = scipy.ndimage.distance_transform_edt(holder < 0, return_distances=False, return_indices=True)
    nearest = points[holder[y, x]]
    away = np.hypot(np.arange(shape[1]) - nearest[..., 0], np.arange(shape[0])[:, None] - nearest[..., 1])
    near = np.argwhere(away < NEAR)
    away[tuple(near.T)] = _to_sides(near[:, ::-1].astype(np.float64), points, sides)
    return np.asarray(away)


def _to_sides(places: Floats, points: Floats, sides: Floats) -> Floats:
    """Measure how far places are from the two sides (2, p, 2) at the point that is nearest to each."""
    _, nearest = scipy.spatial.cKDTree(points).query(places)
    step, side = places - points[nearest], sides[:, nearest]
    share = (step * side).sum(axis=2) / np.maximum((side**2).sum(axis=2), 1e-300)
    on_side = np.clip(share, 0, 1)[..., None] * side
    return np.asarray(np.sqrt(((step - on_side) ** 2).sum(axis=2)).min(axis=0))
