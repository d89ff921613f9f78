"""Laws of what the points hand to the vertices."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from tomomesh.model.points import PointSet
from tomomesh.pointcloud.attributes import carry

if TYPE_CHECKING:
    from numpy.typing import NDArray


def cloud(count: int, seed: int, repeats: int = 1) -> PointSet:
    """Draw points on a coarse lattice, so that distances tie, with an attribute of every kind."""
    rng = np.random.default_rng(seed)
    positions = rng.integers(-2, 3, (count, 3)).astype(float)
    points = PointSet.from_positions(np.tile(positions, (repeats, 1)))
    n = count * repeats
    attributes: dict[str, Any] = {
        "red": rng.integers(0, 256, n).astype(np.uint8),
        "green": rng.integers(0, 256, n).astype(np.uint8),
        "blue": np.full(n, 200, np.uint8),
        "label": rng.choice([1, 5, 900], n).astype(np.int16),
        "valid": rng.random(n) < 0.5,
        "intensity": rng.normal(size=n).astype(np.float32),
        "flow": rng.normal(size=(n, 2)),
    }
    return replace(points, attributes=attributes)


def reordered(points: PointSet, order: NDArray[np.int64]) -> PointSet:
    attributes = {name: values[order] for name, values in points.attributes.items()}
    return replace(PointSet.from_positions(points.positions[order]), attributes=attributes)


def vertices_about(seed: int) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.normal(size=(20, 3)), rng.integers(-2, 3, (10, 3))])


class TestLaws:
    @law(60)
    @given(st.integers(1, 40), st.integers(1, 3), seeds)
    def test_the_order_of_the_points_changes_nothing(self, count: int, repeats: int, seed: int) -> None:
        points, vertices = cloud(count, seed, repeats), vertices_about(seed)
        order = np.random.default_rng(seed + 1).permutation(len(points))
        one, other = carry(points, vertices), carry(reordered(points, order), vertices)
        assert list(one) == list(other) == list(points.attributes)
        for name in one:
            assert one[name].tobytes() == other[name].tobytes()

    @law(60)
    @given(st.integers(1, 40), seeds)
    def test_types_shapes_and_ranges_stay(self, count: int, seed: int) -> None:
        points, vertices = cloud(count, seed), vertices_about(seed)
        for name, values in carry(points, vertices).items():
            given_ = points.attributes[name]
            assert values.dtype == given_.dtype
            assert values.shape == (len(vertices), *given_.shape[1:])
            assert (values >= given_.min(axis=0)).all()
            assert (values <= given_.max(axis=0)).all()
            if name in ("label", "valid"):
                assert np.isin(values, given_).all()

    @law(40)
    @given(st.integers(1, 30), seeds)
    def test_a_vertex_on_a_point_has_its_value(self, count: int, seed: int) -> None:
        points = cloud(count, seed)
        _, first = np.unique(points.positions, axis=0, return_index=True)
        points = reordered(points, first)
        for name, values in carry(points, points.positions).items():
            np.testing.assert_array_equal(values, points.attributes[name])

    @law(40)
    @given(st.integers(1, 30), st.integers(2, 4), seeds)
    def test_repeats_of_the_same_change_nothing(self, count: int, repeats: int, seed: int) -> None:
        points, vertices = cloud(count, seed), vertices_about(seed)
        _, first = np.unique(points.positions, axis=0, return_index=True)
        once = reordered(points, first)
        often = reordered(once, np.tile(np.arange(len(once)), repeats))
        one, other = carry(once, vertices), carry(often, vertices)
        assert all(one[name].tobytes() == other[name].tobytes() for name in one)


class TestDefinition:
    @pytest.mark.parametrize("count", [1, 2, 3, 50])
    def test_equals_a_loop_over_all_points(self, count: int) -> None:
        rng = np.random.default_rng(count)
        points = replace(
            PointSet.from_positions(rng.normal(size=(count, 3))),
            attributes={
                "t": rng.normal(size=count),
                "red": rng.integers(0, 256, count, np.uint8),
                "id": np.arange(count),
            },
        )
        vertices = rng.normal(size=(30, 3))
        found = carry(points, vertices)
        for number, vertex in enumerate(vertices):
            distance = np.linalg.norm(points.positions - vertex, axis=1)
            near = np.argsort(distance)[:3]
            mean = {
                name: np.average(points.attributes[name][near], weights=1 / distance[near]) for name in ("t", "red")
            }
            assert found["t"][number] == pytest.approx(mean["t"], rel=1e-12)
            assert found["red"][number] == round(mean["red"])
            assert found["id"][number] == near[0]

    def test_of_repeats_floats_have_the_mean_and_labels_the_majority(self) -> None:
        points = replace(
            PointSet.from_positions(np.zeros((5, 3))),
            attributes={"t": np.array([1.0, 2, 3, 4, 10]), "label": np.array([9, 2, 9, 9, 1])},
        )
        found = carry(points, np.ones((2, 3)))
        np.testing.assert_array_equal(found["t"], [4, 4])
        np.testing.assert_array_equal(found["label"], [9, 9])

    def test_what_is_not_finite_counts_for_nothing(self) -> None:
        positions = np.array([[0.0, 0, 0], [2, 0, 0], [9, 0, 0]])
        points = replace(
            PointSet.from_positions(positions),
            attributes={"t": np.array([np.nan, 5.0, np.inf]), "u": np.full(3, np.nan, np.float32)},
        )
        found = carry(points, np.array([[1.0, 0, 0], [0, 0, 0]]))
        np.testing.assert_array_equal(found["t"], [5, np.nan])
        assert np.isnan(found["u"]).all()

    def test_without_attributes_there_is_nothing_to_carry(self) -> None:
        assert carry(PointSet.from_positions(np.zeros((1, 3))), np.zeros((2, 3))) == {}
