"""Voxels that are made as they are read, and what is counted of their levels slab by slab, are those of the whole."""

from __future__ import annotations

import pickle
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from cuttings import cuttings, grays, whole
from tomomesh.isosurface.run_mask import RunMask
from tomomesh.model.lazy import ArraySource, LazyVoxels
from tomomesh.segmentation.padding import beside
from tomomesh.segmentation.slabwise.cut import Cutting
from tomomesh.segmentation.slabwise.levels import TAILS, levels_of
from tomomesh.segmentation.slabwise.sources import MaskVoxels, Placed

if TYPE_CHECKING:
    from numpy.typing import NDArray


@st.composite
def sides(draw: st.DrawFn, size: int) -> slice:
    """Draw some of so many numbers, in either direction."""
    numbers = range(size)[draw(st.slices(size))]
    return slice(numbers.start, numbers.stop if numbers.stop >= 0 else None, numbers.step)


class TestSources:
    """Voxels that are made as they are read are those of the array that is made at once."""

    @law(150)
    @given(
        low=st.tuples(*[st.integers(0, 4)] * 3), sizes=st.tuples(*[st.integers(1, 4)] * 3),
        at=st.tuples(*[sides(8)] * 3), here=st.booleans(),
    )  # fmt: skip
    def test_of_voxels_in_a_larger_lattice(
        self, low: tuple[int, ...], sizes: tuple[int, ...], at: tuple[slice, ...], here: bool
    ) -> None:
        inner = np.arange(1, 1 + np.prod(sizes)).reshape(sizes)
        whole = np.zeros((8, 8, 8), inner.dtype)
        whole[tuple(slice(a, a + size) for a, size in zip(low, sizes, strict=True))] = inner
        placed = LazyVoxels.of(Placed(inner if here else LazyVoxels.of(ArraySource(inner)), low, (8, 8, 8)))
        np.testing.assert_array_equal(placed[at].read(), whole[at])

    @law(100)
    @given(seed=seeds, at=st.tuples(sides(7), sides(6), sides(5)))
    def test_of_masks_and_of_other_voxels(self, seed: int, at: tuple[slice, ...]) -> None:
        mask = np.random.default_rng(seed).random((7, 6, 5)) < 0.5
        drawn = LazyVoxels.of(MaskVoxels(RunMask.of([mask])))
        np.testing.assert_array_equal(drawn[at].read(), mask[at].view(np.uint8))
        for view, expected in (
            (drawn[at], mask[at]),
            (drawn[::-1].transpose((2, 0, 1)), mask[::-1].transpose(2, 0, 1)),
        ):
            sent = pickle.loads(pickle.dumps(view))
            np.testing.assert_array_equal(sent.read(), expected)
            np.testing.assert_array_equal(sent[1:].read(), expected[1:])
        made = Cutting(whole).of(drawn).made(numbered, np.int64).voxels
        np.testing.assert_array_equal(made[at].read(), np.indices(mask.shape).sum(axis=0)[at] + mask[at])

    def test_no_more_of_a_mask_is_sent_than_is_viewed(self) -> None:
        """Each worker would have all of it as often as it has slabs."""
        drawn = LazyVoxels.of(MaskVoxels(RunMask.of([np.random.default_rng(0).random((64, 64, 64)) < 0.5])))
        assert len(pickle.dumps(drawn[8:12])) < len(pickle.dumps(drawn)) / 12


def numbered(levels: NDArray[Any], box: tuple[slice, ...]) -> NDArray[np.int64]:
    """Add the numbers of slice, row and column to each voxel."""
    places = np.ogrid[tuple(slice(side.start, side.stop, side.step) for side in box)]
    return np.asarray(levels + sum(places), np.int64)


class TestLevels:
    @law(150)
    @given(levels=grays(), cutting=cuttings(), level=st.integers(0, 11 * 16 * 17 - 1))
    def test_are_those_that_numpy_finds(self, levels: NDArray[Any], cutting: Cutting, level: int) -> None:
        found = cutting.of(levels).levels
        out = levels.flat[level]
        for ours, theirs in ((found, levels), (found.finite, levels[np.isfinite(levels)])):
            assert_levels(ours, theirs)
        if out == out:
            assert_levels(found.without(out.item()), levels[levels != out])
            assert found.count([out.item()]) == [np.count_nonzero(levels == out)]

    @pytest.mark.parametrize("kind", ["i4", "u4", "i8", "u8", "f4", "f8", "f2"])
    def test_of_all_bits_are_in_their_order(self, kind: str) -> None:
        bits = np.random.default_rng(1).integers(0, 256, 8 * 999, dtype=np.uint8)
        levels = bits.view(kind)
        assert_levels(levels_of(levels).finite, levels[np.isfinite(levels)])

    @law(60)
    @given(levels=grays(), cutting=cuttings(), every=st.integers(1, 40))
    def test_some_beside_another_are_taken_in_even_steps(
        self, levels: NDArray[Any], cutting: Cutting, every: int
    ) -> None:
        level = levels[0, 0, 0]
        found = beside(level.item(), every, cutting.of(levels))
        np.testing.assert_array_equal(found, levels[levels != level][::every])

    def test_longer_floats_and_truths_are_levels_too(self) -> None:
        assert levels_of(np.array([0.5, -1.5], np.longdouble)).ends == (-1.5, 0.5)
        assert levels_of(np.array([False, True])).ends == (0.0, 1.0)


def assert_levels(found: Any, levels: NDArray[Any]) -> None:
    assert found.size == levels.size
    np.testing.assert_array_equal(found.ends, (float(levels.min()), float(levels.max())))
    for tail in TAILS:
        wanted = np.percentile(levels, (tail, 100 - tail), method="inverted_cdf")
        np.testing.assert_array_equal(found.bulk(tail), np.asarray(wanted, float))
    low, high = found.ends
    if np.isfinite([low, high]).all() and low < high < low + 1e4:  # beyond, numpy's own bins overflow
        np.testing.assert_array_equal(found.histogram(low, high, 9), np.histogram(levels, 9, (low, high))[0])
