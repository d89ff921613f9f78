"""Otsu's window withstands hot voxels, padding and another scale of gray levels, and finds small objects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from studies import AFFINES, sampled, shared, write_series
from tomomesh import Volume, phantom, read_volume, segment
from tomomesh.segmentation.otsu import otsu_threshold
from tomomesh.segmentation.padding import padding
from tomomesh.segmentation.window import otsu_thresholds
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from pydicom.dataset import Dataset

    Levels = NDArray[np.float64]

slices, rows, columns = np.indices((12, 30, 30))
PLACES = {
    "circle": np.hypot(columns - 14.5, rows - 14.5) > 14.5,
    "slab": columns >= 15,
    "rows": rows < 9,
    "slices": slices >= 8,
}
"""Where padding may be, of a study of 12 slices of 30 x 30: up to half of it."""


@dataclass(frozen=True)
class Study:
    """A ball of level 1 in a background of 0, with noise."""

    levels: Levels
    radius: float


@st.composite
def studies(draw: st.DrawFn) -> Study:
    rng = np.random.default_rng(draw(seeds))
    radius = draw(st.floats(6, 11))
    inside = (2 * (slices - 5.5)) ** 2 + (rows - 14.5) ** 2 + (columns - 12.5) ** 2 < radius**2
    noise = rng.uniform(0.02, 0.1, 2)
    return Study(np.where(inside, 1, 0) + np.where(inside, *noise) * rng.normal(size=slices.shape), radius)


def threshold(levels: NDArray[Any]) -> float:
    """Return Otsu's threshold as `tomomesh reconstruct` takes it."""
    return float(otsu_thresholds(Volume.from_stored(levels, np.eye(4)), padding(levels)))


class TestFarLevels:
    @law(60)
    @given(study=studies(), share=st.floats(0, 0.0099), height=st.floats(-3, 9), cold=st.booleans(), seed=seeds)
    def test_a_hundredth_of_hot_or_cold_voxels_moves_it_by_a_fiftieth_of_the_contrast(
        self, study: Study, share: float, height: float, cold: bool, seed: int
    ) -> None:
        rng, levels = np.random.default_rng(seed), study.levels.copy()
        hot = rng.choice(levels.size, int(share * levels.size), replace=False)
        far = 10**height * rng.choice([1.0, rng.random()])
        levels.flat[hot] = levels.min() - far if cold else levels.max() + far
        assert threshold(levels) == pytest.approx(threshold(study.levels), abs=0.02)

    @pytest.mark.parametrize("kind", ["i2", "u2", "f4"])
    def test_saturated_metal_does_not_lead_it_astray(self, kind: str) -> None:
        rng = np.random.default_rng(1)
        levels = (
            np.where((rows - 14) ** 2 + (columns - 14) ** 2 < 100, 1040, 0) + 100 + 20 * rng.normal(size=slices.shape)
        )
        alone = threshold(np.rint(levels).astype(kind))
        levels[5:7, 12:16, 12:17] = np.iinfo(kind).max if kind != "f4" else 3e38
        assert threshold(np.rint(levels).astype(kind)) == pytest.approx(alone, abs=20)

    @pytest.mark.parametrize("level", [-9999, -32768, np.inf, np.nan, 1e4])
    @pytest.mark.parametrize("side", [1, 3, 4, 5])
    def test_a_corner_without_data_does_not(self, level: float, side: int) -> None:
        rng = np.random.default_rng(2)
        levels = np.where((slices - 5.5) ** 2 + (rows - 14) ** 2 + (columns - 14) ** 2 < 36, 1, 0) + 0.05 * rng.normal(
            size=slices.shape
        )
        levels[:side, :side, :side] = level
        assert threshold(levels) == pytest.approx(0.5, abs=0.02)


class TestSmall:
    @pytest.mark.parametrize("count", [20, 60, 300])
    def test_an_object_in_a_big_background_is_found(self, count: int) -> None:
        """From 0.2 % of the voxels: what lies in both tails of the histogram counts where the rest is one class."""
        levels = 0.05 * np.random.default_rng(3).normal(size=slices.shape)
        levels.flat[5000 : 5000 + count] += 1
        assert threshold(levels) == pytest.approx(0.5, abs=0.1)

    def test_a_bias_of_a_third_leaves_the_object(self) -> None:
        inside = (2 * (slices - 5.5)) ** 2 + (rows - 14.5) ** 2 + (columns - 14.5) ** 2 < 100
        rng = np.random.default_rng(4)
        levels = np.abs((20 + 180 * inside) * (0.67 + 0.66 * columns / 29) + 8 * rng.normal(size=slices.shape))
        found = levels > threshold(levels)
        assert 2 * (found & inside).sum() > 0.995 * (found.sum() + inside.sum())


class TestScale:
    @law(60)
    @given(study=studies(), power=st.floats(-6, 6), down=st.booleans(), offset=st.floats(-1e3, 1e3))
    def test_another_scale_gives_the_same_window(self, study: Study, power: float, down: bool, offset: float) -> None:
        slope = (-1 if down else 1) * 10**power
        there = otsu_threshold(slope * study.levels + slope * offset)
        assert there / slope - offset == pytest.approx(otsu_threshold(study.levels), abs=1e-6)

    @law(30)
    @given(study=studies(), seed=seeds)
    def test_the_order_of_the_voxels_means_nothing(self, study: Study, seed: int) -> None:
        mixed = np.random.default_rng(seed).permutation(study.levels.ravel())
        assert otsu_threshold(mixed) == pytest.approx(otsu_threshold(study.levels), abs=1e-12)


class TestPadding:
    @law(80)
    @given(
        study=studies(),
        place=st.sampled_from(sorted(PLACES)),
        gap=st.floats(0.3, 1e4),
        end=st.sampled_from(["under", "over"]),
    )
    def test_up_to_half_of_a_study_changes_nothing(self, study: Study, place: str, gap: float, end: str) -> None:
        """The threshold is that of what was measured, to the last digit."""
        padded, levels = PLACES[place], study.levels.copy()
        levels[padded] = levels.min() - gap if end == "under" else levels.max() + gap
        found = padding(levels)
        assert found is not None
        np.testing.assert_array_equal(found, padded)
        assert threshold(levels) == otsu_threshold(study.levels[~padded])
        assert threshold(levels) == pytest.approx(threshold(study.levels), abs=0.02)

    @pytest.mark.parametrize("level", [-3024, -2000, 0, 3071])
    def test_outside_of_a_scanner_s_circle(self, level: int) -> None:
        """Also 0 HU, which is water's, and with a skull."""
        rng, far = np.random.default_rng(0), np.hypot(rows - 14.5, columns - 14.5)
        levels = np.where(far < 10, 40, -1000) + np.where((far > 7) & (far < 9), 860, 0)
        study = np.rint(levels + 12 * rng.normal(size=slices.shape)).astype(np.int16)
        study[PLACES["circle"]] = level
        kept = segment(Volume.from_stored(study, np.eye(4), unit="HU"), network="none", keep="all")
        np.testing.assert_array_equal(kept.mask, far < 10)
        window = kept.report["window"]
        assert window["padding_voxels"] == PLACES["circle"].sum()
        assert window["voxels"] == window["window_voxels"] == (far < 10).sum()

    def test_a_far_level_is_padding_anywhere(self) -> None:
        levels = np.where((rows - 14) ** 2 + (columns - 14) ** 2 < 100, 1, 0) + 0.05 * np.random.default_rng(0).normal(
            size=slices.shape
        )
        block = (slices < 6) & (rows < 15) & (columns < 15)
        levels[block] = -9999
        found = padding(levels)
        assert found is not None
        np.testing.assert_array_equal(found, block)

    @pytest.mark.parametrize("noise", [0, 5])
    def test_a_background_of_0_is_none(self, noise: int) -> None:
        """Around tissues and bone that were cut out, with noise or without: nothing else is background."""
        rng, far = (
            np.random.default_rng(0),
            np.sqrt((2 * (slices - 5.5)) ** 2 + (rows - 14.5) ** 2 + (columns - 14.5) ** 2),
        )
        levels = np.select([far < 5, far < 11], [200, 100], 0) + (far < 11) * noise * rng.normal(size=slices.shape)
        assert padding(levels) is None
        assert 20 < threshold(levels) < 80

    def test_labels_and_colors_have_none(self) -> None:
        assert padding((columns > 9).astype(np.uint8) + (rows > 9)) is None
        assert padding(np.zeros((3, 4, 5, 3))) is None


class TestStudies:
    """Studies without such faults keep the window that plain Otsu gives them."""

    def test_the_built_in_head(self) -> None:
        voxels = phantom().volume.voxels
        assert padding(voxels) is None
        assert otsu_threshold(voxels) == pytest.approx(75.2, abs=1)

    @pytest.mark.parametrize(
        ("name", "plain"),
        [
            ("derived/dev54_t1/dev54_t1.nii.gz", 57.3),
            ("derived/dev54_synth_t1/dev54_synth_t1.nii.gz", 71.9),
            ("volrender/seg3D/MR.nii.gz", 127.0),
            ("dicom2stl/ct_example.nii.gz", -391.9),
        ],
    )
    def test_shared_heads(self, name: str, plain: float) -> None:
        voxels = read_volume(shared(name)).voxels
        found = otsu_threshold(voxels)
        assert padding(voxels) is None
        assert (voxels > found).sum() == pytest.approx((voxels > plain).sum(), rel=0.005)

    def test_a_head_s_ct_has_padding_of_minus_1500_and_says_so(self) -> None:
        study = read_volume(shared("dcm_qa_ct/In/GE"), settings=ReadSettings(resample_slices=True))
        assert set(study.padding or ()) == {-1500}
        levels = study.voxels[::8]
        found = padding(levels)
        assert found is not None
        np.testing.assert_array_equal(found, levels == -1500)


class TestHeader:
    """A DICOM header names padding, which then is background whatever the window; its level may be any."""

    @pytest.mark.parametrize(
        ("signed", "written", "limit", "scale", "wanted"),
        [
            (1, -2000, None, (1, -1024), (-3024, -3024)),
            (1, 63536, None, (1, -1024), (-3024, -3024)),
            (0, 7, None, (1, 0), (7, 7)),
            (0, 7, 9, (-2, 1), (-17, -13)),
        ],
    )
    def test_its_levels_are_scaled(
        self,
        tmp_path: Path,
        signed: int,
        written: int,
        limit: int | None,
        scale: tuple[int, int],
        wanted: tuple[float, float],
    ) -> None:
        def named(dataset: Dataset, k: int) -> None:
            dataset.PixelRepresentation = signed
            dataset.RescaleSlope, dataset.RescaleIntercept = scale
            dataset.add_new((0x0028, 0x0120), "SS" if signed and written < 0 else "US", written)
            if limit is not None:
                dataset.add_new((0x0028, 0x0121), "US", limit)

        affine = AFFINES["axial"]
        assert read_volume(write_series(tmp_path, sampled(affine), affine, named)).padding == wanted

    def test_it_is_background_also_of_a_window_by_hand(self) -> None:
        levels = np.where((rows - 14) ** 2 + (columns - 14) ** 2 < 100, 40, -900).astype(np.int16)
        levels[PLACES["slab"]] = 30
        study = replace(Volume.from_stored(levels, np.eye(4), unit="HU"), padding=(30, 30))
        for asked in ({"lower": 0.0}, {"preset": "soft-tissue"}, {}):
            found = segment(study, network="none", keep="all", **asked)
            np.testing.assert_array_equal(found.mask, levels == 40)
            window = found.report["window"]
            assert window["padding_voxels"] == window["named_padding_voxels"] == PLACES["slab"].sum()
