"""Stored DICOM numbers to gray levels and colors: tables, palettes, places of the bits, floats."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pydicom.dataset import Dataset
from pydicom.sequence import Sequence
from pydicom.uid import ExplicitVRBigEndian, ImplicitVRLittleEndian, RLELossless

from studies import AFFINES, as_ct, save, set_pixels, slice_dataset, write_series
from tomomesh.cli import main
from tomomesh.errors import FormatError
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

AXIAL = AFFINES["axial"]
ONE = ReadSettings(spacing_z=1)
RAMP = np.arange(48, dtype=np.uint8).reshape(6, 8)


def one(pixels: NDArray[Any], **fields: Any) -> Dataset:
    data = slice_dataset(pixels, AXIAL, 0)
    for keyword, value in fields.items():
        setattr(data, keyword, value)
    return data


def read(data: Dataset, folder: Path, **writing: Any) -> NDArray[Any]:
    path = folder / "one.dcm"
    data.save_as(path, enforce_file_format=True, **writing)
    return np.asarray(read_volume(path, settings=ONE).voxels[0])


def with_table(data: Dataset, first: int, entries: list[int], bits: int = 16) -> Dataset:
    item = Dataset()
    item.add_new("LUTDescriptor", "SS" if first < 0 else "US", [len(entries), first, bits])
    item.ModalityLUTType = "HU"
    item.add_new("LUTData", "US", entries)
    data.ModalityLUTSequence = Sequence([item])
    return data


def with_palette(data: Dataset, bits: int, first: int = 0, count: int = 32) -> tuple[Dataset, NDArray[Any]]:
    """Give indices a palette; return it, (entries, 3)."""
    kind = np.uint8 if bits == 8 else np.uint16
    palette = (np.arange(3 * count).reshape(count, 3) * 7 % 251 * (1 if bits == 8 else 257)).astype(kind)
    data.PhotometricInterpretation = "PALETTE COLOR"
    for layer, color in enumerate(("Red", "Green", "Blue")):
        setattr(data, f"{color}PaletteColorLookupTableDescriptor", [count, first, bits])
        setattr(data, f"{color}PaletteColorLookupTableData", palette[:, layer].tobytes())
    return data, palette


class TestTables:
    @pytest.mark.parametrize("bits", [8, 12, 16])
    def test_gray_levels_go_through_the_modality_table(self, tmp_path: Path, bits: int) -> None:
        """What lies before and beyond the table gets its first and its last entry."""
        entries = [200 - 3 * n for n in range(30)]
        found = read(with_table(one(RAMP), 10, entries, bits), tmp_path)
        np.testing.assert_array_equal(found, np.take(entries, RAMP.astype(int) - 10, mode="clip"))

    def test_a_table_may_begin_below_zero(self, tmp_path: Path) -> None:
        stored = RAMP.astype(np.int16) - 20
        entries = [7 * n for n in range(48)]
        found = read(with_table(one(stored), -20, entries), tmp_path)
        np.testing.assert_array_equal(found, 7 * RAMP.astype(int))

    def test_a_table_of_an_inverted_image_is_inverted_after_it(self, tmp_path: Path) -> None:
        data = with_table(one(RAMP, PhotometricInterpretation="MONOCHROME1"), 0, [n * n for n in range(48)])
        found = read(data, tmp_path).astype(int)
        np.testing.assert_array_equal(found, 2**16 - 1 - RAMP.astype(int) ** 2)

    def test_a_table_beside_a_scale_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(FormatError, match="both a table and a scale"):
            read(with_table(one(RAMP, RescaleSlope=2, RescaleIntercept=1), 0, [1, 2]), tmp_path)

    @pytest.mark.parametrize(("promised", "bits"), [(99, 16), (30, 7), (30, 33)])
    def test_a_broken_table_is_refused(self, tmp_path: Path, promised: int, bits: int) -> None:
        data = with_table(one(RAMP), 0, list(range(30)))
        data.ModalityLUTSequence[0].LUTDescriptor = [promised, 0, bits]
        with pytest.raises(FormatError, match="table of the gray levels is broken"):
            read(data, tmp_path)


class TestPalettes:
    @pytest.mark.parametrize("bits", [8, 16])
    @pytest.mark.parametrize("first", [0, 5])
    def test_indices_become_colors(self, tmp_path: Path, bits: int, first: int) -> None:
        data, palette = with_palette(one(RAMP), bits, first)
        found = read(data, tmp_path)
        np.testing.assert_array_equal(found, palette[np.clip(RAMP.astype(int) - first, 0, 31)])
        assert found.dtype == palette.dtype

    def test_compressed_indices_become_colors_too(self, tmp_path: Path) -> None:
        data, palette = with_palette(one(RAMP), 8)
        data.compress(RLELossless, generate_instance_uid=False)
        np.testing.assert_array_equal(read(data, tmp_path), palette[np.minimum(RAMP, 31)])

    def test_palettes_that_are_not_applied_are_refused(self, tmp_path: Path) -> None:
        supplemental, _ = with_palette(one(RAMP), 8)
        supplemental.PhotometricInterpretation, supplemental.PixelPresentation = "MONOCHROME2", "COLOR"
        segmented, _ = with_palette(one(RAMP), 8)
        segmented.SegmentedRedPaletteColorLookupTableData = b"\0\1\2\3"
        missing, _ = with_palette(one(RAMP), 8)
        del missing.GreenPaletteColorLookupTableData
        for data, word in ((supplemental, "supplemental"), (segmented, "segments"), (missing, "missing")):
            with pytest.raises(FormatError, match=word):
                read(data, tmp_path)

    def test_the_command_line_refuses_in_one_line(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        path = save(one(RAMP, PhotometricInterpretation="PALETTE COLOR"), tmp_path / "a.dcm")
        assert main(["inspect", str(path), "--spacing-z", "1"]) == 4
        assert capsys.readouterr().err.count("\n") == 1


class TestColors:
    def test_color_differences_become_rgb(self, tmp_path: Path) -> None:
        pixels = np.empty((4, 6, 3), np.uint8)
        pixels[:] = (76, 85, 255)  # pure red
        found = read(one(pixels, PhotometricInterpretation="YBR_FULL"), tmp_path).astype(int)
        assert np.abs(found - (254, 0, 0)).max() <= 1

    def test_planes_of_color_are_read(self, tmp_path: Path) -> None:
        pixels = np.random.default_rng(2).integers(0, 256, (4, 6, 3)).astype(np.uint8)
        data = one(pixels, PlanarConfiguration=1)
        data.PixelData = np.moveaxis(pixels, -1, 0).tobytes()
        np.testing.assert_array_equal(read(data, tmp_path), pixels)

    @pytest.mark.parametrize("kind", ["HSV", "CMYK", "YBR_RCT", "MONOCHROME2"])
    def test_other_kinds_of_three_layers_are_refused(self, tmp_path: Path, kind: str) -> None:
        with pytest.raises(FormatError, match=f"{kind}|pydicom"):
            read(one(np.zeros((4, 6, 3), np.uint8), PhotometricInterpretation=kind), tmp_path)


class TestNumbers:
    @pytest.mark.parametrize("kind", [np.float32, np.float64])
    def test_real_numbers_are_kept(self, tmp_path: Path, kind: type) -> None:
        pixels: NDArray[Any] = (RAMP / 7 - 2).astype(kind)
        data = one(RAMP)
        for keyword in ("PixelData", "BitsStored", "HighBit", "PixelRepresentation"):
            delattr(data, keyword)
        data.BitsAllocated = 8 * pixels.itemsize
        setattr(data, "FloatPixelData" if kind is np.float32 else "DoubleFloatPixelData", pixels.tobytes())
        found = read(data, tmp_path)
        np.testing.assert_array_equal(found, pixels)
        assert found.dtype == kind

    @pytest.mark.parametrize("signed", [False, True])
    def test_numbers_in_the_upper_bits_are_moved_down(self, tmp_path: Path, signed: bool) -> None:
        expected = RAMP.astype(np.int16) * 40 - (900 if signed else 0)
        stored = expected << 4 | 5
        data = one(stored if signed else stored.astype(np.uint16), BitsStored=12, HighBit=15)
        np.testing.assert_array_equal(read(data, tmp_path), expected)

    @pytest.mark.parametrize("field", ["BitsAllocated", "BitsStored", "HighBit", "SamplesPerPixel"])
    @pytest.mark.parametrize("value", [0, 77])
    def test_bits_that_cannot_be_are_named(self, tmp_path: Path, field: str, value: int) -> None:
        with pytest.raises(FormatError, match=rf"{field} = {value}\].*Expected"):
            read(one(RAMP.astype(np.uint16), **{field: value}), tmp_path)

    @pytest.mark.parametrize("kind", ["u1", "i2", "u4"])
    def test_every_order_of_bytes_is_read(self, tmp_path: Path, kind: str) -> None:
        pixels: NDArray[Any] = (RAMP * 3).astype(kind)
        data = one(pixels)
        data.PixelData = pixels.astype(pixels.dtype.newbyteorder(">")).tobytes()
        data.file_meta.TransferSyntaxUID = ExplicitVRBigEndian
        data["PixelData"].VR = "OB" if kind == "u1" else "OW"
        np.testing.assert_array_equal(read(data, tmp_path, implicit_vr=False, little_endian=False), pixels)
        data = one(pixels)
        data.file_meta.TransferSyntaxUID = ImplicitVRLittleEndian
        np.testing.assert_array_equal(read(data, tmp_path, implicit_vr=True, little_endian=True), pixels)

    def test_packed_bits_are_unpacked(self, tmp_path: Path) -> None:
        frames = np.random.default_rng(4).integers(0, 2, (3, 5, 7)).astype(np.uint8)
        data = one(frames[0], NumberOfFrames=3, BitsAllocated=1, BitsStored=1, HighBit=0)
        packed = np.packbits(frames.ravel(), bitorder="little").tobytes()
        data.PixelData = packed + b"\0" * (len(packed) % 2)
        path = save(data, tmp_path / "bits.dcm")
        np.testing.assert_array_equal(read_volume(path, settings=ONE).voxels, frames)

    def test_an_inverted_float_is_turned_alike_on_all_slices(self, tmp_path: Path) -> None:
        stored = np.stack([RAMP * (k + 1) for k in range(3)]).astype(np.float32)

        def edit(data: Dataset, k: int) -> None:
            set_pixels(data, stored[k])
            data.FloatPixelData = stored[k].tobytes()
            data.PhotometricInterpretation = "MONOCHROME1"
            del data.PixelData

        volume = read_volume(write_series(tmp_path / "s", stored, AXIAL, edit))
        np.testing.assert_array_equal(volume.voxels, -stored)

    def test_real_world_values_change_nothing(self, tmp_path: Path) -> None:
        data = one(RAMP)
        as_ct(data, 0)
        item = Dataset()
        item.RealWorldValueSlope, item.RealWorldValueIntercept = 5.0, 1.0
        data.RealWorldValueMappingSequence = Sequence([item])
        np.testing.assert_array_equal(read(data, tmp_path), RAMP)
