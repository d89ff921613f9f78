"""Frames packed by RLE: unpacked as by pydicom, and never beyond what there is room for."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydicom.encaps import encapsulate
from pydicom.pixels.decoders.rle import _rle_decode_segment
from pydicom.uid import RLELossless

from conftest import law
from studies import AFFINES, save, slice_dataset
from tomomesh.errors import FormatError
from tomomesh.io import read_volume
from tomomesh.kernels.files.packbits import unpack_bits
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from pydicom import Dataset

ONE = ReadSettings(spacing_z=1)
PIXELS = np.arange(480, dtype=np.uint16).reshape(20, 24)


def packed(pixels: NDArray[Any], code: bytes | None = None) -> Dataset:
    """Return a slice packed by pydicom, or with a stream of one's own."""
    data = slice_dataset(pixels, AFFINES["axial"], 0)
    data.compress(RLELossless, encoding_plugin="pydicom", generate_instance_uid=False)
    if code is not None:
        data.PixelData = encapsulate([code])
    return data


def stream(*segments: bytes) -> bytes:
    starts = np.cumsum([64, *map(len, segments)])[:-1]
    return struct.pack("<16I", len(segments), *starts, *[0] * (15 - len(starts))) + b"".join(segments)


CODES = st.lists(st.one_of(st.binary(max_size=6), st.sampled_from([b"\x81\5", b"\x80", b"\xff\1", b"\x7f"])))


class TestRuns:
    @law(200)
    @given(CODES.map(b"".join), st.integers(0, 300), st.integers(0, 3), st.integers(1, 4))
    def test_any_bytes_are_unpacked_as_by_pydicom(self, code: bytes, room: int, first: int, step: int) -> None:
        found, among = np.full(first + room * step, 7, np.uint8), bytearray(b"\0" + code + b"\1\2\3")
        filled = unpack_bits(np.frombuffer(among, np.uint8), 1, 1 + len(code), found, first, step)
        expected = _rle_decode_segment(code)[:room]
        assert filled == len(expected)
        assert found[first::step][:filled].tobytes() == expected
        untouched = np.ones(len(found), bool)
        untouched[first::step][:filled] = False
        assert (found[untouched] == 7).all()


class TestFrames:
    @pytest.mark.parametrize("kind", ["u1", "i1", "u2", "i2"])
    def test_all_kinds_of_numbers_are_kept(self, tmp_path: Path, kind: str) -> None:
        """Noise and long runs, by the encoder of pydicom."""
        limits = np.iinfo(kind)
        pixels = np.random.default_rng(1).integers(limits.min, limits.max, (37, 41), kind, endpoint=True)
        pixels[5:30, 3:] = pixels[0, 0]
        found = read_volume(save(packed(pixels), tmp_path / "a.dcm"), settings=ONE).voxels
        np.testing.assert_array_equal(found[0], pixels)

    def test_no_child_is_started(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("tomomesh.io.dicom.pixels.child._started", None)
        found = read_volume(save(packed(PIXELS), tmp_path / "a.dcm"), settings=ONE).voxels
        np.testing.assert_array_equal(found[0], PIXELS)

    @pytest.mark.parametrize(
        ("code", "found"),
        [
            (b"\2\0", "segments = 0"),
            (stream(b"\x81\0" * 4), "segments = 1"),
            (stream(b"\x81\0" * 4, b"\x81\0" * 3), "segment 2 = 384 bytes"),
            (stream(b"\x81\0" * 4, b"\x81\0" * 3 + b"\x80" * 9), "segment 2 = 384 bytes"),
            (struct.pack("<16I", 2, 2**32 - 1, 64, *[0] * 13) + b"\x81\0" * 4, "segment 1 = 0 bytes"),
            (struct.pack("<16I", 2, 64, 2**31, *[0] * 13) + b"\x81\0" * 4, "segment 2 = 0 bytes"),
        ],
    )
    def test_what_is_too_short_is_refused(self, tmp_path: Path, code: bytes, found: str) -> None:
        path = save(packed(PIXELS, code), tmp_path / "a.dcm")
        with pytest.raises(FormatError, match=f"a.dcm .*RLE Lossless, {found}"):
            read_volume(path, settings=ONE)

    def test_more_bytes_than_pixels_are_left(self, tmp_path: Path) -> None:
        """Encoders that pad a segment beyond its last row, as pydicom reads them."""
        path = save(packed(PIXELS, stream(b"\x81\1" * 9, b"\x81\2" * 9)), tmp_path / "a.dcm")
        assert (read_volume(path, settings=ONE).voxels == 0x0102).all()
