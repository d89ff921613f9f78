"""Cubes: the partition holds every point whatever their order, and neighbors are those of a scan."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from conftest import keys_in, law, seeds, solids
from tomomesh.cuberille.neighbors import OFFSETS, dilate, neighbor_table
from tomomesh.cuberille.partition import is_flat, partition, sampling_distance
from tomomesh.errors import EmptyError, ResourceError
from tomomesh.model.cubes import MARGIN, SIDE, cells_of, key_step, keys_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.model.cubes import CubeGrid

cells = arrays.arrays(
    np.int64, st.tuples(st.integers(1, 30), st.just(3)), elements=st.integers(-MARGIN, SIDE - MARGIN - 1)
)


@st.composite
def clouds(draw: st.DrawFn) -> NDArray[np.float64]:
    """Draw points at any place and scale, some on the borders of cubes, some repeated."""
    rng = np.random.default_rng(draw(seeds))
    points = rng.normal(size=(draw(st.integers(1, 60)), 3)) * [3.0, 10.0, 1.0]
    if draw(st.booleans()):
        points = np.round(points)
    points = points * draw(st.sampled_from([1e-3, 1.0, 1e6])) + draw(st.sampled_from([0.0, -1e5, 1e9]))
    return np.concatenate([points, points[rng.integers(len(points), size=draw(st.integers(0, 5)))]])


def bytes_of(grid: CubeGrid, points: NDArray[np.float64]) -> tuple[bytes, ...]:
    """Return a partition without the numbers of its points: cubes, and the points of each in their order."""
    return grid.keys.tobytes(), grid.origin.tobytes(), points[grid.order].tobytes(), grid.start.tobytes()


class TestKeys:
    @law(200)
    @given(cells=cells)
    def test_round_trip(self, cells: NDArray[np.int64]) -> None:
        np.testing.assert_array_equal(cells_of(keys_of(cells)), cells)

    @law(100)
    @given(cells=cells)
    def test_order_by_z_then_y_then_x(self, cells: NDArray[np.int64]) -> None:
        np.testing.assert_array_equal(np.argsort(keys_of(cells), kind="stable"), np.lexsort(cells.T))

    @law(100)
    @given(cells=cells, offset=st.tuples(*[st.integers(-3, 3)] * 3))
    def test_steps_add(self, cells: NDArray[np.int64], offset: tuple[int, int, int]) -> None:
        inner = np.clip(cells, -MARGIN + 3, SIDE - MARGIN - 4)
        np.testing.assert_array_equal(keys_of(inner) + key_step(offset), keys_of(inner + np.array(offset)))


class TestPartition:
    @law(150)
    @given(points=clouds(), cell=st.tuples(*[st.floats(0.3, 3)] * 3))
    def test_every_point_lies_in_its_occupied_cube(
        self, points: NDArray[np.float64], cell: tuple[float, float, float]
    ) -> None:
        cell_mm = np.array(cell) * max(np.ptp(points, axis=0).max(), 1e-3) / 10
        grid = partition(points, cell_mm)
        assert grid.occupied.all()
        assert (np.diff(grid.keys) > 0).all()
        assert sorted(grid.order) == list(range(len(points)))
        owner = np.repeat(np.arange(len(grid.keys)), np.diff(grid.start))
        low = grid.origin + grid.cells[owner] * cell_mm
        off = points[grid.order] - low
        slack = 4 * np.spacing(np.abs(points).max() + cell_mm.max())
        assert (off >= -slack).all()
        assert (off <= cell_mm + slack).all()

    @law(100)
    @given(points=clouds(), seed=seeds)
    def test_depends_on_no_order(self, points: NDArray[np.float64], seed: int) -> None:
        cell_mm = np.full(3, max(np.ptp(points), 1e-3) / 7)
        shuffled = np.random.default_rng(seed).permutation(points)
        assert bytes_of(partition(points, cell_mm), points) == bytes_of(partition(shuffled, cell_mm), shuffled)

    @law(100)
    @given(points=clouds())
    def test_repeated_points_change_no_cube(self, points: NDArray[np.float64]) -> None:
        cell_mm = np.full(3, max(np.ptp(points), 1e-3) / 7)
        once, twice = partition(points, cell_mm), partition(np.concatenate([points, points]), cell_mm)
        assert once.keys.tobytes() == twice.keys.tobytes()
        assert once.origin.tobytes() == twice.origin.tobytes()
        np.testing.assert_array_equal(twice.start, 2 * once.start)

    @law(50)
    @given(points=clouds(), steps=st.integers(0, 2))
    def test_added_cubes_are_empty(self, points: NDArray[np.float64], steps: int) -> None:
        grid = partition(points, np.full(3, max(np.ptp(points), 1e-3) / 7))
        more = grid.with_cubes(dilate(grid.keys, steps))
        np.testing.assert_array_equal(more.keys[more.occupied], grid.keys)
        np.testing.assert_array_equal(np.diff(more.start)[more.occupied], np.diff(grid.start))

    def test_refuses_no_points(self) -> None:
        with pytest.raises(EmptyError):
            partition(np.empty((0, 3)), np.ones(3))

    def test_names_the_smallest_edge_that_can_be_numbered(self) -> None:
        points = np.array([[0.0, 0, 0], [1.0, 0, 0]])
        with pytest.raises(ResourceError) as refused:
            partition(points, np.full(3, 1e-9))
        smallest = float(str(refused.value).split("at least ")[1].split(". ")[0])
        assert len(partition(points, np.full(3, smallest * 1.001)).keys) == 2


class TestSamplingDistance:
    @law(30)
    @given(seed=seeds, scale=st.sampled_from([1e-3, 1.0, 1e4]))
    def test_scales_and_knows_no_order(self, seed: int, scale: float) -> None:
        rng = np.random.default_rng(seed)
        points = rng.normal(size=(80, 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        one = sampling_distance(points)
        assert sampling_distance(points * scale) == pytest.approx(one * scale)
        assert sampling_distance(rng.permutation(points)) == one
        assert one == pytest.approx(np.sqrt(4 * np.pi / 80), rel=0.35)

    def test_is_the_step_of_a_square_lattice(self) -> None:
        x, y = np.mgrid[:60, :60] * 0.5
        flat = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
        assert sampling_distance(flat) == pytest.approx(0.5, rel=0.05)

    def test_is_one_for_a_single_place(self) -> None:
        assert sampling_distance(np.ones((1, 3))) == 1.0


class TestFlat:
    @law(40)
    @given(seed=seeds, directions=st.integers(0, 3), place=st.sampled_from([0.0, -40.0]))
    def test_are_points_in_a_plane_on_a_line_or_at_a_place(self, seed: int, directions: int, place: float) -> None:
        rng = np.random.default_rng(seed)
        points = rng.normal(size=(50, directions)) @ rng.normal(size=(directions, 3)) + place
        assert is_flat(points, 1.0) == (directions < 3)

    @pytest.mark.parametrize(("thick", "flat"), [(1e-8, True), (1e-3, False)])
    def test_may_be_a_millionth_thick(self, thick: float, flat: bool) -> None:
        points = np.random.default_rng(0).random((500, 3)) * [1, 1, thick]
        assert is_flat(points, 1.0) == flat


class TestNeighbors:
    @law(60)
    @given(solid=solids())
    def test_are_those_of_a_scan(self, solid: NDArray[np.bool_]) -> None:
        keys = keys_in(solid)
        number = {key: n for n, key in enumerate(keys.tolist())}
        wanted = [[number.get(key + key_step(offset), -1) for offset in OFFSETS] for key in keys.tolist()]
        np.testing.assert_array_equal(neighbor_table(keys), wanted)

    @law(60)
    @given(solid=solids(), steps=st.integers(0, 3))
    def test_dilation_is_that_of_a_scan(self, solid: NDArray[np.bool_], steps: int) -> None:
        reach = range(-steps, steps + 1)
        moved = [np.argwhere(solid) + offset for offset in product(reach, repeat=3)]
        wanted = np.unique(keys_of(np.concatenate(moved)))
        np.testing.assert_array_equal(dilate(keys_in(solid), steps), wanted)
