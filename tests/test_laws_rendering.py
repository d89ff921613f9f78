"""The depth buffer against a ray a sample, and lines and dots against what they cover."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds, size
from tomomesh.kernels.rendering.strokes import draw_dots, draw_segments
from tomomesh.kernels.rendering.triangles import NEAREST, STEPS, keep_nearest, mean_of_samples
from tomomesh.show.drawing.surface import draw_polygons

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Ints = NDArray[np.int64]
    Bytes = NDArray[np.uint8]

ROWS, COLUMNS = 9, 11
INK = np.zeros(3, np.uint8)


def soup(seed: int, count: int, sides: int = 3) -> tuple[Ints, Ints, Bytes]:
    """Return polygons anywhere on a small grid and around it, many of their corners and sides on its samples."""
    rng = np.random.default_rng(seed)
    if sides == 3:
        corners = rng.integers(-2, 14, (3 * count, 3)) * (STEPS // 2)
    else:  # parallelograms
        first, a, b = rng.integers(-2, 8, (3, count, 3)) * STEPS
        corners = np.stack([first, first + a, first + a + b, first + b], axis=1).reshape(-1, 3)
    corners[:, 2] = rng.integers(0, 1000, len(corners)) if sides == 3 else corners[:, 2] + 400
    colors = rng.integers(0, 256, (2, count, 3)).astype(np.uint8)
    return corners, np.arange(sides * count).reshape(count, sides), colors


def drawn(
    corners: Ints, polygons: Ints, colors: Bytes, *, smooth: bool = False, line: float = 0.0, band: int = ROWS
) -> Ints:
    """Return what each sample keeps, drawn in bands."""
    bands = []
    for start in range(0, ROWS, band):
        bands.append(np.zeros((min(band, ROWS - start), COLUMNS), np.int64))
        keep_nearest(corners, polygons, colors, smooth, line, INK, start, bands[-1])
    return np.concatenate(bands)


def by_rays(corners: Ints, triangles: Ints, colors: Bytes) -> tuple[Ints, list[list[set[int]]]]:
    """Return the largest depth of a triangle at each sample, -1 for none, and the colors that lie there.

    Exact: in fractions, and with sides that belong to the triangle on both sides of them.
    """
    depths = np.full((ROWS, COLUMNS), -1, np.int64)
    seen: list[list[set[int]]] = [[set() for _ in range(COLUMNS)] for _ in range(ROWS)]
    for number, triangle in enumerate(triangles):
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners[triangle].tolist()
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if area == 0:
            continue
        red, green, blue = colors[0 if area < 0 else 1, number].tolist()
        for j in range(ROWS):
            for i in range(COLUMNS):
                x, y = STEPS * i + STEPS // 2, STEPS * j + STEPS // 2
                second = Fraction((x - ax) * (cy - ay) - (cx - ax) * (y - ay), area)
                third = Fraction((bx - ax) * (y - ay) - (x - ax) * (by - ay), area)
                if min(second, third, 1 - second - third) < 0:
                    continue
                on_side = min(second, third, 1 - second - third) == 0
                depth = int(az + second * (bz - az) + third * (cz - az))
                if on_side:
                    seen[j][i].add(-1)  # a sample on a side may belong to the other triangle there, or to none
                elif depth >= depths[j, i]:
                    kept = seen[j][i] if depth == depths[j, i] else seen[j][i] & {-1}
                    seen[j][i] = kept | {red << 16 | green << 8 | blue}
                    depths[j, i] = depth
    return depths, seen


class TestDepthBuffer:
    @law(60)
    @given(seeds, st.integers(1, 8))
    def test_a_sample_keeps_what_a_ray_meets_first(self, seed: int, count: int) -> None:
        corners, triangles, colors = soup(seed, count)
        found = drawn(corners, triangles, colors)
        depths, seen = by_rays(corners, triangles, colors)
        for j in range(ROWS):
            for i in range(COLUMNS):
                depth, color = (found[j, i] >> 32) - 1, found[j, i] & 0xFFFFFF
                if -1 in seen[j][i]:
                    assert depth >= depths[j, i] - 1
                else:
                    assert abs(depth - depths[j, i]) <= (depths[j, i] >= 0)  # a depth may be rounded down
                    assert depth < 0 or depth != depths[j, i] or color in seen[j][i]

    @law(60)
    @given(seeds, st.integers(1, 40), st.booleans(), st.sampled_from([3, 4]), st.sampled_from([0.0, 3.0, 20.0]))
    def test_order_and_bands_change_nothing(self, seed: int, count: int, smooth: bool, sides: int, line: float) -> None:
        corners, polygons, colors = soup(seed, count, sides)
        shades = np.random.default_rng(seed).integers(0, 256, (2, len(corners), 3)).astype(np.uint8)
        order = np.random.default_rng(seed).permutation(count)
        one = drawn(corners, polygons, shades if smooth else colors, smooth=smooth, line=line)
        other = np.ascontiguousarray(shades if smooth else colors[:, order])
        mixed = drawn(corners, np.ascontiguousarray(polygons[order]), other, smooth=smooth, line=line, band=2)
        np.testing.assert_array_equal(one, mixed)

    @law(60)
    @given(seeds)
    def test_triangles_of_a_plane_cover_it_once(self, seed: int) -> None:
        """Of a grid whose inner corners lie anywhere each sample is in one triangle, whichever way these are turned."""
        rng = np.random.default_rng(seed)
        across, down = np.meshgrid(np.arange(0, COLUMNS + 2, 2), np.arange(0, ROWS + 2, 2))
        corners = np.stack([across, down, 0 * across], axis=-1) * STEPS
        corners[1:-1, 1:-1, :2] += rng.integers(-5, 6, corners[1:-1, 1:-1, :2].shape)
        number = np.arange(across.size).reshape(across.shape)
        a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
        halves = [np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]
        triangles = np.concatenate([half.reshape(-1, 3) for half in halves])
        turned = rng.random(len(triangles)) < 0.5
        triangles[turned] = triangles[turned][:, ::-1]
        covered = np.zeros((ROWS, COLUMNS), np.int64)
        for one in triangles:
            covered += drawn(corners.reshape(-1, 3), one[None].copy(), np.zeros((2, 1, 3), np.uint8)) > 0
        np.testing.assert_array_equal(covered, 1)

    @law(30)
    @given(seeds)
    def test_blended_colors_and_depths_lie_between_the_corners(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        corners, triangles, _ = soup(seed, 1)
        corners[:, 2] = rng.choice([0, 1, NEAREST - 1, NEAREST], len(corners))
        shades = rng.integers(0, 256, (2, len(corners), 3)).astype(np.uint8)
        found = drawn(corners, triangles, shades, smooth=True)
        kept = found[found > 0]
        (ax, ay), (bx, by) = corners[1:, :2] - corners[0, :2]
        side = int(ax * by > bx * ay)
        assert ((kept >> 32) - 1 >= corners[:, 2].min() - 1).all()
        assert ((kept >> 32) - 1 <= corners[:, 2].max()).all()
        for channel, shift in enumerate((16, 8, 0)):
            levels = (kept >> shift) & 255
            assert (levels >= shades[side, :, channel].min()).all()
            assert (levels <= shades[side, :, channel].max()).all()

    def test_the_line_inside_a_square_is_not_drawn(self) -> None:
        """Sides are, to half of their width; what cuts a square into triangles is not."""
        corners = np.array([[0, 0, 0], [0, 8, 0], [8, 8, 0], [8, 0, 0]]) * STEPS
        white = np.full((2, 1, 3), 255, np.uint8)
        found = drawn(corners, np.array([[0, 1, 2, 3]]), white, line=float(STEPS))[:8, :8] & 255
        np.testing.assert_array_equal(found[1:-1, 1:-1], 255)
        rim = np.concatenate([found[0], found[-1], found[:, 0], found[:, -1]])
        np.testing.assert_array_equal(rim, 0)

    @pytest.mark.parametrize("each", [1, 2, 3, 4])
    def test_a_pixel_is_the_mean_of_its_samples_over_what_was_there(self, each: int) -> None:
        rng = np.random.default_rng(each)
        colors, seen = rng.integers(0, 256, (5 * each, 4 * each, 3)), rng.random((5 * each, 4 * each)) < 0.6
        keys = ((1 << 32) | colors[..., 0] << 16 | colors[..., 1] << 8 | colors[..., 2]) * seen
        paper = rng.integers(0, 256, (5, 4, 3)).astype(np.uint8)
        samples = np.where(seen[..., None], colors, paper.repeat(each, 0).repeat(each, 1))
        expected = samples.reshape(5, each, 4, each, 3).mean(axis=(1, 3))
        mean_of_samples(keys.astype(np.int64), paper)
        assert np.abs(paper - expected).max() <= 0.5

    def test_nothing_is_drawn_of_nothing(self) -> None:
        paper = np.full((4, 5, 3), 255, np.uint8)
        none = np.zeros((2, 0, 3), np.uint8)
        draw_polygons(paper, np.zeros((0, 3)), np.zeros((0, 3), np.int64), none)
        flat = np.array([[0.0, 0, 0], [4, 4, 0], [2, 2, 0]])
        draw_polygons(paper, flat, np.array([[0, 1, 2]]), np.zeros((2, 1, 3), np.uint8))
        beside = flat + np.array([[9, 0, 0], [9, 2, 0], [11, 0, 0]])
        draw_polygons(paper, beside, np.array([[0, 1, 2]]), np.zeros((2, 1, 3), np.uint8))
        assert (paper == 255).all()


class TestStrokes:
    @law(40)
    @given(seeds, st.floats(0.05, 6.0), st.floats(0.0, np.pi))
    def test_a_line_covers_its_area(self, seed: int, width: float, turn: float) -> None:
        """The ink is length times width and the round ends, wherever it lies."""
        middle, length = 30 + np.random.default_rng(seed).random(2), 30.0
        along = np.array([np.cos(turn), np.sin(turn)])
        ends = np.stack([middle - length / 2 * along, middle + length / 2 * along])[None]
        paper = np.full((60, 60, 3), 255, np.uint8)
        draw_segments(ends, np.array([width]), np.array([[0.0, 0, 0, 1]]), 0.0, 0.0, paper)
        ink = (255.0 - paper[..., 0]).sum() / 255
        assert ink == pytest.approx(length * width + np.pi * width**2 / 4, rel=0.05, abs=0.8)

    @law(40)
    @given(seeds, st.floats(0.2, 8.0), st.sampled_from([0, 1, 2]))
    def test_a_dot_covers_its_area(self, seed: int, radius: float, shape: int) -> None:
        place = 20 + np.random.default_rng(seed).random((1, 2))
        paper = np.full((40, 40, 3), 255, np.uint8)
        draw_dots(place, np.array([radius]), np.array([[0.0, 0, 0, 1]]), shape, 0.0, paper)
        area = np.pi * radius**2 if shape == 0 else 4 * radius**2
        assert (255.0 - paper[..., 0]).sum() / 255 == pytest.approx(area, rel=0.12, abs=0.6)

    def test_dashes_leave_gaps(self) -> None:
        paper = np.full((5, 40, 3), 255, np.uint8)
        ends = np.array([[[0.0, 2.5], [40.0, 2.5]]])
        draw_segments(ends, np.array([1.0]), np.array([[0.0, 0, 0, 1]]), 6.0, 4.0, paper)
        row = paper[2, :, 0]
        np.testing.assert_array_equal(np.flatnonzero(row == 0) % 10 < 6, True)
        assert np.count_nonzero(row == 0) == pytest.approx(24, abs=5)
        assert np.count_nonzero(row == 255) == pytest.approx(16, abs=5)

    @law(30)
    @given(seeds)
    def test_opacity_is_the_share_of_the_new_color(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        paper, color, share = rng.integers(0, 256, (3, 3, 3)).astype(np.uint8), rng.integers(0, 256, 3), rng.random()
        under = paper.astype(float)
        draw_dots(np.array([[1.5, 1.5]]), np.array([9.0]), np.append(color, share)[None].astype(float), 1, 0.0, paper)
        np.testing.assert_allclose(paper, under + share * (color - under), atol=0.51)

    @pytest.mark.parametrize("place", [(-1e9, 5.0), (5.0, 1e9), (-3.0, -3.0)])
    def test_what_lies_beside_the_paper_is_not_drawn(self, place: tuple[float, float]) -> None:
        paper = np.full((size(20, 6), 10, 3), 255, np.uint8)
        black = np.array([[0.0, 0, 0, 1]])
        draw_dots(np.array([place]), np.array([1.0]), black, 0, 0.0, paper)
        draw_segments(np.array([[place, place]]), np.array([1.0]), black, 0.0, 0.0, paper)
        assert (paper == 255).all()
