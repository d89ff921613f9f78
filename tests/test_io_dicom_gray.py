"""Gray levels of DICOM: scales, signs, overlays, colors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pydicom
import pytest

from studies import AFFINES, as_ct, assert_in_place, sampled, set_pixels, setting, write_series
from tomomesh.errors import FormatError
from tomomesh.io import read_volume

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from pydicom.dataset import Dataset

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)


class TestGrayLevels:
    def test_the_scale_of_each_slice_is_its_own(self, tmp_path: Path) -> None:
        def edit(data: Dataset, k: int) -> None:
            data.RescaleSlope, data.RescaleIntercept = k + 1, -10 * k
            set_pixels(data, np.rint((STORED[k] + 10.0 * k) / (k + 1)).astype(np.int16))

        volume = read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))
        assert_in_place(volume, 3.1)
        assert volume.voxels.dtype.kind == "i"

    def test_hounsfield_units_stay_integers(self, tmp_path: Path) -> None:
        def edit(data: Dataset, k: int) -> None:
            as_ct(data, k)
            set_pixels(data, (STORED[k] + 1024).astype(np.uint16))
            data.BitsStored, data.HighBit = 12, 11
            data.RescaleSlope, data.RescaleIntercept = 1, -1024

        volume = read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))
        assert volume.unit == "HU"
        np.testing.assert_array_equal(volume.voxels, STORED)
        assert volume.voxels.dtype == np.int16

    @pytest.mark.parametrize(("slope", "intercept"), [("0", "1"), ("nan", "0"), ("inf", "0"), ("1", "nan")])
    def test_an_invalid_scale_is_refused(self, tmp_path: Path, slope: str, intercept: str) -> None:
        def edit(data: Dataset, k: int) -> None:
            data.RescaleIntercept = intercept
            data.RescaleSlope = slope

        with pydicom.config.disable_value_validation(), pytest.raises(FormatError, match="slope"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))

    @pytest.mark.parametrize("kind", [np.int16, np.uint16, np.uint8])
    def test_monochrome1_is_inverted(self, tmp_path: Path, kind: type) -> None:
        stored: NDArray[Any] = (STORED % 200).astype(kind)

        def edit(data: Dataset, k: int) -> None:
            data.PhotometricInterpretation = "MONOCHROME1"

        volume = read_volume(write_series(tmp_path / "s", stored, AXIAL, edit))
        turned = volume.voxels.astype(np.int64)
        assert len(set((turned + stored).ravel().tolist())) == 1
        assert "inverted" in volume.notes[-1]

    def test_signed_twelve_bits_keep_their_sign(self, tmp_path: Path) -> None:
        signed = (STORED - 2000).astype(np.int16)

        def edit(data: Dataset, k: int) -> None:
            set_pixels(data, signed[k] & np.int16(0x0FFF))
            data.BitsStored, data.HighBit, data.PixelRepresentation = 12, 11, 1

        np.testing.assert_array_equal(read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit)).voxels, signed)

    def test_overlay_bits_are_masked(self, tmp_path: Path) -> None:
        def edit(data: Dataset, k: int) -> None:
            set_pixels(data, STORED[k].astype(np.uint16) | np.uint16(0x8000 * (k % 2)))
            data.BitsStored, data.HighBit = 12, 11
            data.add_new(0x60000102, "US", 15)

        np.testing.assert_array_equal(read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit)).voxels, STORED)

    def test_signed_numbers_called_unsigned_are_refused(self, tmp_path: Path) -> None:
        def edit(data: Dataset, k: int) -> None:
            set_pixels(data, (STORED[k] - 2000).astype(np.int16).view(np.uint16))
            data.BitsStored, data.HighBit = 12, 11

        with pytest.raises(FormatError, match="PixelRepresentation = 1"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))

    def test_color_has_three_channels(self, tmp_path: Path) -> None:
        colors = np.stack([STORED % 251, STORED % 7, STORED % 13], axis=-1).astype(np.uint8)
        volume = read_volume(write_series(tmp_path / "s", colors, AXIAL))
        np.testing.assert_array_equal(volume.voxels, colors)

    def test_palette_color_without_a_palette_is_refused(self, tmp_path: Path) -> None:
        write_series(tmp_path / "s", STORED, AXIAL, setting(PhotometricInterpretation="PALETTE COLOR"))
        with pytest.raises(FormatError, match="PALETTE COLOR"):
            read_volume(tmp_path / "s")
