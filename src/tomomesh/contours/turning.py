"""The places between outlines in planes about an axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .axis import HalfPlanes

    Floats = NDArray[np.float64]


def between_half_planes(found: HalfPlanes) -> Floats:
    """Interpolate outlines over the angle: by a periodic cubic spline of distance and height at each share of length.

    Chords between the planes would cut off the bulge between them: (sin(a) / a) of each cross-section, a the angle
    between two half planes, 4.5 % of the volume where it is 30 degrees.

    Parameters
    ----------
    found : HalfPlanes

    Returns
    -------
    (k, 3) float array
        As far apart as the points of the outlines.
    """
    angles, curves = found.angles, found.curves
    turn = np.diff(angles, append=angles[0] + 2 * np.pi)
    spline = scipy.interpolate.CubicSpline(
        np.append(angles, angles[0] + 2 * np.pi), np.concatenate([curves, curves[:1]]), axis=0, bc_type="periodic"
    )
    wide = np.maximum(curves[..., 0], np.roll(curves[..., 0], -1, axis=0))
    count = np.maximum(np.ceil(wide * turn[:, None] / found.spacing).astype(np.int64) - 1, 0)
    plane, along = (np.repeat(one.ravel(), count.ravel()) for one in np.indices(count.shape))
    share = (_ranks(count.ravel()) + 1) / (count[plane, along] + 1)
    angle = angles[plane] + share * turn[plane]
    places = _at(spline, angle, along)
    radius, height = np.maximum(places[:, 0], 0.0), places[:, 1]
    local = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
    return np.asarray(found.origin + local @ found.axes)


def _ranks(count: NDArray[np.int64]) -> NDArray[np.int64]:
    """Count the members of groups of so many each, from 0."""
    return np.arange(int(count.sum())) - np.repeat(np.cumsum(count) - count, count)


def _at(spline: scipy.interpolate.CubicSpline, angle: Floats, along: NDArray[np.int64]) -> Floats:
    """Evaluate the polynomials of each angle (k,) at one place along the outlines each."""
    piece = np.clip(np.searchsorted(spline.x, angle, side="right") - 1, 0, len(spline.x) - 2)
    step = (angle - spline.x[piece])[:, None]
    a, b, c, d = (spline.c[power, piece, along] for power in range(4))
    return np.asarray(((a * step + b) * step + c) * step + d)
