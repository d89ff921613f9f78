"""The surface that goes through samples without noise: its heights against the definition, and what comes of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from tomomesh import reconstruct_points
from tomomesh.kernels.dynamics.interpolation import LEAST_COSINE, NEAREST, SMOOTH, height_between, nearest_facing
from tomomesh.pointcloud.samples import settle_points
from tomomesh.pointcloud.search import Index

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def scattered(rng: np.random.Generator, count: int) -> Floats:
    """Throw points around the origin, one in each of so many sectors, so that it lies between them."""
    turn = 2 * np.pi * (np.arange(count) + rng.uniform(0.1, 0.9, count)) / count
    away = rng.uniform(0.5, 1.5, count)
    near = np.zeros((NEAREST, 4))
    near[:count, :3] = np.column_stack([away * np.cos(turn), away * np.sin(turn), rng.normal(0, 0.1, count)])
    return near


def by_definition(points: Floats, scale: float) -> float:
    """Solve for a plane and cubed distances at once; but for the three in front, each may be missed a little."""
    count = len(points)
    apart = np.linalg.norm(points[:, None, :2] - points[None, :, :2], axis=2) / scale
    plane = np.column_stack([np.ones(count), points[:, :2]])
    own = np.diag(np.where(np.arange(count) < 3, 0.0, SMOOTH))
    system = np.block([[apart**3 + own, plane], [plane.T, np.zeros((3, 3))]])
    found = np.linalg.solve(system, np.concatenate([points[:, 2], np.zeros(3)]))
    away = np.linalg.norm(points[:, :2], axis=1) / scale
    return float(found[:count] @ away**3 + found[count])


class TestHeight:
    @law(60)
    @given(seeds, st.integers(6, NEAREST))
    def test_is_of_a_plane_and_cubed_distances(self, seed: int, count: int) -> None:
        near = scattered(np.random.default_rng(seed), count)
        height = height_between(near, count)
        scale = float(np.linalg.norm(near[1, :2] - near[0, :2]))
        assert height == pytest.approx(by_definition(near[:count, :3], scale), abs=1e-8)

    @law(60)
    @given(seeds, st.integers(6, NEAREST))
    def test_is_that_of_a_plane_where_the_points_lie_on_one(self, seed: int, count: int) -> None:
        rng = np.random.default_rng(seed)
        near, (over, along, across) = scattered(rng, count), rng.normal(size=3)
        near[:count, 2] = over + along * near[:count, 0] + across * near[:count, 1]
        assert height_between(near, count) == pytest.approx(over, abs=1e-9)

    def test_is_none_beside_all_points_nor_on_a_line(self) -> None:
        near = scattered(np.random.default_rng(0), 8)
        near[:8, 0] += 5
        assert np.isnan(height_between(near, 8))
        near[:8, 1] = 0
        assert np.isnan(height_between(near, 8))


@law(60)
@given(seeds, st.floats(0.5, 2.0))
def test_the_nearest_samples_that_face_alike_are_listed(seed: int, reach: float) -> None:
    rng = np.random.default_rng(seed)
    normals = rng.normal([0, 0, 1], 0.8, (40, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    samples = np.column_stack([rng.uniform(-1, 1, (40, 3)), normals, np.ones(40)])
    index, near = Index.of(samples[:, :3], 0.7), np.empty((NEAREST, 4))
    up, place = np.array([0, 0, 1.0]), rng.uniform(-0.3, 0.3, 3)
    count = nearest_facing(samples[index.order], *index.cells, place, up, reach, np.empty(64, np.int64), near)
    steps = samples[:, :3] - place
    squared = (steps**2).sum(axis=1)
    facing = np.flatnonzero((normals[:, 2] >= LEAST_COSINE) & (squared <= reach**2))
    expected = facing[np.argsort(squared[facing])][:NEAREST]
    np.testing.assert_allclose(near[:count, 3], squared[expected], rtol=0, atol=1e-12)
    np.testing.assert_allclose(near[:count, 2], steps[expected, 2], rtol=0, atol=1e-12)
    flat = (steps[expected, :2] ** 2).sum(axis=1)
    np.testing.assert_allclose((near[:count, :2] ** 2).sum(axis=1), flat, rtol=0, atol=1e-12)


def on_cylinder(count: int, noise: float) -> Floats:
    """Throw points onto a cylinder of radius and half height 1 with its two ends."""
    rng = np.random.default_rng(3)
    turn, side = rng.uniform(0, 2 * np.pi, count), rng.random(count) < 2 / 3
    away = np.where(side, 1.0, np.sqrt(rng.random(count)))
    up = np.where(side, rng.uniform(-1, 1, count), np.where(rng.random(count) < 0.5, -1.0, 1.0))
    return np.column_stack([away * np.cos(turn), away * np.sin(turn), up]) + rng.normal(0, noise, (count, 3))


class TestExact:
    def test_points_without_noise_are_gone_through_and_no_others(self) -> None:
        clean = settle_points(on_cylinder(6_000, 0.0))
        assert clean.offsets is not None
        through = clean.positions + clean.offsets
        off = np.minimum(np.abs(np.hypot(through[:, 0], through[:, 1]) - 1), np.abs(np.abs(through[:, 2]) - 1))
        assert off.max() < 1e-3 * np.median(clean.spacing)
        assert settle_points(on_cylinder(6_000, 0.003)).offsets is None

    def test_the_mesh_is_nearer_than_where_they_are_smoothed(self, monkeypatch: pytest.MonkeyPatch) -> None:
        points = on_cylinder(6_000, 0.0)
        gone_through = off_cylinder(reconstruct_points(points).mesh.vertices)
        monkeypatch.setattr("tomomesh.pointcloud.samples._exact", lambda _: 0.0)
        assert gone_through < 0.8 * off_cylinder(reconstruct_points(points).mesh.vertices)


def off_cylinder(places: Floats) -> float:
    """Return the mean distance of places from the cylinder, but for those beyond its edges."""
    side, end = np.abs(np.hypot(places[:, 0], places[:, 1]) - 1), np.abs(np.abs(places[:, 2]) - 1)
    return float(np.minimum(side, end).mean())
