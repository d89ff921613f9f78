"""Levels that slabs look at: near a surface alone, and in line with the borders between voxels."""

from __future__ import annotations

import pickle
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from tomomesh.cuberille.neighbors import DIRECTIONS
from tomomesh.isosurface.crossings import IN_LINE, Levels, Stretch
from tomomesh.slabs.near import NearSurface

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("levels")


class TestNearSurface:
    @law(40)
    @given(seeds, st.lists(st.integers(1, 8), max_size=4), st.integers(0, 9), st.integers(0, 9), st.booleans())
    def test_any_slices_of_any_parts_are_those_that_were_kept(
        self, place: Path, seed: int, cuts: list[int], start: int, count: int, sent: bool
    ) -> None:
        rng = np.random.default_rng(seed)
        most = np.float32(rng.uniform(0.1, 2))
        levels = np.clip(rng.normal(size=(9, 5, 7)).astype(np.float32), -most, most)
        levels[rng.random(levels.shape) < 0.1] = 0
        parts = np.split(levels, sorted({*cuts}))
        kept = NearSurface.of(parts, most, place)
        some = kept[start : start + count] if count else kept
        some = pickle.loads(pickle.dumps(some)) if sent else some
        expected = levels[start : start + count] if count else levels
        assert kept.shape == levels.shape
        np.testing.assert_array_equal(kept.inside[:], levels > 0)
        if len(expected):
            np.testing.assert_array_equal(some.read(), expected)

    def test_what_lies_on_the_disk_is_read_by_whoever_is_sent_it(self, place: Path) -> None:
        levels = np.random.default_rng(0).uniform(-1, 1, (4, 100, 200)).astype(np.float32)
        kept = NearSurface.of([levels[:2], levels[2:]], np.float32(1), place)
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(kept)).read(), levels)
        assert not [*place.iterdir()]


@law(60)
@given(seeds, st.sampled_from(["u1", "i2", ">i2", "i4", "f4", "f8", "?"]), st.sampled_from([(), (2,)]), st.booleans())
def test_levels_in_line_are_those_at_their_places(seed: int, kind: str, layers: tuple[int, ...], view: bool) -> None:
    rng = np.random.default_rng(seed)
    volume = (rng.normal(size=(6, 5, 4, *layers)) * 50).astype(kind)
    if np.dtype(kind).kind == "f":
        volume[rng.random(volume.shape) < 0.1] = np.inf
        volume[rng.random(volume.shape) < 0.1] = np.nan
    low, stop = sorted(rng.choice(7, 2, replace=False).tolist())
    part = volume[low:stop]
    held = Stretch(part[:, ::-1].copy()[:, ::-1] if view else part, (low, 0, 0), volume.shape)
    count = int(rng.integers(0, 30))
    inner = rng.integers(0, (4, 5, 6), (count, 3)).astype(np.int32)
    directions = rng.integers(0, 6, count).astype(np.uint8)
    steps = np.array(DIRECTIONS, np.int32)[directions]
    found = held.lines(inner, directions)
    assert found.shape == (count, 4, *(layers or (1,)))
    for n, times in enumerate(IN_LINE):
        expected = Levels(held, 0.0, 1.0).at(inner + times * steps)
        np.testing.assert_array_equal(found[:, n].astype(np.float64), expected)
