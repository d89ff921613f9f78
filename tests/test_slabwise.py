"""What is kept of a study slab by slab is what is kept of it whole: in any cuts, in memory or read part by part."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from cuttings import (
    ASKED,
    BALL,
    CIRCLE,
    COLUMNS,
    OBLIQUE,
    ROWS,
    SHAPE,
    SLICES,
    assert_equal,
    assert_the_same,
    cuttings,
    grays,
    kept,
    label_maps,
    lazily,
    whole,
)
from tomomesh import Volume
from tomomesh.errors import EmptyError, UsageError
from tomomesh.model.lazy import in_memory
from tomomesh.segmentation.otsu import otsu_threshold
from tomomesh.segmentation.slabwise.cut import Cutting
from tomomesh.slabs.keep import OnDisk

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


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


def test_what_is_kept_on_disk_is_the_same(tmp_path: Path) -> None:
    study = replace(Volume.from_stored(head(), np.diag([4.0, 4, 4, 1])), unit="HU")
    found = kept(lazily(study), {"preset": "skin"}, Cutting(range_of, OnDisk(tmp_path)))
    assert_equal(found, kept(study, {"preset": "skin"}, Cutting(whole)))
    assert not list(tmp_path.iterdir())
