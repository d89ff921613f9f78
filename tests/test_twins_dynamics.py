"""The loops of the dynamic mesh against the definitions, small enough for plain Python too."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from tomomesh.kernels.dynamics.projections import project, renew_projections
from tomomesh.kernels.dynamics.quads import split_quads
from tomomesh.kernels.dynamics.springs import advance
from tomomesh.pointcloud.search import Index

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def directions(rng: np.random.Generator, count: int, spread: float) -> Floats:
    """Throw unit vectors about the z axis."""
    normals = np.array([0, 0, 1.0]) + rng.normal(0, spread, (count, 3))
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def projected(samples: Floats, place: Floats, normal: Floats, reach: float) -> tuple[bool, Floats]:
    index = Index.of(samples[:, :3], 2.0)
    found, room, weights = np.empty(4), np.empty(1024, np.int64), np.empty(1024)
    any_there = project(samples[index.order], *index.cells, place, normal, reach, found, room, weights)
    return any_there, found


class TestProjection:
    @law(60)
    @given(seeds, st.floats(0.1, 1.0))
    def test_is_the_weighted_mean_of_heights_over_the_samples(self, seed: int, spread: float) -> None:
        """Samples within reach whose normals lie within 78 degrees have a say."""
        rng = np.random.default_rng(seed)
        samples = np.column_stack([rng.uniform(-1, 1, (25, 3)), directions(rng, 25, spread), rng.uniform(0.4, 1, 25)])
        place, normal = rng.uniform(-0.3, 0.3, 3), directions(rng, 1, 0.3)[0]
        steps, normals = place - samples[:, :3], samples[:, 3:6]
        facing, over, away = normals @ normal, (steps * normals).sum(axis=1), np.linalg.norm(steps, axis=1)
        weights = facing**2 * np.exp(-(away**2 - 0.75 * over**2) / 2 / samples[:, 6] ** 2)
        weights *= (facing >= 0.2) & (away <= 1.2)
        there, found = projected(samples, place, normal, 1.2)
        assert there == (weights.sum() > 0)
        if there:
            mean = weights @ normals / np.linalg.norm(weights @ normals)
            heights = (steps * (normals + mean) / 2).sum(axis=1)
            np.testing.assert_allclose(found, [weights @ heights / weights.sum(), *mean], rtol=0, atol=1e-9)

    @pytest.mark.parametrize(("cosine", "has_a_say"), [(0.19, False), (0.21, True), (-0.9, False)])
    def test_leaves_out_what_faces_elsewhere(self, cosine: float, has_a_say: bool) -> None:
        sample = np.array([[0, 0, 0, np.sqrt(1 - cosine**2), 0, cosine, 1.0]])
        assert projected(sample, np.array([0, 0, 0.1]), np.array([0, 0, 1.0]), 2.0)[0] == has_a_say

    @law(30)
    @given(seeds, st.floats(0.05, 0.5))
    def test_is_sought_anew_by_those_that_moved_farther_than_the_way(self, seed: int, stale: float) -> None:
        rng = np.random.default_rng(seed)
        samples = np.column_stack([rng.uniform(-1, 1, (30, 3)), directions(rng, 30, 0.1), np.ones(30)])
        index, anchors = Index.of(samples[:, :3], 2.0), rng.uniform(-0.5, 0.5, (8, 3))
        places = anchors + stale * directions(rng, 8, 1.0) * rng.uniform(0.2, 2, (8, 1))
        before = np.column_stack([np.full(8, 9.0), directions(rng, 8, 0.1)])
        before[0], now, at = 0.0, before.copy(), anchors.copy()
        now[0] = 0.0
        nearest = np.zeros(8, np.int32)
        nearest[1] = -1
        renew_projections(places, nearest, samples[index.order], *index.cells, stale, False, now, at, 0, 8)
        moved = np.linalg.norm(places - anchors, axis=1) > stale
        moved[:2] = False
        np.testing.assert_array_equal((now != before).any(axis=1), moved)
        np.testing.assert_array_equal(at, np.where(moved[:, None], places, anchors))


@law(60)
@given(seeds, st.floats(0, 1))
def test_a_step_is_euler_s(seed: int, hold: float) -> None:
    """x += h x', x' += h x'': attraction along the normal, springs within the surface, damping; steps are limited."""
    rng = np.random.default_rng(seed)
    count = 6
    places, velocities, origins, anchors = rng.normal(size=(4, count, 3))
    projections = np.column_stack([rng.normal(size=count), directions(rng, count, 1.0)])
    projections[0] = 0.0
    neighbors = np.array([[n for n in range(count) if n != v] for v in range(count)], np.int32)
    start = np.arange(0, 5 * count + 1, 5)
    h, damping, limit = rng.uniform(0.1, 0.9), rng.uniform(0.1, 1), rng.uniform(0.2, 1)
    new, sums, then = np.empty_like(places), np.empty(7), velocities.copy()
    rates = np.array([h, damping, limit, hold])
    advance(places, then, origins, projections, anchors, start, neighbors.ravel(), rates, new, sums, 0, count)

    height, normals = projections[:, :1], projections[:, 1:]
    speed = np.linalg.norm(velocities, axis=1, keepdims=True)
    slow = np.minimum(1, limit / (h * speed))
    springs = hold * origins - places + ((1 - hold) * places[neighbors].mean(axis=1) if hold < 1 else 0)
    springs -= normals * (normals * springs).sum(axis=1, keepdims=True)
    over = height + (normals * (places - anchors)).sum(axis=1, keepdims=True)
    acceleration = springs - over * normals - 2 * damping * slow * velocities
    np.testing.assert_allclose(new, places + h * slow * velocities, atol=1e-12)
    np.testing.assert_allclose(then, slow * velocities + h * acceleration, atol=1e-12)
    np.testing.assert_allclose(
        sums,
        [
            (slow * speed).max(), np.linalg.norm(acceleration, axis=1).max(), ((slow * speed) ** 2).sum() / 2,
            ((springs**2).sum() + (over**2).sum()) / 2, np.abs(over).sum(), (slow < 1).sum(), 1,
        ],
        atol=1e-12,
    )  # fmt: skip


@law(60)
@given(seeds, st.floats(0, 1))
def test_squares_are_split_by_the_diagonal_nearer_to_the_surface(seed: int, share: float) -> None:
    """And each corner rises by a share of the mean sagitta of its squares."""
    rng = np.random.default_rng(seed)
    vertices, normals = rng.normal(size=(7, 3)), directions(rng, 7, 0.5)
    quads = np.array([[0, 1, 2, 3], [1, 4, 5, 2]], np.int32)  # vertex 6 belongs to none
    faces, raised = np.empty((4, 3), np.int32), np.empty_like(vertices)
    split_quads(vertices, normals, quads, share, np.zeros((7, 2)), faces, raised)
    of_vertex: list[list[float]] = [[] for _ in vertices]
    for quad, halves in zip(quads, faces.reshape(2, 2, 3), strict=True):
        sagittas = [
            (normals[c] - normals[a]) @ (vertices[c] - vertices[a]) / 8 for a, c in (quad[[0, 2]], quad[[1, 3]])
        ]
        turn = int(abs(sagittas[1]) < abs(sagittas[0]))
        a, b, c, d = np.roll(quad, -turn)
        np.testing.assert_array_equal(halves, [[a, b, c], [a, c, d]])
        for v in quad:
            of_vertex[v].append(sum(sagittas) / 2)
    rise = np.array([[np.mean(some) if some else 0.0] for some in of_vertex])
    np.testing.assert_allclose(raised, vertices + share * rise * normals, atol=1e-12)
