"""Cubes: the partition holds every point whatever their order, and a well-composed set has no bare contacts."""

from __future__ import annotations

from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from conftest import keys_in, law, seeds, size, solids
from tomomesh.errors import EmptyError, ResourceError
from tomomesh.model.cubes import MARGIN, SIDE, cells_of, key_step, keys_of
from tomomesh.surface.composition import well_composed
from tomomesh.surface.neighbors import OFFSETS, dilate, neighbor_table
from tomomesh.surface.partition import partition, sampling_distance

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


def as_solid(keys: NDArray[np.int64], pad: int = 2) -> NDArray[np.bool_]:
    """Return the smallest grid (x, y, z) that holds cubes, padded."""
    found = cells_of(keys)
    found = found - found.min(axis=0) + pad
    solid = np.zeros(found.max(axis=0) + pad + 1, bool)
    solid[tuple(found.T)] = True
    return solid


def bare_contacts(solid: NDArray[np.bool_]) -> int:
    """Count the 2 x 2 and 2 x 2 x 2 blocks of a padded grid in which cubes, or gaps, meet only diagonally."""
    count = 0
    for a, b in combinations(range(3), 2):
        blocks = np.lib.stride_tricks.sliding_window_view(solid, (2, 2), axis=(a, b)).reshape(-1, 4)
        count += sum(pattern in ([True, False, False, True], [False, True, True, False]) for pattern in blocks.tolist())
    bits = np.lib.stride_tricks.sliding_window_view(solid, (2, 2, 2)).reshape(-1, 8)
    for block in np.unique(bits, axis=0):
        for few in (np.flatnonzero(block), np.flatnonzero(~block)):
            opposite = len(few) == 2 and few.sum() == 7
            count += bool(opposite)
    return count


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
        assert sampling_distance(np.concatenate([rng.permutation(points)] * 2)) == one
        assert one == pytest.approx(np.sqrt(4 * np.pi / 80), rel=0.35)

    def test_is_the_step_of_a_square_lattice(self) -> None:
        x, y = np.mgrid[:60, :60] * 0.5
        flat = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
        assert sampling_distance(flat) == pytest.approx(0.5, rel=0.05)

    def test_is_one_for_a_single_place(self) -> None:
        assert sampling_distance(np.ones((5, 3))) == 1.0


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


class TestComposition:
    @law(size(150, 80))
    @given(solid=solids(5))
    def test_leaves_no_bare_contact(self, solid: NDArray[np.bool_]) -> None:
        assert bare_contacts(as_solid(well_composed(keys_in(solid)))) == 0

    @law(100)
    @given(solid=solids())
    def test_only_adds(self, solid: NDArray[np.bool_]) -> None:
        keys = keys_in(solid)
        composed = well_composed(keys)
        assert np.isin(keys, composed).all()
        assert (np.diff(composed) > 0).all()
        np.testing.assert_array_equal(well_composed(composed), composed)

    @law(60)
    @given(solid=solids(), axes=st.permutations(range(3)), flips=st.tuples(*[st.booleans()] * 3))
    def test_a_mirrored_or_turned_set_gives_a_mirrored_or_turned_set(
        self, solid: NDArray[np.bool_], axes: list[int], flips: tuple[bool, bool, bool]
    ) -> None:
        def turned(grid: NDArray[np.bool_]) -> NDArray[np.bool_]:
            return np.transpose(grid[tuple(slice(None, None, -1 if flip else 1) for flip in flips)], axes)

        one = turned(as_solid(well_composed(keys_in(solid))))
        np.testing.assert_array_equal(one, as_solid(well_composed(keys_in(turned(solid)))))

    @law(60)
    @given(solid=solids(5))
    def test_leaves_alone_what_has_no_bare_contact(self, solid: NDArray[np.bool_]) -> None:
        keys = keys_in(solid)
        added = len(well_composed(keys)) - len(keys)
        assert (added == 0) == (bare_contacts(as_solid(keys)) == 0)

    @pytest.mark.parametrize("offset", [(1, 1, 0), (1, -1, 0), (0, 1, 1), (-1, 0, 1), (1, 1, 1), (-1, 1, -1)])
    def test_joins_two_cubes_that_touch(self, offset: tuple[int, int, int]) -> None:
        keys = np.sort(keys_of(np.array([(5, 5, 5), np.add((5, 5, 5), offset)])))
        assert len(well_composed(keys)) == 2 ** np.count_nonzero(offset)
