"""What lies near each other, and what is linked: found as SciPy finds it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import make_interp_spline
from scipy.spatial.distance import cdist

from conftest import law
from tomomesh.dynamics.low_pass import OneRing, adjacency
from tomomesh.isosurface import parts
from tomomesh.measure.distance import pairs_within


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(0, 60),
    wide=st.integers(1, 9),
    dimensions=st.sampled_from([2, 3]),
    radius=st.integers(0, 6),
    scale=st.sampled_from([2.0**-40, 1.0, 2.0**40]),
)
@law(200)
def test_pairs_are_all_that_are_near_and_no_others(
    seed: int, count: int, wide: int, dimensions: int, radius: int, scale: float
) -> None:
    """On whole places, so that many lie on each other or exactly a radius apart; one more lies far from all."""
    points = np.random.default_rng(seed).integers(-wide, wide, (count, dimensions)).astype(np.float64)
    points[: count // 7] += 2.0**20
    wanted = np.argwhere(np.triu(cdist(points, points) <= radius, 1))
    found = pairs_within(points * scale, radius * scale)
    assert sorted(map(tuple, found.tolist())) == sorted(map(tuple, wanted.tolist()))


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 30))
@law(60)
def test_neighbors_along_edges_are_the_rows_of_the_adjacency(seed: int, count: int) -> None:
    chosen = np.random.default_rng(seed)
    edges = np.argwhere(np.triu(chosen.random((count, count)) < 0.4, 1))
    edges = np.where(chosen.random((len(edges), 1)) < 0.5, edges, edges[:, ::-1])
    ring, rows = OneRing.of_edges(chosen.permutation(edges), count), adjacency(edges, count)
    np.testing.assert_array_equal(ring.start, rows.indptr)
    np.testing.assert_array_equal(ring.neighbors, rows.indices)


@pytest.mark.parametrize("times", [2, 3, 7])
def test_parts_of_slices_weigh_what_the_spline_through_the_sums_says(times: int) -> None:
    chosen, at = np.random.default_rng(times), np.arange(2 * parts.BESIDE + 2)
    values = chosen.random(2 * parts.BESIDE + 1)
    share = parts.BESIDE + np.arange(times + 1) / times
    there, back = (
        times * np.diff(make_interp_spline(at, np.concatenate([[0], np.cumsum(one)]))(share))
        for one in (values, values[::-1])
    )
    np.testing.assert_allclose(parts._weights(times) @ values, (there + back[::-1]) / 2, rtol=3e-6)
