"""DICOM pixels that promise more, or less, than they hold: refused before anything is allocated."""

from __future__ import annotations

import struct
import tracemalloc
import zlib
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import imagecodecs
import numpy as np
import pytest
from pydicom.encaps import encapsulate
from pydicom.uid import (
    DeflatedExplicitVRLittleEndian,
    JPEG2000Lossless,
    JPEGBaseline8Bit,
    JPEGLSLossless,
    RLELossless,
)

from studies import AFFINES, save, slice_dataset
from tomomesh.cli import main
from tomomesh.errors import FormatError, ResourceError, TomomeshError
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from pydicom import Dataset

PIXELS = np.random.default_rng(3).integers(0, 4096, (20, 24)).astype(np.uint16)
CODES: dict[str, Any] = {
    JPEG2000Lossless: imagecodecs.jpeg2k_encode(PIXELS, reversible=True, level=0, codecformat="j2k"),
    JPEGLSLossless: imagecodecs.jpegls_encode(PIXELS),
    JPEGBaseline8Bit: imagecodecs.jpeg8_encode((PIXELS >> 4).astype(np.uint8)),
}
ONE = ReadSettings(spacing_z=1)


def compressed(syntax: str = JPEGLSLossless, codes: list[bytes] | None = None, **fields: Any) -> Dataset:
    pixels: NDArray[Any] = PIXELS if syntax != JPEGBaseline8Bit else (PIXELS >> 4).astype(np.uint8)
    data = slice_dataset(pixels, AFFINES["axial"], 0)
    if syntax == RLELossless:
        data.compress(syntax, generate_instance_uid=False)
    else:
        data.file_meta.TransferSyntaxUID = syntax
        data.PixelData = encapsulate(codes or [CODES[syntax]])
        data["PixelData"].VR, data["PixelData"].is_undefined_length = "OB", True
    for keyword, value in fields.items():
        setattr(data, keyword, value)
    return data


def refusal(path: Path) -> TomomeshError:
    """Return the error of reading a file, and check that next to nothing was allocated for it."""
    tracemalloc.start()
    try:
        with pytest.raises(TomomeshError) as caught:
            read_volume(path, settings=ONE)
        assert tracemalloc.get_traced_memory()[1] < 2**25
    finally:
        tracemalloc.stop()
    return caught.value


class TestSizes:
    @pytest.mark.parametrize("syntax", [*CODES, RLELossless])
    def test_a_huge_slice_in_a_few_bytes_is_a_bomb(
        self, tmp_path: Path, syntax: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        path = save(compressed(syntax, Rows=65535, Columns=65535), tmp_path / "bomb.dcm")
        assert isinstance(refusal(path), ResourceError)
        assert main(["inspect", str(path), "--spacing-z", "1"]) == 7
        assert len(capsys.readouterr().err.splitlines()) == 1

    @pytest.mark.parametrize("syntax", CODES)
    @pytest.mark.parametrize("fields", [{"Rows": 24, "Columns": 20}, {"Rows": 2}, {"Columns": 4000}])
    def test_a_stream_of_another_size_is_refused(self, tmp_path: Path, syntax: str, fields: dict[str, Any]) -> None:
        """Among them the same number of pixels in other rows, which decoders take without a word."""
        fault = refusal(save(compressed(syntax, **fields), tmp_path / "a.dcm"))
        assert "20 x 24 x 1" in str(fault)
        assert isinstance(fault, FormatError)

    def test_a_stream_that_promises_a_huge_image_is_refused(self, tmp_path: Path) -> None:
        code = bytearray(CODES[JPEG2000Lossless])
        place = code.index(b"\xff\x51") + 6
        code[place : place + 8] = struct.pack(">II", 60000, 60000)
        fault = refusal(save(compressed(JPEG2000Lossless, [bytes(code)]), tmp_path / "a.dcm"))
        assert "60000 x 60000 x 1" in str(fault)

    def test_a_stream_of_color_under_a_gray_header_is_refused(self, tmp_path: Path) -> None:
        code = bytes(imagecodecs.jpegls_encode(np.zeros((20, 24, 3), np.uint8)))
        fault = refusal(save(compressed(codes=[code]), tmp_path / "a.dcm"))
        assert "20 x 24 x 3" in str(fault)

    def test_run_lengths_of_another_size_are_refused(self, tmp_path: Path) -> None:
        assert isinstance(refusal(save(compressed(RLELossless, Rows=2000), tmp_path / "a.dcm")), FormatError)

    def test_more_frames_than_there_are_is_refused(self, tmp_path: Path) -> None:
        fault = refusal(save(compressed(NumberOfFrames=50), tmp_path / "a.dcm"))
        assert isinstance(fault, FormatError)


class TestCutFiles:
    @pytest.mark.parametrize("syntax", [*CODES, RLELossless])
    @pytest.mark.parametrize("lost", [1, 8, 9, 60])
    def test_a_file_without_its_end_is_cut_off(self, tmp_path: Path, syntax: str, lost: int) -> None:
        path = save(compressed(syntax), tmp_path / "a.dcm")
        path.write_bytes(path.read_bytes()[:-lost])
        fault = refusal(path)
        assert isinstance(fault, FormatError)
        assert "cut off" in str(fault)

    @pytest.mark.parametrize("syntax", CODES)
    def test_a_stream_without_its_end_is_cut_off(self, tmp_path: Path, syntax: str) -> None:
        """Decoders would fill the rest of the slice with gray."""
        code = CODES[syntax]
        assert "cut off" in str(refusal(save(compressed(syntax, [code[: len(code) // 2]]), tmp_path / "a.dcm")))

    @pytest.mark.parametrize("code", [b"\0\0", b"\xff\xd8\xff\xd9", b"text" * 9, b"\xff\xd8\xff\xc0\0\2\xff\xd9"])
    def test_what_is_no_stream_is_refused(self, tmp_path: Path, code: bytes) -> None:
        assert isinstance(refusal(save(compressed(codes=[code]), tmp_path / "a.dcm")), FormatError)

    @pytest.mark.parametrize("syntax", CODES)
    def test_a_damaged_stream_is_an_error_or_an_image(self, tmp_path: Path, syntax: str) -> None:
        rng = np.random.default_rng(5)
        for n in range(6):
            code = bytearray(CODES[syntax])
            for place in rng.integers(len(code) // 3, len(code) - 2, 5):
                code[place] ^= 1 << int(rng.integers(8))
            path = save(compressed(syntax, [bytes(code)]), tmp_path / f"{n}.dcm")
            with suppress(FormatError, ResourceError):
                assert read_volume(path, settings=ONE).shape == (1, 20, 24)

    def test_pixels_without_fragments_under_a_compressed_name_are_refused(self, tmp_path: Path) -> None:
        path = save(slice_dataset(PIXELS, AFFINES["axial"], 0), tmp_path / "a.dcm")
        plain, packed = b"1.2.840.10008.1.2.1\0", b"1.2.840.10008.1.2.5\0"
        path.write_bytes(path.read_bytes().replace(plain, packed))
        assert "RLE" in str(refusal(path))

    def test_fragments_under_a_plain_name_are_refused(self, tmp_path: Path) -> None:
        path = save(compressed(RLELossless), tmp_path / "a.dcm")
        plain, packed = b"1.2.840.10008.1.2.1\0", b"1.2.840.10008.1.2.5\0"
        path.write_bytes(path.read_bytes().replace(packed, plain))
        assert "are compressed" in str(refusal(path))


class TestDeflatedFiles:
    def test_a_packed_file_is_read(self, tmp_path: Path) -> None:
        data = slice_dataset(PIXELS, AFFINES["axial"], 0)
        data.file_meta.TransferSyntaxUID = DeflatedExplicitVRLittleEndian
        path = save(data, tmp_path / "a.dcm")
        np.testing.assert_array_equal(read_volume(path, settings=ONE).voxels[0], PIXELS)

    @pytest.mark.parametrize("address", [False, True])
    def test_a_bomb_is_stopped_before_it_is_unpacked(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, address: bool
    ) -> None:
        data = slice_dataset(PIXELS, AFFINES["axial"], 0)
        data.file_meta.TransferSyntaxUID = DeflatedExplicitVRLittleEndian
        if address:  # stands before the syntax, and its length has four bytes
            data.file_meta.add_new(0x0002000F, "UR", "http://x")
        path = save(data, tmp_path / "a.dcm")
        packer = zlib.compressobj(wbits=-15)
        raw = path.read_bytes()
        start = raw.index(b"1.2.840.10008.1.2.1.99") + 22
        path.write_bytes(raw[:start] + packer.compress(bytes(2**27)) + packer.flush())
        monkeypatch.setattr("tomomesh.io.dicom.headers.deflated.LARGEST_UNPACKED", 2**26)
        assert isinstance(refusal(path), ResourceError)
