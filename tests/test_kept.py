"""What is kept of a window: presets, specks and pores, holders, linings, and shares that add up."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import law, seeds
from studies import shared
from test_body import AIR, BONE, LUNG, SKIN, TABLE, head, lungs
from tomomesh import Volume, read_volume, segment
from tomomesh.cli.summary import of_points
from tomomesh.errors import UsageError
from tomomesh.isosurface.run_mask import RunMask
from tomomesh.segmentation.body import SMALL, SPECK, without_specks
from tomomesh.segmentation.window import PRESETS_HU
from tomomesh.settings import ReadSettings
from tomomesh.settings.window import PRESETS

if TYPE_CHECKING:
    from numpy.typing import NDArray

TOUCHING = np.ones((3, 3, 3), np.bool_)


def adds_up(window: dict[str, Any]) -> bool:
    """Tell whether the voxels that are kept are those of the window, less what was left out, and what was filled."""
    left = window["room_voxels"] + window["dropped_voxels"] + window["speck_voxels"]
    filled = window["filled_pore_voxels"] + window["filled_lining_voxels"]
    return bool(window["voxels"] == window["window_voxels"] - left + filled)


def holed(levels: NDArray[np.int16]) -> Volume:
    return Volume.from_stored(levels, np.diag([2.0, 2.0, 2.0, 1.0]), unit="HU")


class TestPresets:
    def test_those_that_are_offered_have_bounds(self) -> None:
        assert set(PRESETS) == set(PRESETS_HU)

    @pytest.mark.parametrize("preset", PRESETS)
    def test_the_page_has_their_bounds(self, preset: str) -> None:
        page = (Path(__file__).parents[1] / "docs" / "command-line.md").read_text("utf-8")
        [row] = re.findall(rf"^\| `{preset}` \| (\S+) \| (\S+) \|", page, re.MULTILINE)
        assert [float({"any": "inf", "none": "-inf"}.get(cell, cell)) for cell in row] == list(PRESETS_HU[preset])

    @pytest.mark.parametrize("preset", sorted(set(PRESETS) - {"lung"}))
    def test_a_window_keeps_what_lies_in_it(self, preset: str) -> None:
        lower, upper = PRESETS_HU[preset]
        inside = int(lower) + 1
        levels = np.full((40, 40, 40), AIR, np.int16)
        levels[5:35, 5:35, 5:35] = inside
        levels[5:35, 5:20, 5:35] = min(upper + 1, 3000) if upper < 1000 else inside
        found = segment(holed(levels), preset=preset, network="none")
        assert found.mask.sum() == (levels == inside).sum()
        assert found.report["window"]["lower_from"] == "preset"
        assert found.report["window"]["upper_from"] == (None if np.isinf(upper) else "preset")

    def test_lung_is_the_air_inside_of_the_body(self) -> None:
        study = lungs(bubble=False)
        found = segment(study, preset="lung", network="none")
        np.testing.assert_array_equal(found.mask, study.voxels == LUNG)
        window = found.report["window"]
        assert window["room_voxels"] == (study.voxels == AIR).sum()
        assert adds_up(window)

    def test_lungs_that_the_study_cuts_off_stay(self) -> None:
        study = lungs(bubble=False)
        part = study.cropped((slice(18, 30), slice(0, 80), slice(0, 110)))
        found = segment(part, preset="lung", network="none")
        np.testing.assert_array_equal(found.mask, part.voxels == LUNG)

    def test_lung_keeps_all_air_where_it_is_told_to(self) -> None:
        found = segment(lungs(), preset="lung", network="none", keep="all")
        assert found.report["window"]["share"] == pytest.approx((lungs().voxels <= -400).mean())

    def test_skin_is_one_outer_surface(self) -> None:
        """Without linings of lungs, and of an airway 8 mm wide that leads to the skin."""
        study = lungs(bubble=False)
        levels = np.array(study.voxels)
        levels[23:31, 40:43, :40] = np.where(levels[23:31, 40:43, :40] == SKIN, AIR, levels[23:31, 40:43, :40])
        open_ = Volume.from_stored(levels, study.affine, unit="HU")
        found = segment(open_, preset="skin", network="none")
        whole = lungs(bubble=False).voxels != AIR
        assert not (found.mask & ~whole).any()
        assert (whole & ~found.mask).sum() < 0.01 * whole.sum()
        assert found.report["window"]["filled_lining_voxels"] > (study.voxels == LUNG).sum()
        assert ndimage.label(~np.pad(found.mask, ((0, 0), (1, 1), (1, 1))))[1] == 1

    def test_labels_are_no_ct(self) -> None:
        labels = np.zeros((9, 9, 9), np.uint8)
        labels[2:7, 2:7, 2:7] = 3
        with pytest.raises(UsageError, match="--select"):
            segment(Volume.from_stored(labels, np.eye(4)), preset="bone", network="none")
        image = np.random.default_rng(0).integers(0, 900, (9, 9, 9)).astype(np.int16)
        with pytest.raises(UsageError, match="--lower"):
            segment(Volume.from_stored(image, np.eye(4)), preset="bone", network="none")


class TestHolder:
    @staticmethod
    def held() -> Volume:
        """A head whose skin touches a dense shell on one side over a bridge of 4 mm."""
        levels = np.array(head(table=False).voxels)
        levels[4:20, 25:65, 76:78] = TABLE
        levels[10:12, 34:36, 69:76] = SKIN
        return Volume.from_stored(levels, head().affine, unit="HU")

    @pytest.mark.parametrize("preset", ["skin", "soft-tissue"])
    def test_one_that_touches_the_skin_goes(self, preset: str) -> None:
        found = segment(self.held(), preset=preset, network="none")
        alone = segment(head(table=False), preset=preset, network="none")
        assert not found.mask[:, :, 76:].any()
        np.testing.assert_array_equal(found.mask[:, :, :69], alone.mask[:, :, :69])
        assert adds_up(found.report["window"])

    def test_all_keeps_it(self) -> None:
        found = segment(self.held(), preset="skin", network="none", keep="all")
        assert found.mask[:, :, 76:78].any()

    def test_a_real_one_goes_and_the_ears_stay(self) -> None:
        study = read_volume(shared("dcm_qa_ct/In/GE"), settings=ReadSettings(resample_slices=True))
        found = segment(study, preset="skin", network="none", slice_range=(10, 59))
        columns = np.flatnonzero(found.mask.any(axis=(0, 1)))
        assert columns.min() > 50
        assert ndimage.label(found.mask, TOUCHING)[1] == 1
        assert found.report["window"]["named_padding_voxels"] == (study.voxels[10:60] == -1500).sum()


class TestSpecks:
    @law(60)
    @given(seed=seeds, share=st.floats(0.001, 0.4), grown=st.integers(0, 2))
    def test_no_others_are_left_out_or_filled(self, seed: int, share: float, grown: int) -> None:
        rng = np.random.default_rng(seed)
        mask = rng.random((14, 15, 16)) < share
        mask[rng.integers(14), rng.integers(15), rng.integers(16)] = True
        mask = ndimage.binary_dilation(mask, iterations=grown) if grown else mask
        mask = np.kron(mask, np.ones((3, 3, 3), np.bool_)) if seed % 2 else mask
        found = without_specks(RunMask.of([mask]))
        labels, _ = ndimage.label(mask, TOUCHING)
        sizes = np.bincount(labels.ravel())[1:]
        limit = min(SPECK, SMALL * sizes.max())
        gone, new = mask & ~found.mask[:], found.mask[:] & ~mask
        assert (found.specks, found.speck_voxels) == ((sizes < limit).sum(), sizes[sizes < limit].sum())
        assert found.largest_speck == sizes[sizes < limit].max(initial=0)
        np.testing.assert_array_equal(gone, np.isin(labels, np.flatnonzero(sizes < limit) + 1))
        holes, count = ndimage.label(new)
        assert (found.pores, found.pore_voxels) == (count, new.sum())
        assert (np.bincount(holes.ravel())[1:] < limit).all()
        assert not (ndimage.binary_dilation(np.pad(new, 1)) & ~np.pad(mask | new, 1)).any()

    def test_the_smallest_that_stays_has_8_voxels_beside_8000(self) -> None:
        mask = np.zeros((40, 40, 60), np.bool_)
        mask[1:22, 1:22, 1:22] = mask[5:7, 5:7, 40:42] = True
        mask[20, 20:27, 40] = True
        mask[10:12, 10:12, 10:12] = mask[15, 15, 15:18] = False
        found = without_specks(RunMask.of([mask]))
        assert (found.specks, found.largest_speck, found.pores, found.pore_voxels) == (1, 7, 1, 3)

    def test_a_small_structure_keeps_every_piece(self) -> None:
        mask = np.zeros((12, 12, 30), np.bool_)
        mask[2:8, 2:8, 2:8] = mask[5, 5, 20] = mask[5, 5:7, 25] = True
        mask[4, 4, 4] = False
        runs = RunMask.of([mask])
        assert without_specks(runs).mask is runs

    @pytest.mark.parametrize(("labels", "most"), [((515, 516), 0.003), ((4, 43, 14, 15), 0.001), ((2, 41), 0.001)])
    def test_labels_keep_their_volume_and_pieces(self, labels: tuple[int, ...], most: float) -> None:
        study = read_volume(shared("derived/dev54_synth_t1/dev54_synth_t1_labels.nii.gz"))
        wanted = np.isin(study.voxels, labels)
        found = segment(study, select=labels, network="none")
        assert found.mask.sum() == pytest.approx(wanted.sum(), rel=most)
        sizes = np.bincount(ndimage.label(wanted, TOUCHING)[0].ravel())[1:]
        assert ndimage.label(found.mask, TOUCHING)[1] == (sizes >= min(SPECK, SMALL * sizes.max())).sum()


class TestTold:
    def test_shares_add_up_and_are_said(self) -> None:
        levels = np.array(head().voxels)
        levels[12, 8, 8] = levels[12, 8, 9] = TABLE
        levels[4, 50, 40] = AIR
        found = segment(holed(levels), preset="skin", network="none")
        window = found.report["window"]
        assert adds_up(window)
        assert window["dropped_components"] == 2
        [line] = [one for one in of_points(dict(found.report), "x") if one.startswith("kept")]
        assert f"{window['dropped_voxels'] / window['window_voxels']:.2%} outside the body left out" in line
        assert "what it encloses filled" in line

    def test_nothing_is_said_where_nothing_was_changed(self) -> None:
        found = segment(head(table=False), preset="bone", network="none")
        assert found.report["window"]["voxels"] == found.report["window"]["window_voxels"]
        assert not [one for one in of_points(dict(found.report), "x") if one.startswith("kept")]

    @pytest.mark.parametrize(
        ("asked", "told"),
        [
            ({}, ("otsu", None)),
            ({"lower": 10.0}, ("given", None)),
            ({"upper": 10.0}, (None, "given")),
            ({"preset": "spongy-bone"}, ("preset", "preset")),
        ],
    )
    def test_where_the_bounds_come_from(self, asked: dict[str, Any], told: tuple[str | None, str | None]) -> None:
        study = np.where(head(table=False).voxels == BONE, 400, head(table=False).voxels).astype(np.int16)
        window = segment(holed(study), network="none", **asked).report["window"]
        assert (window["lower_from"], window["upper_from"]) == told
