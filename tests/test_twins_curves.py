"""Curves through rings, points evenly along lines and moments of slices, against SciPy, NumPy and the definition."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from conftest import law, seeds
from tomomesh.kernels.contours.moments import plane_moments
from tomomesh.kernels.contours.splines import draw_closed_spline
from tomomesh.measure.polygon import along, evenly
from tomomesh.som.inputs import median


@law(60)
@given(seed=seeds, u=st.integers(3, 60), d=st.integers(1, 3))
def test_a_closed_curve_is_scipys_periodic_spline(seed: int, u: int, d: int) -> None:
    rng = np.random.default_rng(seed)
    points, step, pieces = rng.normal(size=(u, d)), rng.uniform(0.2, 2, u), rng.integers(1, 6, u)
    knots = np.concatenate([[0.0], np.cumsum(step)])
    places = np.concatenate([a + s * np.arange(p) / p for a, s, p in zip(knots[:-1], step, pieces, strict=True)])
    drawn = np.empty((pieces.sum(), d))
    draw_closed_spline(points, step, pieces, drawn)
    wanted = CubicSpline(knots, np.concatenate([points, points[:1]]), bc_type="periodic")(places)
    np.testing.assert_allclose(drawn, wanted, rtol=0, atol=1e-9)


@law(60)
@given(seed=seeds, p=st.integers(1, 40), d=st.integers(1, 3), count=st.integers(1, 50), repeated=st.booleans())
def test_points_evenly_along_a_line_are_interpolated(seed: int, p: int, d: int, count: int, repeated: bool) -> None:
    line = np.random.default_rng(seed).normal(size=(p, d))
    if repeated:  # points at one place
        line = np.repeat(line, 2, axis=0)
    way = along(line)
    wanted = np.linspace(0, way[-1], count) if count > 1 else way[-1:] / 2
    placed = evenly(line, count)
    assert placed.shape == (count, d)
    np.testing.assert_allclose(
        placed, np.stack([np.interp(wanted, way, axis) for axis in line.T], axis=1), rtol=0, atol=1e-9
    )


@law(40)
@given(seed=seeds, share=st.floats(0, 1))
def test_moments_of_slices_are_sums_over_their_pixels(seed: int, share: float) -> None:
    mask = np.random.default_rng(seed).random((3, 7, 9)) < share
    sums = np.empty((3, 6))
    plane_moments(mask, sums)
    for plane, own in zip(mask, sums, strict=True):
        j, i = np.nonzero(plane)
        np.testing.assert_array_equal(own, [len(i), i.sum(), j.sum(), (i**2).sum(), (i * j).sum(), (j**2).sum()])


@law(60)
@given(values=st.lists(st.integers(-50, 50), min_size=1, max_size=30), seed=seeds)
def test_a_median_is_numpys_and_weights_repeat(values: list[int], seed: int) -> None:
    found = np.array(values, float)
    times = np.random.default_rng(seed).integers(1, 5, len(found))
    assert median(found) == np.median(found)
    assert median(found, times.astype(float)) == np.median(np.repeat(found, times))
