"""Compressed DICOM pixels: what was stored is what is read, in every compression and kind of number."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import imagecodecs
import numpy as np
import pytest
import SimpleITK
from pydicom.encaps import encapsulate
from pydicom.uid import (
    HTJ2K,
    HTJ2KLossless,
    JPEG2000Lossless,
    JPEGBaseline8Bit,
    JPEGExtended12Bit,
    JPEGLosslessSV1,
    JPEGLSLossless,
    RLELossless,
)

from studies import AFFINES, save, shared, slice_dataset, write_series
from tomomesh.cli import main
from tomomesh.errors import FormatError
from tomomesh.io import read_volume
from tomomesh.io.dicom.pixels import decoding
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray
    from pydicom import Dataset

AXIAL = AFFINES["axial"]
ONE = ReadSettings(spacing_z=1)

GDCM = pytest.importorskip("gdcm", reason="python-gdcm is not installed")
LOSSLESS: dict[str, tuple[str, Callable[..., Any], dict[str, Any]]] = {
    "JPEG lossless": (JPEGLosslessSV1, imagecodecs.ljpeg_encode, {}),
    "JPEG-LS": (JPEGLSLossless, imagecodecs.jpegls_encode, {}),
    "JPEG-2000": (JPEG2000Lossless, imagecodecs.jpeg2k_encode, {"reversible": True, "level": 0, "codecformat": "j2k"}),
    "HTJ2K": (HTJ2KLossless, imagecodecs.htj2k_encode, {"reversible": True}),
}
"""Compressions without loss, and an encoder that tomomesh does not use."""


def encoded(name: str, pixels: NDArray[Any]) -> bytes:
    _, encode, options = LOSSLESS[name]
    return bytes(encode(pixels, **options))


def pattern(kind: str, bits: int, signed: bool = False) -> NDArray[Any]:
    """Return pixels (40, 36) of all bits, with a smooth part and noise."""
    rng = np.random.default_rng(bits)
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1)) if signed else (0, 2**bits)
    pixels = rng.integers(low, high, (40, 36))
    pixels[9:24] = np.linspace(low, high - 1, 540).astype(np.int64).reshape(15, 36)
    return pixels.astype(kind)


def compressed(pixels: NDArray[Any], syntax: str, codes: list[bytes], bits: int) -> Dataset:
    """Return a dataset of pixels whose frames have been compressed by somebody else."""
    data = slice_dataset(pixels, AXIAL, 0)
    data.BitsStored, data.HighBit = bits, bits - 1
    data.file_meta.TransferSyntaxUID = syntax
    data.PixelData = encapsulate(codes)
    data["PixelData"].VR, data["PixelData"].is_undefined_length = "OB", True
    return data


def read(data: Dataset, folder: Path) -> NDArray[Any]:
    return np.asarray(read_volume(save(data, folder / "one.dcm"), settings=ONE).voxels[0])


class TestWithoutLoss:
    @pytest.mark.parametrize(("kind", "bits"), [("u1", 8), ("u2", 12), ("u2", 16)])
    @pytest.mark.parametrize("name", LOSSLESS)
    def test_unsigned_numbers_are_kept(self, tmp_path: Path, name: str, kind: str, bits: int) -> None:
        pixels = pattern(kind, bits)
        data = compressed(pixels, LOSSLESS[name][0], [encoded(name, pixels)], bits)
        np.testing.assert_array_equal(read(data, tmp_path), pixels)

    @pytest.mark.parametrize("bits", [12, 16])
    @pytest.mark.parametrize("syntax", [JPEG2000Lossless, JPEGLSLossless, RLELossless])
    def test_signed_numbers_are_kept(self, tmp_path: Path, syntax: str, bits: int) -> None:
        pixels = pattern("i2", bits, signed=True)
        data = slice_dataset(pixels, AXIAL, 0)
        data.BitsStored, data.HighBit = bits, bits - 1
        data.compress(syntax, generate_instance_uid=False)
        np.testing.assert_array_equal(read(data, tmp_path), pixels)

    @pytest.mark.parametrize("kind", ["u1", "u2"])
    @pytest.mark.parametrize("syntax", [JPEG2000Lossless, JPEGLSLossless, RLELossless])
    def test_color_is_kept(self, tmp_path: Path, syntax: str, kind: str) -> None:
        pixels = np.random.default_rng(1).integers(0, np.iinfo(kind).max, (40, 36, 3)).astype(kind)
        data = slice_dataset(pixels, AXIAL, 0)
        data.compress(syntax, generate_instance_uid=False)
        np.testing.assert_array_equal(read(data, tmp_path), pixels)

    def test_a_frame_in_several_fragments_is_one(self, tmp_path: Path) -> None:
        pixels = pattern("u2", 16)
        code = encoded("JPEG-LS", pixels)
        data = compressed(pixels, JPEGLSLossless, [code], 16)
        data.PixelData = encapsulate([code], fragments_per_frame=3)
        np.testing.assert_array_equal(read(data, tmp_path), pixels)

    @pytest.mark.parametrize("table", [True, False])
    def test_frames_of_one_file_come_in_their_order(self, tmp_path: Path, table: bool) -> None:
        frames = np.stack([pattern("u2", bits) for bits in (9, 12, 16)])
        data = compressed(frames[0], JPEGLSLossless, [], 16)
        data.NumberOfFrames = 3
        data.PixelData = encapsulate([encoded("JPEG-LS", one) for one in frames], has_bot=table)
        path = save(data, tmp_path / "many.dcm")
        np.testing.assert_array_equal(read_volume(path, settings=ONE).voxels, frames)

    def test_a_series_is_read_by_one_child(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        from tomomesh.io.dicom.pixels import child

        started: list[int] = []
        start = child._started

        def counted(size: int) -> Any:
            started.append(size)
            return start(size)

        monkeypatch.setattr(child, "_started", counted)
        stored = np.stack([pattern("u2", 12) + k for k in range(4)]).astype(np.uint16)

        def edit(data: Dataset, k: int) -> None:
            data.compress(JPEGLSLossless, generate_instance_uid=False)

        volume = read_volume(write_series(tmp_path / "s", stored, AXIAL, edit))
        np.testing.assert_array_equal(volume.voxels, stored)
        assert started == [stored[0].nbytes]


class TestWithLoss:
    def test_twelve_bits_of_extended_jpeg_are_decoded(self, tmp_path: Path) -> None:
        pixels = (2000 + 900 * np.sin(np.indices((64, 48)).sum(axis=0) / 9)).astype(np.uint16)
        code = bytes(imagecodecs.jpeg8_encode(pixels, level=95, bitspersample=12))
        found = read(compressed(pixels, JPEGExtended12Bit, [code], 12), tmp_path)
        np.testing.assert_array_equal(found, imagecodecs.jpeg8_decode(code))
        assert np.abs(found.astype(int) - pixels).max() < 60

    def test_eight_bits_of_baseline_jpeg_are_decoded(self, tmp_path: Path) -> None:
        pixels = (128 + 90 * np.sin(np.indices((64, 48)).sum(axis=0) / 9)).astype(np.uint8)
        code = bytes(imagecodecs.jpeg8_encode(pixels, level=95))
        found = read(compressed(pixels, JPEGBaseline8Bit, [code], 8), tmp_path).astype(int)
        assert np.abs(found - imagecodecs.jpeg8_decode(code)).max() <= 1
        assert np.abs(found - pixels).max() < 8

    def test_the_colors_of_baseline_jpeg_become_rgb(self, tmp_path: Path) -> None:
        pixels = np.zeros((32, 48, 3), np.uint8)
        pixels[:, :16], pixels[:, 16:32], pixels[:, 32:] = (250, 20, 10), (20, 240, 30), (10, 20, 230)
        data = compressed(pixels, JPEGBaseline8Bit, [bytes(imagecodecs.jpeg8_encode(pixels, level=100))], 8)
        data.PhotometricInterpretation = "YBR_FULL_422"
        found = read(data, tmp_path).astype(int)
        for column in (4, 24, 44):
            assert np.abs(found[:, column] - pixels[:, column]).max() < 12

    def test_htj2k_with_loss_is_decoded(self, tmp_path: Path) -> None:
        pixels = pattern("u2", 16) // 2
        code = bytes(imagecodecs.htj2k_encode(pixels, level=0.001, reversible=False))
        found = read(compressed(pixels, HTJ2K, [code], 16), tmp_path).astype(int)
        assert np.abs(found - imagecodecs.htj2k_decode(code)).max() <= 1


class TestWhatIsMissing:
    def test_the_extra_is_named(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """A decoder without the packages of the extra, seen through the command line."""
        lone = tmp_path / "lone.py"
        lone.write_text(
            "import runpy, sys\n"
            "sys.modules.update(dict.fromkeys(['gdcm', 'pylibjpeg', 'openjpeg', 'jpeg_ls']))\n"
            f"runpy.run_path({decoding.__file__!r}, run_name='__main__')\n"
        )
        monkeypatch.setattr("tomomesh.io.dicom.pixels.child.PROGRAM", str(lone))
        pixels = pattern("u2", 16)
        path = save(compressed(pixels, JPEGLSLossless, [encoded("JPEG-LS", pixels)], 16), tmp_path / "p" / "a.dcm")
        with pytest.raises(FormatError, match=r'JPEG-LS Lossless.*pip install "tomomesh\[dicom\]"'):
            read_volume(path, settings=ONE)
        for one in (pixels, pattern("i2", 16, signed=True), pattern("i2", 12, signed=True)):  # Pillow is there
            data = slice_dataset(one, AXIAL, 0)
            data.compress(JPEG2000Lossless, generate_instance_uid=False)
            np.testing.assert_array_equal(read(data, tmp_path / "q"), one)

    def test_films_are_refused(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        data = compressed(pattern("u1", 8), "1.2.840.10008.1.2.4.100", [b"\0\0\1\xb3" + bytes(60)], 8)
        path = save(data, tmp_path / "film.dcm")
        assert main(["inspect", str(path), "--spacing-z", "1"]) == 4
        assert "MPEG2" in capsys.readouterr().err


class TestSamples:
    @pytest.mark.parametrize(
        "name",
        [
            "dicom2nifti/generic/compressed_rle/001",
            "dicom2nifti/generic/compressed_jpeg/001",
            "dicom2nifti/generic/compressed_jpegls/001",
            "dicom2nifti/generic/rgb/001",
            "totalsegmentator/example_ct_dicom",
        ],
    )
    def test_public_series_equal_those_of_an_independent_reader(self, name: str) -> None:
        folder = shared(name)
        series: Any = SimpleITK.ImageSeriesReader
        names = series.GetGDCMSeriesFileNames(os.fspath(folder))
        expected = SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(names))
        volume = read_volume(folder)
        layers = volume.voxels.reshape(*volume.shape, -1)
        found = [volume.grid.restore(layers[..., layer]) for layer in range(volume.layers)]
        np.testing.assert_array_equal(np.stack(found, axis=-1).reshape(expected.shape), expected)
