"""Outlines and curves of the contours of one slice, and which go on as which."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from conftest import sphere
from test_contours import ball, circle, volume
from tomomesh.contours.curves import fine_curve, moments_of
from tomomesh.contours.known import known_slices
from tomomesh.contours.parts import Part
from tomomesh.contours.rings import outline
from tomomesh.contours.stack import contour_surface
from tomomesh.contours.tracks import link_parts
from tomomesh.measure.topology import topology
from tomomesh.model.points import PointSet

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


class TestOutline:
    """The inside of one slice."""

    @pytest.mark.parametrize("count", [20, 100, 500])
    def test_contours_of_any_sampling_lie_side_by_side(self, count: int) -> None:
        points = np.concatenate([circle(0, 0, 10, 0, count), circle(30, 0, 10, 0, 20)])[:, :2]
        found = outline(points)
        assert sorted(map(len, found.rings)) == sorted([20, count])
        assert len(set(found.parts)) == 2
        assert found.open == []
        areas = [moments_of([points[ring]]).area for ring in found.rings]
        assert min(areas) > 0

    def test_what_lies_within_counts_by_turns(self) -> None:
        points = np.concatenate([circle(0, 0, radius, 0) for radius in (30, 20, 10)])[:, :2]
        found = outline(points)
        areas = {moments_of([points[ring]]).area > 0: part for ring, part in zip(found.rings, found.parts, strict=True)}
        assert len(found.rings) == 3
        assert len(set(found.parts)) == 2
        assert set(areas) == {True, False}

    @pytest.mark.parametrize("missing", [1, 2, 3])
    def test_gaps_close(self, missing: int) -> None:
        points = np.delete(circle(0, 0, 10, 0), [*range(missing), 30], axis=0)[:, :2]
        found = outline(points)
        assert [len(ring) for ring in found.rings] == [len(points)]

    def test_a_wide_gap_stays_open(self) -> None:
        found = outline(circle(0, 0, 10, 0)[:45, :2])
        assert found.rings == []
        assert [len(points) for points in found.open] == [45]

    def test_a_few_stray_points_are_no_contour(self) -> None:
        points = np.concatenate([circle(0, 0, 10, 0)[:, :2], [[30.0, 0.0], [31.0, 0.0]]])
        found = outline(points)
        assert (len(found.rings), found.open) == (1, [])

    def test_points_on_a_line_enclose_nothing(self) -> None:
        line = np.column_stack([np.arange(10.0), np.zeros(10)])
        assert outline(line).rings == []
        assert outline(line[:3]).open == []


class TestCurves:
    """Noise off, fine points in between."""

    @pytest.mark.parametrize("count", [20, 100])
    def test_a_circle_stays_a_circle(self, count: int) -> None:
        curve = fine_curve(circle(3, 4, 10, 0, count)[:, :2], 0.25)
        assert np.abs(np.hypot(*(curve - [3, 4]).T) - 10).max() < 2e-3
        moments = moments_of([curve])
        assert moments.area == pytest.approx(100 * np.pi, rel=1e-3)
        assert moments.center == pytest.approx([3, 4], abs=1e-3)
        assert moments.radius == pytest.approx(10, rel=1e-3)

    def test_noise_comes_off(self) -> None:
        clean = circle(0, 0, 25, 0)[:, :2]
        noisy = clean + np.random.default_rng(0).normal(0, 0.2, clean.shape)
        away = np.hypot(*fine_curve(noisy, 0.25).T) - 25
        assert np.sqrt((away**2).mean()) < 0.1
        assert abs(away.mean()) < 0.05


class TestKnown:
    """Points that know their slice and their place on its ring."""

    def test_rings_are_taken_as_they_are(self) -> None:
        heights = np.arange(-22.5, 24, 5)
        rings = ball(heights, count=40)
        slices = np.repeat(np.arange(len(rings)), 40).astype(np.int32)
        neurons = np.tile(np.arange(40), len(rings)).astype(np.int32)
        order = np.random.default_rng(0).permutation(len(slices))
        positions = np.concatenate(rings)[order]
        points = PointSet(positions, slices[order], neurons[order], np.zeros(len(order), np.uint8))
        known = known_slices(points)
        assert known is not None
        made = contour_surface(positions, known)
        assert (topology(made.mesh).components, topology(made.mesh).genus) == (1, 0)
        assert volume(made) == pytest.approx(4 / 3 * np.pi * 25**3, rel=0.025)

    def test_a_cloud_knows_nothing(self) -> None:
        assert known_slices(PointSet.from_positions(sphere(100))) is None


class TestLinks:
    """Which part goes on as which."""

    def parts(self, plane: int, *disks: tuple[float, float]) -> list[Part]:
        height = 6.0 * plane
        return [Part.within([fine_curve(circle(x, 0, r, 0)[:, :2], 0.25)], height, plane) for x, r in disks]

    @pytest.mark.parametrize("complete", [False, True])
    def test_parts_end_where_nothing_follows(self, complete: bool) -> None:
        parts = self.parts(0, (0, 5)) + self.parts(1, (0, 5), (40, 5))
        links = link_parts(parts, np.zeros(2, np.int64), 1.0, complete=complete)
        found = [(link.below, link.above) for link in links]
        assert found == [((), (0,)), ((), (2,)), ((0,), (1,)), ((1,), ()), ((2,), ())]

    @pytest.mark.parametrize("complete", [False, True])
    def test_a_part_may_go_on_as_two(self, complete: bool) -> None:
        parts = self.parts(0, (0, 12)) + self.parts(1, (-7, 5), (7, 5))
        links = link_parts(parts, np.zeros(2, np.int64), 1.0, complete=complete)
        assert [(link.below, link.above) for link in links if link.below and link.above] == [((0,), (1, 2))]
