"""Windows, thresholds and outlines against scikit-image and SciPy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage
from skimage.filters import threshold_multiotsu, threshold_otsu
from skimage.measure import find_contours
from skimage.segmentation import find_boundaries

from conftest import law, seeds
from tomomesh.errors import EmptyError, UsageError
from tomomesh.measure.polygon import distance
from tomomesh.model.volume import Volume
from tomomesh.segmentation.otsu import histogram, otsu_levels, otsu_threshold
from tomomesh.segmentation.signal import NARROW, closed, fills_most, outline
from tomomesh.segmentation.window import choose_window, window
from tomomesh.settings import WindowSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

TYPES = ["u1", "i1", "u2", "i2", "i4", "f4", "f8"]


@st.composite
def grays(draw: st.DrawFn) -> NDArray[Any]:
    """Draw two tissues with noise, as some type of number."""
    rng, kind = np.random.default_rng(draw(seeds)), draw(st.sampled_from(TYPES))
    dark, bright = np.sort(rng.uniform(10, 110, 2))
    bright += 5
    share = rng.uniform(0.1, 0.9)
    levels = np.where(rng.random((9, 10, 11)) < share, dark, bright) + rng.normal(size=(9, 10, 11)) * 3
    clipped: NDArray[Any] = np.clip(levels, 0, 120).astype(kind)
    return clipped


def volume(levels: NDArray[Any]) -> Volume:
    return Volume.from_stored(levels, np.eye(4))


def between(levels: NDArray[Any], *thresholds: float) -> float:
    """Return the variance between the classes that thresholds make of levels."""
    values = levels.astype(np.float64).ravel()
    classes = [values[np.searchsorted(thresholds, values) == n] for n in range(len(thresholds) + 1)]
    return float(sum(one.size * (one.mean() - values.mean()) ** 2 for one in classes if one.size) / values.size)


class TestOtsu:
    @law(80)
    @given(levels=grays())
    def test_splits_the_classes_as_scikit_image_s(self, levels: NDArray[Any]) -> None:
        """Ours leaves the tails out and goes to the middle of what is empty, so levels may differ; the classes not."""
        wanted = threshold_otsu(np.asarray(levels, np.float64), nbins=256)
        found = otsu_threshold(levels)
        assert between(levels, found) > 0.99 * between(levels, wanted)

    @pytest.mark.parametrize("classes", [3, 4])
    @pytest.mark.parametrize("seed", range(5))
    def test_of_several_classes_is_scikit_image_s(self, classes: int, seed: int) -> None:
        draw = np.random.default_rng(seed)
        levels = np.concatenate([draw.normal(at, draw.uniform(1, 30), 3000) for at in draw.uniform(-500, 500, 4)])
        wanted = threshold_multiotsu(levels, classes, nbins=256)
        assert between(levels, *otsu_levels(levels, classes)) > 0.995 * between(levels, *wanted)

    def test_has_no_more_classes_than_levels(self) -> None:
        assert otsu_levels(np.array([1, 1, 5, 9]), 6) == pytest.approx((3, 7), abs=0.05)

    @law(60)
    @given(levels=grays())
    def test_splits_the_classes_best(self, levels: NDArray[Any]) -> None:
        """Try each threshold, and weigh the classes that it makes."""
        best = max(between(levels, threshold) for threshold in np.unique(levels))
        assert between(levels, otsu_threshold(levels)) > 0.99 * best

    @pytest.mark.parametrize("kind", TYPES)
    def test_of_two_levels_lies_between_them(self, kind: str) -> None:
        levels = np.repeat([3, 100], [70, 30]).astype(kind).reshape(10, 10, 1)
        assert 3 <= otsu_threshold(levels) < 100
        assert window(volume(levels), lower=otsu_threshold(levels)).sum() == 30

    @pytest.mark.parametrize("kind", TYPES)
    def test_of_one_level_is_that_level(self, kind: str) -> None:
        assert otsu_threshold(np.full((3, 3, 3), 7).astype(kind)) == 7


class TestHistogram:
    @law(60)
    @given(levels=grays(), bins=st.integers(1, 300))
    def test_is_numpy_s(self, levels: NDArray[Any], bins: int) -> None:
        low, high = float(levels.min()), float(levels.max())
        wanted = np.histogram(levels.astype(np.float64), bins, (low, high))[0]
        found = histogram(levels, low, high, bins)
        assert found.sum() == levels.size
        if levels.dtype.kind != "f":
            np.testing.assert_array_equal(found, wanted)

    @pytest.mark.parametrize("kind", ["i1", "i2", "u2"])
    def test_takes_the_whole_range_of_a_type(self, kind: str) -> None:
        limits = np.iinfo(kind)
        levels = np.array([limits.min, 0, limits.max, limits.max], kind)
        assert histogram(levels, float(limits.min), float(limits.max), 2).sum() == 4
        assert histogram(levels, float(limits.min), float(limits.max), 2)[-1] >= 2

    def test_a_few_far_levels_change_little(self) -> None:
        rng = np.random.default_rng(0)
        levels = np.concatenate([rng.normal(10, 2, 60_000), rng.normal(60, 5, 40_000)])
        alone = otsu_threshold(levels)
        assert otsu_threshold(np.append(levels, [1e30, -1e20, np.nan, np.inf])) == pytest.approx(alone, abs=3)


class TestWindow:
    @law(80)
    @given(levels=grays(), limits=st.tuples(st.integers(-5, 130), st.integers(0, 60)))
    def test_keeps_what_lies_over_the_lower_and_up_to_the_upper(
        self, levels: NDArray[Any], limits: tuple[int, int]
    ) -> None:
        lower, upper = float(limits[0]), float(sum(limits))
        wanted = np.array([lower < float(k) <= upper for k in levels.ravel()]).reshape(levels.shape)
        if wanted.any():
            np.testing.assert_array_equal(window(volume(levels), lower=lower, upper=upper), wanted)
        else:
            with pytest.raises(EmptyError if lower < upper else UsageError):
                window(volume(levels), lower=lower, upper=upper)

    def test_keeps_a_voxel_of_level_zero(self) -> None:
        assert window(volume(np.zeros((2, 2, 2), np.int16)), lower=-1).all()

    def test_wants_every_layer_of_a_color_in_it(self) -> None:
        color = np.stack([np.full((2, 2, 2), 9), np.arange(8).reshape(2, 2, 2)], axis=-1)
        np.testing.assert_array_equal(window(volume(color), lower=3), color[..., 1] > 3)

    @pytest.mark.parametrize(("preset", "lower"), [("bone", 300.0), ("skin", -300.0)])
    def test_presets_are_hounsfield_units(self, preset: str, lower: float) -> None:
        asked = WindowSettings(preset=preset)
        air = np.full((2, 2, 2), -1000, np.int16)
        assert choose_window(volume(air), asked) == (lower, np.inf)
        with pytest.raises(UsageError, match="Hounsfield"):
            choose_window(volume(air + 2000), asked)

    def test_is_otsu_s_only_where_nothing_is_asked_for(self) -> None:
        levels = np.repeat([3, 100], [70, 30]).reshape(10, 10, 1)
        assert choose_window(volume(levels), WindowSettings()) == (otsu_threshold(levels), np.inf)
        assert choose_window(volume(levels), WindowSettings(upper=50.0)) == (-np.inf, 50.0)
        assert choose_window(volume(levels), WindowSettings(lower=50.0)) == (50.0, np.inf)


class TestOutline:
    @law(100)
    @given(seed=seeds, share=st.floats(0.2, 0.95))
    def test_of_a_small_window_is_both_sides_of_its_border_without_its_holes(self, seed: int, share: float) -> None:
        plane = np.random.default_rng(seed).random((12, 15)) < share
        plane[5, 5] = True
        filled = np.pad(ndimage.binary_fill_holes(plane), 2)
        wanted = np.argwhere(find_boundaries(filled, connectivity=1, mode="thick"))[:, ::-1] - 2
        np.testing.assert_array_equal(outline(plane), wanted)

    @law(40)
    @given(seed=seeds, rows=st.integers(1, 150), columns=st.integers(1, 150), share=st.floats(0.02, 0.98))
    def test_a_plane_is_closed_as_scipy_dilates_and_labels_it(
        self, seed: int, rows: int, columns: int, share: float
    ) -> None:
        """Rows of less and of more than a word of bits; windows with and without openings."""
        rng = np.random.default_rng(seed)
        rough = np.abs(ndimage.gaussian_filter(rng.normal(size=(rows, columns)), rng.uniform(0.2, 6)))
        plane = rough <= np.quantile(rough, share)
        reach = round(NARROW / 2 * float(np.sqrt(np.count_nonzero(plane))))
        octagon = [ndimage.generate_binary_structure(2, 1 + step % 2) for step in range(reach)]
        framed = np.pad(plane, reach + 1)
        grown = framed
        for structure in octagon:
            grown = ndimage.binary_dilation(grown, structure)
        pieces, _ = ndimage.label(~grown)
        outside = around = pieces == pieces[0, 0]
        for structure in octagon:
            around = ndimage.binary_dilation(around, structure)
        filled, hollow, margin = closed(plane)
        assert margin == reach + 1
        np.testing.assert_array_equal(filled, framed | ~around)
        np.testing.assert_array_equal(hollow, ~grown & ~outside)

    @pytest.mark.parametrize("opening", [0, 2])
    def test_of_a_wall_is_its_outside_also_where_a_narrow_opening_leads_in(self, opening: int) -> None:
        row, column = np.mgrid[:120, :120] - 59.5
        far = np.hypot(row, column)
        wall = (np.abs(far - 40) < 5) & ~((np.abs(column) < opening / 2 + 0.1) & (row < 0))
        x, y = (outline(wall) - 59.5).T
        away = (np.abs(x) > 6) | (y > 0)
        assert (np.abs(np.hypot(x, y)[away] - 45) < 2).all()
        assert (np.hypot(x, y) > 38).all()

    def test_of_a_wall_with_a_wide_opening_is_both_of_its_sides(self) -> None:
        row, column = np.mgrid[:120, :120] - 59.5
        wall = (np.abs(np.hypot(row, column) - 40) < 5) & ~((np.abs(column) < 20) & (row < 0))
        assert (np.hypot(*(outline(wall) - 59.5).T) < 37).any()

    def test_has_scikit_image_s_contour_in_its_middle(self) -> None:
        row, column = np.mgrid[:60, :60] - 29.5
        disc = np.hypot(row / 20, column / 26) < 1
        contour = np.ascontiguousarray(find_contours(disc.astype(float), 0.5)[0][:, ::-1])
        pixels = outline(disc).astype(int)
        assert distance(contour, np.ascontiguousarray(pixels, dtype=float)).max() <= 0.5 + 1e-9
        inner = disc[pixels[:, 1], pixels[:, 0]]
        assert 0.9 < inner.sum() / (~inner).sum() < 1


class TestSolid:
    def test_is_told_from_a_wall(self) -> None:
        row, column = np.mgrid[:64, :64] - 31.5
        far = np.hypot(row, column)
        assert fills_most((far < 25)[None])
        assert not fills_most(((far < 25) & (far > 20))[None])
        assert not fills_most(np.zeros((2, 5, 5), bool))
