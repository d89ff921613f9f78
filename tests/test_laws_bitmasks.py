"""Sets of cubes as bits: grown, flooded and listed as plain sets of cells are, wherever the blocks end."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import law, seeds, size
from tomomesh.cuberille import bitmasks as module
from tomomesh.cuberille.bitmasks import EDGE, Blocks
from tomomesh.cuberille.neighbors import OFFSETS
from tomomesh.errors import ResourceError
from tomomesh.kernels.cuberille.bitmasks import neighbor, popcount, touches
from tomomesh.model.cubes import MARGIN, SIDE, keys_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.cuberille.bitmasks import Bitmask

    Cells = NDArray[np.int64]

WIDE = size(30, 12)


@st.composite
def scattered(draw: st.DrawFn) -> Cells:
    """Draw cells near the borders of blocks, negative ones too, some in a second heap near or far away."""
    rng = np.random.default_rng(draw(seeds))
    heap = rng.integers(-6, draw(st.sampled_from([2, WIDE])), (draw(st.integers(1, 60)), 3))
    apart = draw(st.sampled_from([0, 17, 40, 10_000]))
    other = rng.integers(-3, 5, (draw(st.integers(0, 20)), 3)) + np.array([apart, -apart // 100, apart])
    return np.concatenate([heap, other])


def as_set(cells: Cells) -> set[tuple[int, ...]]:
    return {tuple(cell) for cell in cells.tolist()}


def assert_same(one: Cells, other: Cells) -> None:
    """Compare two lists of cells, in any order."""
    np.testing.assert_array_equal(np.sort(keys_of(one)), np.sort(keys_of(other)))


def everywhere(blocks: Blocks) -> Cells:
    """Return the cells of all blocks."""
    return blocks.cells(~blocks.empty())


def stepped(blocks: Blocks, bitmask: Bitmask, offset: tuple[int, int, int]) -> Bitmask:
    """Return the set of cubes whose neighbor in a direction is in a set."""
    found = blocks.empty()
    for block, z in product(range(len(blocks)), range(8)):
        found[block, z] = neighbor(bitmask, blocks.table, block, z, *offset)
    return found


class TestBitmask:
    @law(100)
    @given(cells=scattered())
    def test_lists_the_cells_that_it_was_made_of(self, cells: Cells) -> None:
        blocks = Blocks.around(cells, 0)
        bitmask = blocks.bitmask_of(cells)
        assert as_set(blocks.cells(bitmask)) == as_set(cells)
        assert blocks.count(bitmask).sum() == len(as_set(cells))

    @law(40)
    @given(cells=scattered(), seed=seeds)
    def test_knows_no_order_and_no_repetition(self, cells: Cells, seed: int) -> None:
        again = np.random.default_rng(seed).permutation(np.concatenate([cells, cells[: len(cells) // 2]]))
        one, other = (Blocks.around(some, 3) for some in (cells, again))
        assert one.keys.tobytes() == other.keys.tobytes()
        assert one.table.tobytes() == other.table.tobytes()
        assert one.bitmask_of(cells).tobytes() == other.bitmask_of(again).tobytes()

    @law(100)
    @given(word=st.integers(0, 2**64 - 1))
    def test_counts_bits(self, word: int) -> None:
        assert popcount(np.uint64(word)) == word.bit_count()

    @pytest.mark.parametrize("corner", [-MARGIN, SIDE - 2 * MARGIN])
    def test_reaches_the_ends_of_the_range_of_keys(self, corner: int) -> None:
        cells = corner + np.array([[0, 0, 0], [7, 3, 9]])
        blocks = Blocks.around(cells, 64)
        assert as_set(blocks.cells(blocks.grown(blocks.bitmask_of(cells)))) >= as_set(cells - 1)

    def test_is_not_begun_where_it_would_not_fit(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(module, "MOST", 100)
        with pytest.raises(ResourceError, match="at most 100"):
            Blocks.around(np.zeros((1, 3), np.int64), 24)


class TestNeighbors:
    @law(25)
    @given(cells=scattered(), offset=st.sampled_from(OFFSETS))
    def test_are_those_of_a_set(self, cells: Cells, offset: tuple[int, int, int]) -> None:
        blocks = Blocks.around(cells, 1)
        found = as_set(blocks.cells(stepped(blocks, blocks.bitmask_of(cells), offset)))
        assert found == as_set(cells - np.array(offset))

    @law(25)
    @given(cells=scattered(), offset=st.sampled_from(OFFSETS))
    def test_beyond_the_blocks_are_those_of_space(self, cells: Cells, offset: tuple[int, int, int]) -> None:
        blocks = Blocks.around(cells, 0)
        inner = as_set(everywhere(blocks))
        found = as_set(blocks.cells(stepped(blocks, blocks.beyond(), offset)))
        assert found == {cell for cell in inner if tuple(np.add(cell, offset).tolist()) not in inner}

    @law(40)
    @given(cells=scattered(), steps=st.integers(0, 2))
    def test_are_added_by_growing(self, cells: Cells, steps: int) -> None:
        blocks = Blocks.around(cells, steps)
        reach = range(-steps, steps + 1)
        wanted = set().union(*(as_set(cells + offset) for offset in product(reach, repeat=3)))
        assert as_set(blocks.cells(blocks.grown(blocks.bitmask_of(cells), steps))) == wanted

    @law(30)
    @given(cells=scattered(), seed=seeds, steps=st.integers(0, 4))
    def test_are_walked_to_through_a_set(self, cells: Cells, seed: int, steps: int) -> None:
        rng = np.random.default_rng(seed)
        blocks = Blocks.around(cells, 2)
        grown = blocks.cells(blocks.grown(blocks.bitmask_of(cells), 2))
        open_ = as_set(grown[rng.random(len(grown)) < 0.5])
        wanted = as_set(cells)
        for _ in range(steps):
            beside = {tuple(np.add(cell, offset).tolist()) for cell in wanted for offset in OFFSETS}
            wanted = wanted | (beside & open_)
        bitmask = blocks.spread(
            blocks.bitmask_of(cells), blocks.bitmask_of(np.array(sorted(open_)).reshape(-1, 3)), steps
        )
        assert as_set(blocks.cells(bitmask)) == wanted


class TestFlood:
    @law(30)
    @given(cells=scattered(), share=st.sampled_from([0.2, 0.35, 0.6]), seed=seeds)
    def test_of_the_outside_is_that_of_a_whole_grid(self, cells: Cells, share: float, seed: int) -> None:
        cells = np.where(cells > 1000, cells % 50, cells)
        blocks = Blocks.around(cells, size(3, 0))
        all_cells = everywhere(blocks)
        closed = all_cells[np.random.default_rng(seed).random(len(all_cells)) < share]
        reached = blocks.beyond()
        blocks.flood(~blocks.bitmask_of(closed), reached)
        low = all_cells.min(axis=0) - 1
        open_ = np.ones(all_cells.max(axis=0) - low + 2, bool)
        open_[tuple((closed - low).T)] = False
        labels, _ = ndimage.label(open_)
        wanted = all_cells[labels[tuple((all_cells - low).T)] == labels[0, 0, 0]]
        assert_same(blocks.cells(reached), wanted)

    @pytest.mark.parametrize("share", [0.2, 0.5])
    def test_of_one_cube_is_its_component(self, share: float) -> None:
        wide = size(40, 14)
        open_ = np.pad(np.random.default_rng(1).random((wide, wide, wide)) < share, 1)
        cells = np.argwhere(open_)
        blocks = Blocks.around(cells, 0)
        labels, _ = ndimage.label(open_)
        seed = cells[labels[open_] == np.bincount(labels[open_]).argmax()][:1]
        reached = blocks.bitmask_of(seed)
        blocks.flood(blocks.bitmask_of(cells), reached)
        assert_same(blocks.cells(reached), np.argwhere(labels == labels[tuple(seed[0])]))


def box(low: int, high: int) -> Cells:
    """Return the cells of a hollow box, one thick."""
    line = np.arange(low, high)
    sides = np.meshgrid([low, high - 1], line, line, indexing="ij")
    side = np.stack(sides, axis=-1).reshape(-1, 3)
    return np.unique(np.concatenate([np.roll(side, axis, axis=1) for axis in range(3)]), axis=0)


class TestSpace:
    """Space without blocks: outside, and in cavities that are wider than the margin around their lining."""

    @pytest.mark.parametrize("parts", range(1, size(4, 2)))
    def test_is_outside_or_in_a_cavity_however_deep_boxes_are_nested(self, parts: int) -> None:
        """What floats in a cavity, far from its lining, has layers of empty blocks of its own around it."""
        sides = [(0, 10), (-50, 60), (-110, 120)][:parts]
        cells = np.concatenate([box(*side) for side in sides])
        blocks = Blocks.around(cells, 1)
        reached = blocks.beyond()
        blocks.flood(~blocks.bitmask_of(cells), reached)
        all_cells = everywhere(blocks)
        outside = ((all_cells < cells.min()) | (all_cells > cells.max())).any(axis=1)
        assert_same(blocks.cells(reached), all_cells[outside])
        assert blocks.spaces == parts

    def test_of_a_cavity_is_flooded_through_a_hole(self) -> None:
        cells = box(0, 48)
        cells = cells[(cells != [20, 20, 47]).any(axis=1)]
        blocks = Blocks.around(cells, 1)
        reached = blocks.beyond()
        blocks.flood(~blocks.bitmask_of(cells), reached)
        assert blocks.spaces == 2
        assert (reached[len(blocks) :] == ~np.uint64(0)).all()
        assert blocks.count(reached).sum() == EDGE**3 * len(blocks) - len(cells)


def test_threads_change_no_bitmask(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "SHARE", 3)
    cells = np.random.default_rng(0).integers(-20, size(60, 5), (200, 3))
    one, two = (Blocks.around(cells, 4, threads=n) for n in (1, 2))
    assert one.grown(one.bitmask_of(cells), 3).tobytes() == two.grown(two.bitmask_of(cells), 3).tobytes()


@pytest.mark.parametrize(
    ("column", "step"),
    [(4, (0, 0, -1)), (10, (0, -1, 0)), (12, (-1, 0, 0)), (14, (1, 0, 0)), (16, (0, 1, 0)), (22, (0, 0, 1))],
)
def test_a_block_is_left_over_the_side_where_it_is_reached(column: int, step: tuple[int, int, int]) -> None:
    """By each of its cubes alone."""
    for cell in product(range(8), repeat=3):
        blocks = Blocks.around(np.array([cell]), 0)
        reached = blocks.bitmask_of(np.array([cell]))
        leaves = any(not 0 <= at + by < 8 for at, by in zip(cell, step, strict=True))
        [block] = np.flatnonzero(blocks.count(reached).any(axis=1))
        assert touches(reached, int(block), column) == leaves
