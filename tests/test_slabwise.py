"""What is kept of a study slab by slab is what is kept of it whole: in any cuts, in memory or read part by part."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from tomomesh import Settings, Volume
from tomomesh.errors import EmptyError, TomomeshError, UsageError
from tomomesh.isosurface.run_mask import RunMask
from tomomesh.model.lazy import ArraySource, LazyVoxels, in_memory
from tomomesh.segmentation.otsu import otsu_threshold
from tomomesh.segmentation.padding import beside
from tomomesh.segmentation.slabwise.cut import Cutting
from tomomesh.segmentation.slabwise.levels import TAILS, levels_of
from tomomesh.segmentation.slabwise.sources import MaskVoxels, Placed
from tomomesh.segmentation.study import lay_out, select_in
from tomomesh.slabs.keep import InMemory, OnDisk
from tomomesh.ways.choice import take_way

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tomomesh.segmentation.study import Selected
    from tomomesh.stage import Stage

SHAPE = (11, 16, 17)
SLICES, ROWS, COLUMNS = np.indices(SHAPE)
BALL = (1.6 * (SLICES - 5)) ** 2 + (ROWS - 7) ** 2 + (COLUMNS - 8) ** 2 < 42
CIRCLE = np.hypot(ROWS - 7.5, COLUMNS - 8) > 7.6
KINDS = ("u1", "i1", "i2", ">i2", "u2", "i4", "u4", ">f4", "f4", "f8", "f2")
TURN = np.deg2rad(20)
OBLIQUE = np.array(
    [[np.cos(TURN), -np.sin(TURN), 0, 4], [np.sin(TURN), np.cos(TURN), 0, -7], [0, 0, 1.5, 2], [0, 0, 0, 1.0]]
)


@st.composite
def cuttings(draw: st.DrawFn) -> Cutting:
    """Draw where studies are cut: in places that are shares of their slices, so that they fit every one."""
    shares = draw(st.lists(st.floats(0.01, 0.99), max_size=6))
    return Cutting(
        lambda shape: sorted({0, shape[0], *(min(shape[0], int(share * shape[0]) + 1) for share in shares)}),
        draw(st.sampled_from([None, InMemory()])),
    )


@st.composite
def grays(draw: st.DrawFn) -> NDArray[Any]:
    """Draw a study of a ball in noise: padding around it or not, specks and pores, levels that are no numbers."""
    rng, kind = np.random.default_rng(draw(seeds)), np.dtype(draw(st.sampled_from(KINDS)))
    levels = np.where(BALL, 1.0, 0.0) + 0.06 * rng.normal(size=SHAPE)
    levels[rng.random(SHAPE) < draw(st.sampled_from([0, 0.01]))] = 1
    levels[BALL & (rng.random(SHAPE) < draw(st.sampled_from([0, 0.02])))] = 0
    padded = draw(st.sampled_from([None, CIRCLE, SLICES < 4, COLUMNS > 12]))
    level = draw(st.sampled_from([0.4, 0.0, -9.0, -0.0]))
    levels = levels if padded is None else np.where(padded, level, levels)
    if kind.kind == "f":
        levels.flat[7:9] = draw(st.sampled_from([0, np.nan, np.inf, -np.inf]))
        return levels.astype(kind)
    scale = 40 if kind.itemsize == 1 else 500
    return np.clip(np.rint(levels * scale + (kind.kind == "u") * scale), *_limits(kind)).astype(kind)


def _limits(kind: np.dtype[Any]) -> tuple[int, int]:
    return int(np.iinfo(kind).min), int(np.iinfo(kind).max)


@st.composite
def label_maps(draw: st.DrawFn) -> NDArray[Any]:
    """Draw a map of three labels, with gaps, specks, and numbers that are nearly whole."""
    rng = np.random.default_rng(draw(seeds))
    labels = np.where(BALL, 1 + (COLUMNS > 8), 0) * draw(st.sampled_from([1, 3, 70_000]))
    labels[rng.random(SHAPE) < draw(st.sampled_from([0, 0.01]))] = 5
    labels[draw(st.sampled_from([slice(0), slice(4, 6), slice(1, None, 2)]))] = 0
    if draw(st.booleans()):
        return np.asarray(labels + draw(st.sampled_from([0, 1e-5, 0.3])) * (labels == 1), np.float32)
    return np.asarray(labels, draw(st.sampled_from(["i4", "u4", "i8"])))


ASKED = st.fixed_dictionaries(
    {},
    optional={
        "keep": st.sampled_from(["auto", "all", "largest"]),
        "slices": st.sampled_from(["axial", "coronal", "sagittal"]),
        "slice_range": st.just((2, 8)),
        "roi": st.just((-3.0, 9.0, -4.0, 12.0, 3.0, 17.0)),
    },
)
"""What may be asked of any study."""


def kept(volume: Volume, asked: dict[str, Any], cutting: Cutting, labels: Volume | None = None) -> Stage[Selected]:
    settings = Settings().replace(**asked)
    return select_in(lay_out(volume, labels, settings, labelled="select" in asked, cutting=cutting), settings)


def lazily(volume: Volume) -> Volume:
    """Have its voxels stay where they are until they are read."""
    voxels: Any = LazyVoxels.of(ArraySource(volume.voxels))
    return replace(volume, voxels=voxels)


def whole(shape: tuple[int, ...]) -> list[int]:
    return [0, shape[0]]


def assert_the_same(volume: Volume, asked: dict[str, Any], cutting: Cutting, labels: Volume | None = None) -> None:
    """Compare what is kept, bit for bit, and every word that is told of it, or the error."""
    there = None if labels is None else lazily(labels)
    wanted = kept_or_not(volume, asked, Cutting(whole), labels)
    for study, map_ in ((volume, labels), (lazily(volume), there)):
        found = kept_or_not(study, asked, cutting, map_)
        if isinstance(wanted, str) or isinstance(found, str):
            assert found == wanted
        else:
            assert_equal(found, wanted)


def kept_or_not(
    volume: Volume, asked: dict[str, Any], cutting: Cutting, labels: Volume | None
) -> Stage[Selected] | str:
    """Return what is kept, or why nothing is."""
    try:
        return kept(volume, asked, cutting, labels)
    except TomomeshError as fault:
        return repr(fault)


def assert_equal(found: Stage[Selected], wanted: Stage[Selected]) -> None:
    ours, theirs = found.value.chosen, wanted.value.chosen
    for name in ("shape", "begin", "starts", "stops"):
        np.testing.assert_array_equal(getattr(ours.runs, name), getattr(theirs.runs, name))
    np.testing.assert_array_equal(ours.mask, theirs.mask)
    voxels = in_memory(ours.volume.voxels)
    assert (voxels.dtype, voxels.tobytes()) == (theirs.volume.voxels.dtype, theirs.volume.voxels.tobytes())
    np.testing.assert_array_equal(ours.lower, theirs.lower)
    np.testing.assert_array_equal(ours.upper, theirs.upper)
    assert (ours.counts, ours.told) == (theirs.counts, theirs.told)
    assert repr(found.stats) == repr(wanted.stats)
    assert found.warnings == wanted.warnings
    assert found.value.study.notes == wanted.value.study.notes
    ways = [take_way(one.value, Settings()).stats for one in (found, wanted)]
    assert repr(ways[0]) == repr(ways[1])


class TestSelection:
    @law(150)
    @given(levels=grays(), asked=ASKED, cutting=cuttings(), data=st.data())
    def test_of_gray_levels(
        self, levels: NDArray[Any], asked: dict[str, Any], cutting: Cutting, data: st.DataObject
    ) -> None:
        lower = float(np.nanmedian(levels[BALL].astype(float)))
        asked |= data.draw(st.sampled_from([{}, {"lower": lower}, {"upper": lower}, {"preset": "soft-tissue"}]))
        named = data.draw(st.sampled_from([None, (-20.0, -4.0), (float(np.nanmin(levels)),) * 2]))
        affine = data.draw(st.sampled_from([np.eye(4), OBLIQUE]))
        assert_the_same(replace(Volume.from_stored(levels, affine), padding=named), asked, cutting)

    @law(40)
    @given(one=grays(), cutting=cuttings(), asked=ASKED, layers=st.sampled_from(["all", "any"]))
    def test_of_colors(self, one: NDArray[Any], cutting: Cutting, asked: dict[str, Any], layers: str) -> None:
        voxels = np.stack([one, one[::-1, ::-1], np.zeros_like(one)], axis=-1)
        assert_the_same(Volume.from_stored(voxels, np.eye(4)), asked | {"layers": layers}, cutting)

    @law(80)
    @given(labels=label_maps(), asked=ASKED, cutting=cuttings(), data=st.data())
    def test_of_labels(
        self, labels: NDArray[Any], asked: dict[str, Any], cutting: Cutting, data: st.DataObject
    ) -> None:
        wanted = data.draw(st.sampled_from([(1,), (1, 2), (3, 6), (70_000,), (5, 1)]))
        study = Volume.from_stored(labels, data.draw(st.sampled_from([np.eye(4), OBLIQUE])))
        assert_the_same(study, asked | {"select": wanted}, cutting)

    @law(20)
    @given(labels=label_maps(), cutting=cuttings())
    def test_of_labels_taken_for_gray_levels(self, labels: NDArray[Any], cutting: Cutting) -> None:
        assert_the_same(Volume.from_stored(labels, np.eye(4)), {}, cutting)

    @law(20)
    @given(cutting=cuttings(), low=st.tuples(*[st.integers(-3, 9)] * 3), flip=st.booleans())
    def test_of_labels_on_a_part_of_the_study(self, cutting: Cutting, low: tuple[int, ...], flip: bool) -> None:
        affine = np.eye(4)
        affine[:3, 3] = low
        if flip:
            affine[0, 0], affine[0, 3] = -1, low[0] + 16
        labels = Volume.from_stored(BALL.astype(np.uint8), affine)
        assert_the_same(Volume.from_stored(BALL.astype(np.int16), np.eye(4)), {"select": (1,)}, cutting, labels)

    def test_filled_slices_are_refused_where_voxels_are_read_part_by_part(self) -> None:
        labels = BALL.astype(np.uint8)
        labels[1::2] = 0
        with pytest.raises(UsageError, match="in memory alone"):
            kept(lazily(Volume.from_stored(labels, np.eye(4))), {"select": (1,), "fill_slices": True}, Cutting())

    @pytest.mark.parametrize("kind", ["i2", "f4"])
    def test_nothing_in_the_window_names_the_range_of_the_whole(self, kind: str) -> None:
        with pytest.raises(EmptyError, match="between 0 and 1"):
            kept(lazily(Volume.from_stored(BALL.astype(kind), np.eye(4))), {"lower": 7.0}, Cutting(range_of))


class TestPadding:
    @pytest.mark.parametrize("kind", ["i2", "f4", "f8"])
    @pytest.mark.parametrize("level", [0.4, -9.0])
    @pytest.mark.parametrize("place", [SLICES < 4, SLICES > 8, COLUMNS > 12, ROWS < 3, CIRCLE])
    def test_is_found_in_slabs_and_has_no_say(self, place: NDArray[np.bool_], level: float, kind: str) -> None:
        noise = 0.06 * np.random.default_rng(4).normal(size=SHAPE)
        levels = (np.where(place, level, BALL + noise) * (500 if kind == "i2" else 1)).astype(kind)
        for cutting in (Cutting(whole), Cutting(range_of), Cutting(lambda shape: [0, 2, 10, shape[0]])):
            for study in (Volume.from_stored(levels, np.eye(4)), lazily(Volume.from_stored(levels, np.eye(4)))):
                found = kept(study, {}, cutting).value.chosen
                assert found.counts.padding == np.count_nonzero(place)
                assert found.lower == otsu_threshold(levels[~place])
                background = np.where(place, levels[~place].min(), levels)
                np.testing.assert_array_equal(in_memory(found.volume.voxels), background)


def range_of(shape: tuple[int, ...]) -> range:
    """Cut slice by slice."""
    return range(shape[0] + 1)


def head() -> NDArray[np.int16]:
    """A head on a table, with air ways, a holder that touches it, and specks: Hounsfield units in voxels of 4 mm."""
    k, j, i = np.indices((40, 62, 56))
    away = ((k - 20) / 18) ** 2 + ((j - 28) / 22) ** 2 + ((i - 28) / 20) ** 2
    levels = np.where(away < 1, 40.0, -1000.0)
    levels[(away < 0.8) & (away > 0.6)] = 900
    levels[(k > 14) & (k < 26) & (((j - 28) / 6) ** 2 + ((i - 18) / 5) ** 2 < 1)] = -800
    levels[4:36, 54:56, 8:48], levels[4:36, 59:60] = 400, -200
    levels[18:22, 26:30, 48:56] = -1000
    levels[18:21, 40:56, 27:29] = 300
    return (levels + 20 * np.random.default_rng(3).normal(size=levels.shape)).astype(np.int16)


class TestBody:
    @law(25)
    @given(
        cutting=cuttings(), preset=st.sampled_from(["bone", "skin", "lung", "fat", None]), slices=st.integers(0, 2),
        keep=st.sampled_from(["auto", "body", "all"]), padded=st.booleans(), edge=st.sampled_from([0.7, 4.0]),
        cells=st.sampled_from([20, 160]),
    )  # fmt: skip
    def test_of_a_head_on_a_table(
        self,
        cutting: Cutting,
        preset: str | None,
        slices: int,
        keep: str,
        padded: bool,
        edge: float,
        cells: int,
    ) -> None:
        levels = head()
        levels[:, :2] = -3000 if padded else levels[:, :2]
        study = replace(Volume.from_stored(levels, np.diag([edge, edge, edge, 1.0])), unit="HU")
        asked = {"keep": keep, "slices": ("axial", "coronal", "sagittal")[slices]}
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("tomomesh.segmentation.body.CELLS", cells)
            assert_the_same(study, asked | ({"preset": preset} if preset else {}), cutting)


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


def test_what_is_kept_on_disk_is_the_same(tmp_path: Path) -> None:
    study = replace(Volume.from_stored(head(), np.diag([4.0, 4, 4, 1])), unit="HU")
    found = kept(lazily(study), {"preset": "skin"}, Cutting(range_of, OnDisk(tmp_path)))
    assert_equal(found, kept(study, {"preset": "skin"}, Cutting(whole)))
    assert not list(tmp_path.iterdir())
