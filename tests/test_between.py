"""Rings drawn onto pixels, what lies between the slices, and the surface of both: twins, laws and whole runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import law, seeds
from test_several_contours import blots, trained
from tomomesh import Volume, reconstruct
from tomomesh.isosurface.crossings import Levels
from tomomesh.kernels.contours.between import blend, carry_along, match_rings
from tomomesh.kernels.contours.rings import draw_rings
from tomomesh.measure.polygon import distance, inside
from tomomesh.segmentation.contours.between import filled_between
from tomomesh.segmentation.contours.inputs import OFF
from tomomesh.segmentation.contours.insides import RingFrame, insides_of
from tomomesh.segmentation.contours.train import train_contours
from tomomesh.settings import NetworkSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.results import Surface

    Floats = NDArray[np.float64]
    Mask = NDArray[np.bool_]


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


def study(mask: Mask, spacing: tuple[float, float, float] = (1.0, 1.0, 4.0)) -> Volume:
    return Volume.from_stored(mask.astype(np.uint8), np.diag([*spacing, 1.0]))


def loops(mask: Mask, spacing: tuple[float, float, float] = (1.0, 1.0, 4.0), **asked: Any) -> Surface:
    found = reconstruct(study(mask, spacing), select=(1,), contours="loops", **asked)
    assert found.report["quality"]["self_intersections"] == 0
    return found


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


class TestLoops:
    """Rings at their place below a pixel, and how many neurons they have."""

    @law(15)
    @given(blots())
    def test_pixels_are_inside_where_the_window_is(self, plane: Mask) -> None:
        if not plane.any():
            return
        mask, found = plane[None], trained([plane], "loops")
        insides = insides_of(found, mask, RingFrame.of(found, (1.0, 1.0)))
        rows, columns = insides.depths.shape[1:]
        framed = np.pad(mask, ((0, 0), (8, 8), (8, 8)))
        x, y = insides.low[:2] + 8
        wrong = (insides.depths > 0) != framed[:, y : y + rows, x : x + columns]
        assert wrong.sum() <= 2 + 0.003 * plane.sum()

    @pytest.mark.parametrize("radius", [4.3, 11.0, 30.2])
    def test_gray_levels_tell_the_place_between_pixels(self, radius: float) -> None:
        away = np.hypot(*(np.indices((80, 80)) - 39.6))
        gray = np.clip(20 * (radius - away) + 50, 0, 100)[None].astype(np.float32)
        found = train_contours(gray > 50, NetworkSettings(contours="loops"), levels=Levels(gray, 50.0, np.inf))
        (ring,) = found.contours
        off = np.hypot(*(ring.codebook - 39.6).T) - radius
        assert np.abs(off).max() < 0.1
        assert abs(off.mean()) < 0.03

    def test_neurons_follow_length_and_curvature(self) -> None:
        away = np.hypot(*(np.indices((200, 200)) - 99.4))
        counts = []
        for radius in (20.0, 80.0):
            gray = (radius - away)[None].astype(np.float32)
            found = train_contours(gray > 0, NetworkSettings(contours="loops"), levels=Levels(gray, 0.0, np.inf))
            counts.append(len(found.contours[0]))
        # a circle turns by 2 pi: 2 pi sqrt(r / (8 OFF)) neurons
        wanted = [2 * np.pi * np.sqrt(radius / (8 * OFF)) for radius in (20.0, 80.0)]
        np.testing.assert_allclose(counts, wanted, rtol=0.15)

    @pytest.mark.parametrize(("count", "side", "each"), [(3, 10, 20), (16, 10, 16), (25, 2, 8)])
    def test_a_slice_has_no_more_than_4096_by_default(self, count: int, side: int, each: int) -> None:
        """Squares of ten pixels want 20 neurons each, and 256 of them share; the least stays."""
        rows, columns = np.indices([count * (side + 2)] * 2)
        found = trained([(rows % (side + 2) < side) & (columns % (side + 2) < side)], "loops")
        assert {len(one) for one in found.contours} == {each}
        assert len(found) == count**2


class TestBetween:
    """What lies between two slices."""

    @law(8)
    @given(seeds)
    def test_slices_keep_their_pixels_and_nothing_floats_between(self, seed: int) -> None:
        noise = np.random.default_rng(seed).normal(size=(5, 36, 40))
        mask = ndimage.gaussian_filter(noise, (0.7, 2.0, 2.0)) > 0.05
        if (mask.any(axis=(1, 2))).sum() < 2:
            return
        found = train_contours(mask, NetworkSettings(contours="loops"))
        filled = filled_between(found, mask, study(mask)).voxels > 0
        insides = insides_of(found, mask, RingFrame.of(found, (1.0, 1.0)))
        own = filled[3:-3:4] if len(filled) > 7 else filled[3:4]
        np.testing.assert_array_equal(own, insides.depths > 0)
        pieces, count = ndimage.label(filled, np.ones((3, 3, 3)))
        assert set(np.unique(pieces[3:-3:4])) | {0} == set(range(count + 1))

    def test_threads_change_no_byte(self) -> None:
        mask = ndimage.gaussian_filter(np.random.default_rng(5).normal(size=(6, 40, 44)), (1, 3, 3)) > 0
        one, two = (loops(mask, threads=threads).mesh for threads in (1, 2))
        assert one.vertices.tobytes() == two.vertices.tobytes()
        assert one.faces.tobytes() == two.faces.tobytes()

    def test_a_sheet_that_slants_by_more_than_its_thickness_is_one(self) -> None:
        k, y, x = np.indices((10, 90, 90))
        away = np.hypot(y - 44.5, x - 44.5) - (8 + 3.5 * k)
        sheet = (away >= 0) & (away < 2)
        found = loops(sheet)
        quality = found.report["quality"]
        assert (quality["components"], quality["genus"]) == (1, 1)
        mean = 2 * np.pi * (9 + 3.5 * k[:, 0, 0]).mean()
        assert quality["volume_mm3"] == pytest.approx(10 * 4 * 2 * mean, rel=0.05)
        _, torn = ndimage.label(sheet, np.ones((3, 3, 3)))
        assert torn == 10

    def test_two_legs_join_as_a_y_without_crossings(self) -> None:
        k, y, x = np.indices((12, 60, 90))
        aside = np.maximum(24 - 3 * k, 0)
        legs = np.minimum(np.hypot(y - 29.5, x - 44.5 - aside), np.hypot(y - 29.5, x - 44.5 + aside)) < 9
        quality = loops(legs).report["quality"]
        assert (quality["components"], quality["genus"]) == (1, 0)
        assert quality["volume_mm3"] == pytest.approx(4 * legs.sum(), rel=0.02)

    @pytest.mark.parametrize("shift", [0.0, 0.25, 0.5, 0.75])
    def test_the_ends_of_a_ball_are_neither_cut_nor_swollen(self, shift: float) -> None:
        k, y, x = np.indices((16, 60, 60))
        away = np.sqrt((4 * (k - 7 - shift)) ** 2 + (y - 29.4) ** 2 + (x - 29.7) ** 2)
        found = loops(away < 22)
        assert found.report["quality"]["volume_mm3"] == pytest.approx(4 * (away < 22).sum(), rel=0.02)
        off = np.sqrt(((found.mesh.vertices - [29.7, 29.4, 4 * (7 + shift)]) ** 2).sum(axis=1)) - 22
        assert np.abs(off).mean() < 0.45

    def test_a_plate_one_slice_thick_is_as_thick_as_a_slice(self) -> None:
        mask = np.zeros((5, 50, 50), bool)
        mask[2, 10:40, 10:40] = True
        mask[4, 20:30, 20:30] = True
        quality = loops(mask).report["quality"]
        assert quality["components"] == 2
        assert quality["volume_mm3"] == pytest.approx(4 * mask.sum(), rel=0.06)

    @pytest.mark.parametrize("share", [0.6, 0.75, 1.0])
    def test_the_gray_level_of_a_step_tells_how_high_it_is(self, share: float) -> None:
        away = np.hypot(*(np.indices((60, 60)) - 29.3))
        wide, narrow = (np.clip(radius - away, 0, 1) for radius in (22.5, 7.5))
        gray = np.stack([wide, wide, np.maximum(share * wide, narrow), narrow, narrow]).astype(np.float32)
        found = reconstruct(Volume.from_stored(gray, np.diag([1.0, 1.0, 4.0, 1.0])), lower=0.5, contours="loops")
        far = np.hypot(*(found.mesh.vertices[:, :2] - 29.3).T)
        step = found.mesh.vertices[(far > 13) & (far < 17) & (found.mesh.vertices[:, 2] > 4), 2]
        # linear between the levels of the two slices
        assert step.mean() == pytest.approx(4 * (2 + (share - 0.5) / share), abs=0.3)

    def test_a_prism_encloses_its_areas_times_the_slices(self) -> None:
        away = np.hypot(*(np.indices((60, 60)) - 29.3))
        found = loops(np.stack([away < 20] * 6))
        rings = found.report["quality"]["rings_volume_mm3"]
        assert rings == pytest.approx(6 * 4 * np.pi * 400, rel=0.01)
        assert found.report["quality"]["volume_mm3"] == pytest.approx(rings, rel=0.02)
