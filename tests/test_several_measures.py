"""What is measured of several rings a slice, and their curves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from conftest import law, seeds
from test_several_contours import disk, trained
from tomomesh.measure.contour import crossings, crossings_between, measure_contour
from tomomesh.measure.polygon import along, evenly, inside, inside_lattice
from tomomesh.model.lattice import lattice
from tomomesh.segmentation.contours.curved import FINE, evened, finely
from tomomesh.segmentation.contours.train import drawn
from tomomesh.som.even_spacing import bridged_edges, even_spacing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Mask = NDArray[np.bool_]


def turning(count: int, radius: float, center: tuple[float, float] = (0.0, 0.0)) -> Floats:
    turn = 2 * np.pi * np.arange(count) / count
    return np.column_stack([center[0] + radius * np.cos(turn), center[1] + radius * np.sin(turn)])


class TestMeasures:
    """What is said of a contour."""

    def test_a_circle(self) -> None:
        found = measure_contour(turning(100, 10))
        assert found.perimeter == pytest.approx(20 * np.pi, rel=1e-3)
        assert found.area == pytest.approx(100 * np.pi, rel=1e-2)
        assert found.self_crossings == 0
        assert found.longest_over_median == pytest.approx(1)
        assert found.evenness < 1e-9
        assert found.closure_gap == pytest.approx(found.perimeter / 100)

    def test_a_chain_has_a_closure_gap_and_no_area(self) -> None:
        found = measure_contour(turning(100, 10)[:50], closed=False)
        assert found.closure_gap == pytest.approx(20, rel=1e-2)
        assert found.area == 0
        assert found.perimeter == pytest.approx(10 * np.pi, rel=0.05)

    def test_an_eight_crosses_itself_once(self) -> None:
        turn = 2 * np.pi * (np.arange(40) + 0.5) / 40
        assert crossings(np.column_stack([np.sin(turn), np.sin(2 * turn)])) == 1

    @law(30)
    @given(seeds)
    def test_crossings_are_those_of_every_pair_of_sides(self, seed: int) -> None:
        line = np.random.default_rng(seed).random((12, 2))
        ahead = np.roll(line, -1, axis=0)

        def side(n: int, p: Floats) -> float:
            along, across = ahead[n] - line[n], p - line[n]
            return float(along[0] * across[1] - along[1] * across[0])

        count = 0
        for a in range(12):
            for b in range(a + 2, 12 - (a == 0)):
                parted = side(a, line[b]) * side(a, ahead[b]) < 0
                count += parted and side(b, line[a]) * side(b, ahead[a]) < 0
        assert crossings(line) == count

    def test_contours_that_cross_each_other_are_counted(self) -> None:
        rings = [turning(60, 10), turning(60, 10, (12.3, 0.1)), turning(60, 3, (40, 0))]
        np.testing.assert_array_equal(crossings_between(rings), [[0, 2, 0], [2, 0, 0], [0, 0, 0]])
        assert crossings_between([]).shape == (0, 0)

    def test_a_gap_is_found_and_is_no_unevenness(self) -> None:
        ring = np.delete(turning(80, 10), range(10), axis=0)
        gaps = bridged_edges(ring, lattice("ring", 70), 2.0)
        found = measure_contour(ring, bridged=gaps)
        assert gaps.sum() == 1
        assert found.longest_over_median > 9
        assert found.evenness < 1e-9


class TestCurves:
    """Rings as smooth curves."""

    def test_few_neurons_are_spaced_along_the_bend(self) -> None:
        turn = np.sort(np.random.default_rng(0).uniform(0, 0.06, 40) + 2 * np.pi * np.arange(40) / 40)
        ring = 50 * np.column_stack([np.cos(turn), np.sin(turn)])
        none = np.zeros(40, bool)
        even, _ = evened(ring, none)
        chords, _ = even_spacing(ring, lattice("ring", 40), none)
        assert np.abs(np.hypot(*even.T) - 50).max() < 0.08 < np.abs(np.hypot(*chords.T) - 50).max()
        assert measure_contour(even).evenness < 1e-3

    @law(60)
    @given(seed=seeds, count=st.integers(3, 90), size=st.sampled_from([1e-3, 1.0, 1e4]), doubled=st.booleans())
    def test_a_curve_is_scipy_s_periodic_spline(self, seed: int, count: int, size: float, doubled: bool) -> None:
        """Also where two neurons lie at one place."""
        ring = size * np.random.default_rng(seed).normal(size=(count, 2))
        ring[1] = ring[0] if doubled else ring[1]
        closing = np.concatenate([ring, ring[:1]])
        chord = np.sqrt((np.diff(closing, axis=0) ** 2).sum(axis=1))
        step = np.sqrt(np.maximum(chord, 1e-6 * chord.max()))
        knots = np.concatenate([[0.0], np.cumsum(step)])
        place = knots[:-1, None] + np.arange(FINE) / FINE * step[:, None]
        wanted = CubicSpline(knots, closing, bc_type="periodic")(place)
        np.testing.assert_allclose(finely(ring), wanted, atol=1e-8 * size)

    @law(60)
    @given(seed=seeds, points=st.integers(1, 40), count=st.integers(1, 50), axes=st.integers(2, 3))
    def test_even_steps_are_those_of_numpy_s_interpolation(self, seed: int, points: int, count: int, axes: int) -> None:
        line = np.random.default_rng(seed).normal(size=(points, axes))
        line[points // 2] = line[points // 3]
        way = along(line)
        wanted = np.linspace(0, way[-1], count) if count > 1 else way[-1:] / 2
        expected = np.stack([np.interp(wanted, way, axis) for axis in line.T], axis=1)
        np.testing.assert_allclose(evenly(line, count), expected, atol=1e-9)

    @law(60)
    @given(seed=seeds, count=st.integers(3, 30))
    def test_places_of_a_lattice_lie_inside_as_each_of_them_does(self, seed: int, count: int) -> None:
        rng = np.random.default_rng(seed)
        ring, x, y = rng.normal(size=(count, 2)), *(np.sort(rng.normal(size=size)) for size in rng.integers(1, 20, 2))
        each = inside(ring, np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)).reshape(len(y), len(x))
        np.testing.assert_array_equal(inside_lattice(ring, x, y), each)

    def test_gaps_stay_where_they_are(self) -> None:
        ring = np.delete(turning(80, 10), [*range(20, 32), *range(60, 68)], axis=0)
        gaps = bridged_edges(ring, lattice("ring", 60), 2.0)
        even, moved = evened(ring, gaps)
        ends = np.roll(even, -1, axis=0) - even
        assert moved.sum() == 2
        np.testing.assert_allclose(
            sorted(np.hypot(*ends[moved].T)), sorted(np.hypot(*(np.roll(ring, -1, axis=0) - ring)[gaps].T)), atol=1e-9
        )

    def test_a_line_is_drawn_from_a_place(self) -> None:
        line = turning(400, 10)
        np.testing.assert_allclose(drawn(line, 8)[0], [10, 0], atol=1e-9)
        np.testing.assert_allclose(
            drawn(line, 8, np.array([0.0, 30.0])), turning(8, 10)[[2, 3, 4, 5, 6, 7, 0, 1]], atol=0.01
        )

    def test_shrinking_is_undone(self) -> None:
        found = trained([disk(48, 48, 41, 39)], "components", neurons=20)
        assert abs(np.hypot(*(found.contours[0].codebook - 48).T).mean() - 40) < 0.15
