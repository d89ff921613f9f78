"""The loops over points against NumPy and against the definitions, small enough for plain Python too."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from tomomesh.kernels.pointcloud.bridges import bridge, full_sectors
from tomomesh.kernels.pointcloud.linear_algebra import smallest_axis, solve, tangents
from tomomesh.kernels.pointcloud.samples import fit_planes, settle
from tomomesh.kernels.pointcloud.sheet import DIRECTIONS, find_disks
from tomomesh.pointcloud.search import Index

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


class TestLinearAlgebra:
    @law(200)
    @given(seeds, st.floats(-6, 0), st.floats(-3, 3))
    def test_the_smallest_axis_is_numpy_s(self, seed: int, flatness: float, size: float) -> None:
        rng = np.random.default_rng(seed)
        axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        sizes = 10**size * np.array([10**flatness * 0.5, *rng.uniform(0.6, 1, 2)])
        matrix = axes * sizes @ axes.T
        matrix, found = (matrix + matrix.T) / 2, np.empty(3)
        least = np.linalg.eigh(matrix)[0][0]
        smallest_axis(matrix, found)
        assert abs(found @ axes[:, 0]) == pytest.approx(1, abs=1e-9)
        assert matrix[0, 0] == pytest.approx(least, abs=1e-13 * 10**size)

    @law(100)
    @given(seeds, st.integers(1, 8))
    def test_a_system_is_solved_as_numpy_solves_it(self, seed: int, size: int) -> None:
        rng = np.random.default_rng(seed)
        root, right = rng.normal(size=(size, size)), rng.normal(size=size)
        matrix = root @ root.T + 0.1 * np.eye(size)
        expected = np.linalg.solve(matrix, right)
        assert solve(matrix, right)
        np.testing.assert_allclose(right, expected, rtol=1e-9, atol=1e-9)

    @law(20)
    @given(seeds, st.integers(1, 6))
    def test_a_singular_one_is_not(self, seed: int, size: int) -> None:
        row = np.random.default_rng(seed).normal(size=size)
        assert not solve(np.outer(row, row) * (size > 1), np.ones(size))

    @law(200)
    @given(seeds)
    def test_tangents_and_normal_are_a_right_handed_frame(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        normal = rng.normal(size=3) * rng.choice([1, 1e-9], 3)
        normal /= np.linalg.norm(normal)
        axes = np.empty((2, 3))
        tangents(normal, axes)
        frame = np.vstack([axes, normal])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), rtol=0, atol=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1)


def weighed(rng: np.random.Generator, count: int = 30) -> Floats:
    """Throw points that stand for one to three each at a bent patch."""
    x, y = rng.uniform(-2, 2, (2, count))
    return np.column_stack([x, y, 0.1 * x * y + rng.normal(0, 0.05, count), rng.integers(1, 4, count)])


@law(30)
@given(seeds, st.floats(0.7, 1.5))
def test_planes_are_those_of_weighted_moments(seed: int, width: float) -> None:
    """The weights are bells that end at two and a half of their widths."""
    points = weighed(np.random.default_rng(seed))
    index = Index.of(points[:, :3], 2.0)
    points = np.ascontiguousarray(points[index.order])
    planes = np.zeros((len(points), 5))
    fit_planes(points, *index.cells, np.full(len(points), width), planes, 0, len(points))
    for point, plane in zip(points, planes, strict=True):
        steps = points[:, :3] - point[:3]
        away = np.linalg.norm(steps, axis=1)
        weights = points[:, 3] * np.exp(-((away / width) ** 2) / 2) * (away <= 2.5 * width)
        mean = weights @ steps / weights.sum()
        sizes, axes = np.linalg.eigh((steps - mean).T * weights @ (steps - mean) / weights.sum())
        assert abs(plane[:3] @ axes[:, 0]) == pytest.approx(1, abs=1e-7)
        assert plane[3] == pytest.approx(plane[:3] @ mean, abs=1e-9)
        assert plane[4] == pytest.approx(np.sqrt(max(sizes[0], 0)), abs=1e-9)


def settled(points: Floats, planes: Floats, width: float) -> Floats:
    """Return where points come to rest, in the order in which they are given."""
    index = Index.of(points, 2.0)
    rows, found = np.column_stack([points, np.ones(len(points))])[index.order], np.empty((len(points), 8))
    settle(
        rows, planes[index.order], *index.cells, np.full(len(rows), width), np.zeros(len(rows), bool), found,
        0, len(rows),
    )  # fmt: skip
    back = np.empty_like(found)
    back[index.order] = found
    return back


@law(20)
@given(seeds, st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
def test_the_rise_of_a_quadratic_is_half_of_its_laplacian(seed: int, along: float, across: float) -> None:
    flat = np.vstack([[0, 0], np.random.default_rng(seed).uniform(-2, 2, (60, 2))])
    heights = flat**2 @ [along, across]
    planes = np.tile([0, 0, 1.0, 0, 0.05], (61, 1))
    planes[:, 3] = -heights  # all feet lie on the plane under the first point
    found = settled(np.column_stack([flat, heights]), planes, 1.0)[0]
    assert found[7] == pytest.approx(along + across, abs=1e-4)


@law(20)
@given(seeds, st.floats(0.2, 0.6), st.floats(0.01, 0.05))
def test_another_sheet_above_has_no_say(seed: int, height: float, rough: float) -> None:
    """Where it is higher than two times the roughness and .35 of the way to it."""
    rng = np.random.default_rng(seed)
    flat = np.column_stack([rng.uniform(-2, 2, (40, 2)), rng.normal(0, rough / 4, 40)])
    above = flat[:1] + np.array([0, 0, height])
    planes = np.tile([0, 0, 1.0, 0, rough], (41, 1))
    alone, with_it = settled(flat, planes[:40], 1.0), settled(np.vstack([flat, above]), planes, 1.0)
    np.testing.assert_allclose(with_it[0], alone[0], rtol=0, atol=1e-9)


class TestBridges:
    @law(20)
    @given(st.integers(0, 60), st.floats(3.1, 4.5), st.floats(0.4, 1.2))
    def test_are_counted_whatever_the_room_and_never_written_beyond_it(
        self, room: int, wide: float, gap: float
    ) -> None:
        """From one half of a plane to the other, at even steps."""
        x, y = np.meshgrid([-3.0, -2, -1, 0, *(wide + np.arange(4.0))], np.arange(7.0))
        rows = np.column_stack([x.ravel(), y.ravel(), np.zeros((x.size, 3)), np.ones((x.size, 2))])
        index = Index.of(rows[:, :3], 2.5)
        rows, sectors = rows[index.order], np.empty(len(rows), np.int64)
        full_sectors(rows, *index.cells, 2.5, sectors, 0, len(rows))
        laid, some = np.full((5000, 3), np.nan), np.full((5000, 3), np.nan)
        total = bridge(rows, *index.cells, sectors, 5.0, gap, laid, 0, len(rows))
        assert bridge(rows, *index.cells, sectors, 5.0, gap, some[:room], 0, len(rows)) == total
        assert np.isfinite(laid[:total]).all()
        assert np.isnan(laid[total:]).all()
        assert np.isnan(some[room:]).all()
        straight = laid[:total][np.isin(np.round(laid[:total, 1], 9), range(7))]
        pieces = int(wide / gap) + 1
        steps = wide * np.arange(1, pieces) / pieces
        assert all(np.abs(straight[:, 0] - step).min() < 1e-9 for step in steps)
        assert (laid[:total, 2] == 0).all()


@law(40)
@given(seeds, st.floats(0.8, 2.0))
def test_disks_that_touch_a_sample_are_empty_where_no_center_is_nearer_to_another(seed: int, radius: float) -> None:
    places = np.random.default_rng(seed).uniform(-3, 3, (12, 2))
    rows = np.column_stack([places, np.zeros((12, 3)), np.ones((12, 2))])
    index = Index.of(rows[:, :3], 2.0)
    rows, beyond, radii = rows[index.order], np.empty(12, np.int64), np.empty(12)
    find_disks(rows, *index.cells, radius, beyond, radii, 0, 12)
    np.testing.assert_allclose(radii, radius)
    axes, turn = np.empty((2, 3)), 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    tangents(np.array([0, 0, 1.0]), axes)
    for p, row in enumerate(rows[:, :3]):
        centers = row + radius * (np.outer(np.cos(turn), axes[0]) + np.outer(np.sin(turn), axes[1]))
        others = np.delete(rows[:, :3], p, axis=0)
        empty = (np.linalg.norm(centers[:, None] - others, axis=2) >= radius).all(axis=1)
        np.testing.assert_array_equal([beyond[p] >> way & 1 for way in range(DIRECTIONS)], empty)
