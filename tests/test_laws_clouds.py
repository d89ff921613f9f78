"""What a cloud tells of itself, from the definitions: spacing, the medians of regions, and strays."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from conftest import law, seeds
from tomomesh.pointcloud.cloud import Cloud
from tomomesh.pointcloud.whole import Whole
from tomomesh.progress import silent

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def patches(rng: np.random.Generator, thin: float) -> Floats:
    """Throw points on a plane, one a unit, and fewer on a patch above it."""
    dense = np.column_stack([rng.uniform(0, 24, (500, 2)), np.zeros(500)])
    count = int(100 / thin**2) + 1
    return np.concatenate([dense, np.column_stack([rng.uniform(0, 10, (count, 2)), np.full(count, 9.0)])])


def slow_spacing(points: Floats, apart: float) -> Floats:
    """Count the points within 2.25 sampling distances of each; within twice that where they are under 8, and so on."""
    away, spacing = cdist(points, points), np.empty(len(points))
    for p, row in enumerate(away):
        sight = 2.25 * apart
        while (row <= sight).sum() < 8:
            sight *= 2
        while (row <= sight).sum() > 64:
            sight /= 2
        spacing[p] = sight * np.sqrt(np.pi / (row <= sight).sum())
    return spacing


def slow_medians(values: Floats, points: Floats, apart: float) -> Floats:
    """Take the (upper) median over a point's cube of 12 sampling distances; over all where that holds under 8."""
    cubes = np.floor((points - points.min(axis=0)) / (12 * apart))
    inside = (cubes[:, None] == cubes).all(axis=2)
    return np.array([np.sort(values[row])[row.sum() // 2] if row.sum() >= 8 else np.median(values) for row in inside])


@law(40)
@given(seeds, st.floats(0.8, 6), st.floats(0.6, 1.5))
def test_strays_are_those_far_from_all_others_of_their_region(seed: int, thin: float, apart: float) -> None:
    """From 1.7 times the spacing that is usual there, or eight times the cloud's."""
    points = patches(np.random.default_rng(seed), thin)
    cloud = Cloud.of(np.column_stack([points, np.ones(len(points))]), apart, 0, Whole(), 1, silent)
    found, stray = cloud.spacing()
    points = cloud.points[:, :3]
    spacing = slow_spacing(points, apart)
    usual = slow_medians(spacing, points, apart)
    expected = spacing > np.minimum(1.7 * usual, 8 * np.median(spacing))
    np.testing.assert_array_equal(stray, expected)
    np.testing.assert_allclose(found, np.where(expected, usual, np.sqrt(spacing * usual)), rtol=1e-12)
