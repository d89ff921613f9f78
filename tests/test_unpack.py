"""Packed streams as files: whatever their parts, by zlib and by zlib-ng, and never a byte of what is damaged."""

from __future__ import annotations

import gzip
import zlib
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from conftest import law
from tomomesh.errors import FormatError, ResourceError
from tomomesh.io.files import unpack
from tomomesh.io.files.unpack import BZIP2, GZIP, PLAIN, ZLIB, fill, pass_over, unpacked

if TYPE_CHECKING:
    from pathlib import Path
    from types import ModuleType

NOISE = np.random.default_rng(0).integers(0, 40, 3 * unpack.CHUNK_BYTES, np.uint8).tobytes()
ZEROS = bytes(20 * unpack.CHUNK_BYTES)


@pytest.fixture(params=["zlib", "zlib_ng.zlib_ng"])
def inflater(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Each library that unpacks."""
    pytest.importorskip(request.param.split(".")[0], reason="zlib-ng is not installed")
    library = import_module(request.param)
    monkeypatch.setattr(unpack, "inflater", lambda: library)
    return library


def found(path: Path, packing: str, sizes: list[int], start: int = 0) -> list[bytes]:
    with unpacked(path, packing, file="a", start=start) as stream:
        return [stream.read(size) for size in sizes]


@pytest.mark.usefixtures("inflater")
class TestStreams:
    @settings(law(60), suppress_health_check=list(HealthCheck))  # each example writes its file anew
    @given(
        st.lists(st.sampled_from([b"", b"a", NOISE, ZEROS, NOISE[:999]]), min_size=1, max_size=5),
        st.integers(0, 9),
        st.integers(0, 3),
        st.lists(st.integers(0, 2 * unpack.CHUNK_BYTES), max_size=5),
    )
    def test_gzip_streams_one_behind_the_other_are_one(
        self, tmp_path: Path, parts: list[bytes], level: int, padding: int, sizes: list[int]
    ) -> None:
        """As the standard library reads them, zeros between and behind them among it."""
        path, pad = tmp_path / "a.gz", bytes(padding * 70_000)
        path.write_bytes(b"before" + b"".join(gzip.compress(part, level) + pad for part in parts))
        whole = gzip.decompress(path.read_bytes()[6:])
        read = found(path, GZIP, [*sizes, len(whole) + 1], start=6)
        assert b"".join(read) == whole == b"".join(parts)
        assert [len(one) for one in read[:-1]] == [
            min(size, max(len(whole) - sum(sizes[:n]), 0)) for n, size in enumerate(sizes)
        ]

    @pytest.mark.parametrize("content", [b"", NOISE, ZEROS])
    def test_a_zlib_stream_ends_where_it_ends(self, tmp_path: Path, content: bytes) -> None:
        path = tmp_path / "a.raw"
        path.write_bytes(zlib.compress(content) + b"other")
        assert found(path, ZLIB, [len(content) + 1, 5]) == [content, b""]

    @pytest.mark.parametrize("packing", [GZIP, ZLIB])
    @pytest.mark.parametrize("content", [NOISE, ZEROS])
    def test_a_stream_without_its_end_is_refused(self, tmp_path: Path, packing: str, content: bytes) -> None:
        path, packed = tmp_path / "a", gzip.compress(content) if packing == GZIP else zlib.compress(content)
        for lost in (1, 4, len(packed) // 2, len(packed) - 3):
            path.write_bytes(packed[:-lost])
            with pytest.raises(FormatError, match="damaged"):
                found(path, packing, [len(content) + 1])

    @pytest.mark.parametrize("packing", [GZIP, ZLIB])
    def test_a_wrong_check_sum_is_refused(self, tmp_path: Path, packing: str) -> None:
        path, packed = tmp_path / "a", bytearray(gzip.compress(NOISE) if packing == GZIP else zlib.compress(NOISE))
        packed[-5 if packing == GZIP else -1] ^= 1
        path.write_bytes(packed)
        into = np.empty(len(NOISE), np.uint8)
        with pytest.raises(FormatError, match="damaged"), unpacked(path, packing, file="a") as stream:
            fill(into, stream, file="a")

    def test_what_is_no_stream_behind_one_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "a").write_bytes(gzip.compress(b"abc") + b"\0\0other")
        with pytest.raises(FormatError, match="damaged"):
            found(tmp_path / "a", GZIP, [9])

    @pytest.mark.parametrize("packing", [GZIP, ZLIB])
    def test_a_bomb_behind_the_voxels_is_stopped(self, tmp_path: Path, packing: str) -> None:
        content = bytes(unpack.SURPLUS_BYTES + 2**21)
        (tmp_path / "a").write_bytes(gzip.compress(content, 1) if packing == GZIP else zlib.compress(content, 1))
        with pytest.raises(ResourceError, match="far beyond"), unpacked(tmp_path / "a", packing, file="a") as stream:
            fill(np.empty(10, np.uint8), stream, file="a")


@pytest.mark.parametrize("packing", [PLAIN, GZIP, ZLIB, BZIP2])
def test_what_is_passed_over_is_not_read(tmp_path: Path, packing: str) -> None:
    pack = {PLAIN: bytes, GZIP: gzip.compress, ZLIB: zlib.compress, BZIP2: import_module("bz2").compress}[packing]
    (tmp_path / "a").write_bytes(pack(NOISE))
    with unpacked(tmp_path / "a", packing, file="a") as stream:
        pass_over(stream, 1234)
        into = np.empty(len(NOISE) - 1234, np.uint8)
        fill(into, stream, file="a")
    assert into.tobytes() == NOISE[1234:]
