"""Rings drawn onto pixels, matched point by point, and carried between slices: twins from the definition."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import law, seeds
from tomomesh.kernels.contours.between import blend, carry_along, match_rings
from tomomesh.kernels.contours.rings import draw_rings
from tomomesh.measure.polygon import distance, inside

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def star(seed: int, count: int = 12) -> Floats:
    """Return a closed polygon around the middle of 20 x 24 pixels, the inside on its left."""
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * (np.arange(count) + rng.uniform(0, 0.8, count)) / count
    away = rng.uniform(2, 8, (count, 1)) * np.column_stack([np.cos(turn), np.sin(turn)])
    return np.asarray(np.array([11.3, 9.4]) + away)


def drawn(curves: list[Floats], shape: tuple[int, int], pixel: Floats, reach: float) -> NDArray[np.float32]:
    sizes = np.cumsum([len(curve) for curve in curves])
    onward = np.arange(1, sizes[-1] + 1)
    onward[sizes - 1] = np.append(0, sizes[:-1])
    depths = np.empty(shape, np.float32)
    draw_rings(np.concatenate(curves), onward, pixel, reach, depths, np.empty(shape, np.int32))
    return depths


class TestDrawing:
    """Depths of pixels inside of rings."""

    @law(40)
    @given(seeds, st.floats(0.5, 2.0), st.floats(0.5, 5.0))
    def test_is_the_distance_with_the_side(self, seed: int, wide: float, reach: float) -> None:
        ring, pixel = star(seed), np.array([wide, 1.0])
        found = drawn([ring], (20, 24), pixel, reach)
        places = np.stack(np.meshgrid(np.arange(24.0), np.arange(20.0)), axis=-1).reshape(-1, 2)
        away = np.minimum(distance(ring * pixel, places * pixel), reach).reshape(20, 24)
        within = inside(ring, places).reshape(20, 24)
        np.testing.assert_allclose(found, np.where(within, away, -away), atol=1e-5)

    @law(20)
    @given(seeds)
    def test_a_hole_is_outside_and_what_lies_in_it_inside(self, seed: int) -> None:
        one, middle = star(seed), np.array([11.3, 9.4])
        hole, core = (middle + share * (one - middle) for share in (0.6, 0.3))
        places = np.stack(np.meshgrid(np.arange(24.0), np.arange(20.0)), axis=-1).reshape(-1, 2)
        count = np.sum([inside(ring, places) for ring in (one, hole, core)], axis=0).reshape(20, 24)
        found = drawn([one, hole[::-1], core], (20, 24), np.ones(2), 3.0)
        np.testing.assert_array_equal(found > 0, count % 2 == 1)

    @law(40)
    @given(st.floats(0, 2 * np.pi), st.floats(-2, 2))
    def test_a_straight_side_is_crossed_where_it_passes(self, turn: float, offset: float) -> None:
        normal, middle = np.array([np.cos(turn), np.sin(turn)]), np.array([12.0, 12.0])
        along = np.array([-normal[1], normal[0]])
        corners = [normal * offset + 40 * along, -60 * normal + 40 * along, -60 * normal - 40 * along,
                   normal * offset - 40 * along]  # fmt: skip
        found = drawn([np.array(corners) + middle], (25, 25), np.ones(2), 4.0)
        row = found[12]
        for i in np.flatnonzero((row[:-1] > 0) != (row[1:] > 0)):
            place = np.array([i + row[i] / (row[i] - row[i + 1]), 12.0])
            assert abs((place - middle) @ normal - offset) < 1e-4

    def test_rings_beyond_the_pixels_are_no_harm(self) -> None:
        found = drawn([np.array([[-50.0, -50.0], [90.0, -50.0], [90.0, 90.0], [-50.0, 90.0]])], (8, 9), np.ones(2), 2.0)
        np.testing.assert_array_equal(found, 2.0)


class TestMatching:
    """Points of two rings, one by one."""

    @law(30)
    @given(seeds)
    def test_is_the_best_of_all_ways_around(self, seed: int) -> None:
        one, other = star(seed, 9), star(seed + 1, 7)
        pairs = np.empty((16, 2), np.int64)
        count = match_rings(one, other, np.empty((10, 8), np.int8), np.empty(8), pairs)
        cost = ((one[:, None] - other) ** 2).sum(axis=2)
        i, j = np.unravel_index(np.argmin(cost), cost.shape)
        cost = np.pad(np.roll(cost, (-i, -j), axis=(0, 1)), (0, 1), mode="wrap")
        least = np.full((10, 8), np.inf)
        for a in range(10):
            for b in range(8):
                before = [least[a - da, b - db] for da, db in ((1, 1), (1, 0), (0, 1)) if a >= da and b >= db]
                least[a, b] = cost[a, b] + (min(before) if a or b else 0.0)
        found = ((one[pairs[:count, 0]] - other[pairs[:count, 1]]) ** 2).sum() + cost[0, 0]
        assert found == pytest.approx(least[9, 7])
        assert set(pairs[:count, 0]) == set(range(9))
        assert set(pairs[:count, 1]) == set(range(7))

    def test_a_turned_start_changes_nothing(self) -> None:
        one = star(3, 40)
        other = np.roll(one + np.array([0.4, 0.2]), 11, axis=0)
        pairs = np.empty((80, 2), np.int64)
        count = match_rings(one, other, np.empty((41, 41), np.int8), np.empty(41), pairs)
        assert np.mean((pairs[:count, 1] - pairs[:count, 0]) % 40 == 11) > 0.5


class TestCarrying:
    """Offsets of the nearest point, and depths that are seen along them."""

    @law(20)
    @given(seeds)
    def test_pixels_have_the_offsets_of_the_nearest_point(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        points, ways, pixel = rng.uniform(-2, 16, (9, 2)), rng.normal(size=(9, 4)), np.array([1.0, 1.5])
        away, carried = np.empty((12, 14), np.float32), np.zeros((12, 14, 4), np.float32)
        carry_along(points, ways, pixel, 3.0, away, carried)
        places = np.stack(np.meshgrid(np.arange(14.0), np.arange(12.0)), axis=-1)
        squares = (((places[:, :, None] - points) * pixel) ** 2).sum(axis=3)
        np.testing.assert_allclose(away, np.minimum(squares.min(axis=2), 9.0), rtol=1e-5)
        near = squares.min(axis=2) < 9.0
        np.testing.assert_allclose(carried[near], ways[squares.argmin(axis=2)][near], rtol=1e-5)

    @law(20)
    @given(seeds, st.floats(0, 1))
    def test_depths_are_linear_between_pixels_and_slices(self, seed: int, share: float) -> None:
        rng = np.random.default_rng(seed)
        below, above = rng.normal(size=(2, 9, 11)).astype(np.float32)
        away = rng.uniform(0, 20, (9, 11)).astype(np.float32)
        carried = rng.normal(size=(9, 11, 4)).astype(np.float32)
        found = np.empty((9, 11), np.float32)
        blend(below, above, away, carried, 4.0, share, found)
        weight = np.clip(2 - 2 * np.sqrt(away) / 4.0, 0, 1)[..., None] * carried
        rows, columns = np.mgrid[:9, :11]
        one, other = (
            ndimage.map_coordinates(
                depths.astype(float),
                [np.clip(rows + weight[..., 2 * n + 1], 0, 8), np.clip(columns + weight[..., 2 * n], 0, 10)],
                order=1,
            )
            for n, depths in enumerate((below, above))
        )
        np.testing.assert_allclose(found, (1 - share) * one + share * other, atol=1e-4)

    @law(100)
    @given(seeds, st.floats(0.5, 50))
    def test_what_no_point_reaches_is_blended_without_what_is_carried(self, seed: int, reach: float) -> None:
        rng = np.random.default_rng(seed)
        below, above = rng.normal(size=(2, 5, 6)).astype(np.float32)
        away, found = np.empty((5, 6), np.float32), np.empty((5, 6), np.float32)
        carried = np.full((5, 6, 4), np.nan, np.float32)  # as memory may be that nobody has written to
        carry_along(np.empty((0, 2)), np.empty((0, 4)), np.ones(2), reach, away, carried)
        blend(below, above, away, carried, reach, 0.25, found)
        np.testing.assert_allclose(found, 0.75 * below + 0.25 * above, rtol=1e-6, atol=1e-6)
