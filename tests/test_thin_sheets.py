"""Sheets thinner than a slice: found where voxels hold one of two levels, or what is of both."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import law, seeds
from tomomesh import Volume, reconstruct
from tomomesh.isosurface.crossings import Levels
from tomomesh.isosurface.parts import smooth_parts
from tomomesh.isosurface.thick_slices import thinned

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.isosurface.thick_slices import Thinned

    Floats = NDArray[np.float64]
    Mask = NDArray[np.bool_]

THICK = 4
AFFINE = np.diag([1.0, 1.0, THICK, 1.0])


def averaged(thin: NDArray[np.bool_] | Floats) -> Floats:
    """Average every four slices."""
    return np.asarray(thin.reshape(-1, THICK, *thin.shape[1:]).mean(axis=1), np.float64)


def table(place: int, thickness: int = 1, tilt: float = 0.0) -> Mask:
    """Return a plate on four legs, thinner than a slice, on thin voxels."""
    z, y, x = np.indices((40, 32, 32))
    within = (abs(y - 15.5) < 11) & (abs(x - 15.5) < 11)
    low = place + np.floor(tilt * (x - 4))
    legs = (abs(abs(y - 15.5) - 8) < 3) & (abs(abs(x - 15.5) - 8) < 3) & (z >= 6) & (z < low + thickness)
    return np.asarray((within & (z >= low) & (z < low + thickness)) | legs)


def found(levels: Floats, lower: float = 0.5, upper: float = np.inf, keep: Mask | None = None) -> Thinned:
    """Divide the voxels of a window, those of it that are kept alone."""
    mask = (levels > lower) & (levels <= upper)
    made = thinned(Levels(levels, lower, upper), mask if keep is None else mask & keep, AFFINE)
    assert made is not None
    return made


class TestParts:
    @law(30)
    @given(seed=seeds, slices=st.integers(1, 12), times=st.integers(2, 7))
    def test_they_keep_the_average_and_a_mirrored_stack_has_mirrored_ones(
        self, seed: int, slices: int, times: int
    ) -> None:
        whole = np.random.default_rng(seed).random((slices, 2, 2), np.float32)
        columns = np.ascontiguousarray(np.argwhere(whole >= 0), np.int32)
        parts = smooth_parts(whole, columns, times)
        assert np.allclose(parts.mean(axis=1), whole.ravel(), atol=1e-5)
        mirrored = smooth_parts(whole[::-1].copy(), columns, times).reshape(slices, 2, 2, times)[::-1, ..., ::-1]
        assert np.allclose(mirrored.reshape(-1, times), parts, atol=1e-5)

    @law(30)
    @given(seed=seeds, times=st.integers(2, 7))
    def test_of_a_parabola_they_are_exact(self, seed: int, times: int) -> None:
        sums = np.polynomial.Polynomial(np.random.default_rng(seed).normal(size=3)).integ()
        borders = np.arange(9 * times + 1) / times - 4.5
        exact = np.diff(sums(borders)) * times
        whole = exact.reshape(9, times).mean(axis=1).astype(np.float32)[:, None, None]
        parts = smooth_parts(whole, np.array([[4, 0, 0]], np.int32), times)
        assert np.allclose(parts[0], exact[4 * times : 5 * times], atol=1e-4 * (1 + np.abs(whole).max()))

    def test_what_is_not_known_far_away_tells_nothing(self) -> None:
        whole = np.ones((9, 1, 1), np.float32)
        whole[0], whole[8] = np.nan, np.inf
        assert np.allclose(smooth_parts(whole, np.array([[4, 0, 0]], np.int32), 4), 1)


class TestSheets:
    @pytest.mark.parametrize("place", [20, 21, 22, 23])
    def test_a_sheet_of_a_quarter_of_a_slice_is_found_in_its_slice(self, place: int) -> None:
        levels = averaged(table(place))
        assert not (levels[:, 12:20, 12:20] > 0.5).any()
        parts = found(levels).mask[:, 12:20, 12:20]
        assert (parts.sum(axis=0) >= 1).all()
        heights = np.argwhere(parts)[:, 0]
        assert (heights >= 20).all()
        assert (heights < 24).all()

    def test_one_that_slants_is_found_too(self) -> None:
        inside = table(16, 2, tilt=0.4)
        plate = np.s_[:, 12:20, 12:20]
        parts = found(averaged(inside)).mask[plate]
        assert (parts == inside[plate]).mean() > 0.94
        assert (parts.sum(axis=0) >= 1).all()

    @law(10)
    @given(scale=st.sampled_from([0.5, 7.0, 1000.0]), offset=st.sampled_from([-1024.0, 0.0, 3.0]), dark=st.booleans())
    def test_whatever_the_two_levels_are(self, scale: float, offset: float, dark: bool) -> None:
        levels = averaged(table(21))
        bound = offset + 0.5 * scale
        if dark:
            other = found(offset + scale * (1 - levels), -np.inf, bound - 1e-3 * scale)
        else:
            other = found(offset + scale * levels, bound)
        assert (other.mask == found(levels).mask).mean() > 0.999

    def test_noise_of_more_than_two_levels_finds_no_sheet(self) -> None:
        levels = averaged(table(21)) + np.random.default_rng(3).normal(0, 0.05, (10, 32, 32))
        parts = found(levels).mask[:, 12:20, 12:20]
        assert parts.sum() < 8

    def test_a_third_level_is_no_mixture(self) -> None:
        tissue = np.where(table(21), 1.0, 0.0)
        tissue[24:, :, 16:][~table(21)[24:, :, 16:]] = 0.4
        levels = averaged(tissue)
        above = found(levels).mask[28:, 12:20, 20:28]
        assert not above.any()

    def test_what_was_left_out_keeps_no_rim(self) -> None:
        inside = np.concatenate([table(21), table(21)], axis=2)
        levels = averaged(inside)
        keep = np.broadcast_to(np.arange(64) < 32, levels.shape)
        one, both = found(levels, keep=keep).mask, found(levels).mask
        assert not one[:, :, 32:].any()
        assert (one[:, :, :32] == both[:, :, :32]).all()
        assert both[:, 12:20, 44:52].any()

    def test_what_hangs_together_with_nothing_kept_is_no_sheet(self) -> None:
        levels = averaged(table(21))
        levels[0, :3, :3] = 0.4
        assert ndimage.label(found(levels).mask, np.ones((3, 3, 3)))[1] == 1

    @pytest.mark.parametrize("thickness", [1, 2, 3])
    def test_the_surface_holds_the_sheet(self, thickness: int) -> None:
        inside = table(21, thickness)
        volume = Volume.from_stored(averaged(inside), AFFINE)
        made = reconstruct(volume, lower=0.5, way="voxels")
        assert float(made.mesh.face_volumes.sum()) == pytest.approx(inside.sum(), rel=0.05)
        assert made.report["quality"]["components"] == 1
        assert made.report["quality"]["self_intersections"] == 0
