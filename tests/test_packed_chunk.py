"""How much a packed chunk holds, told before it is unpacked."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zlib
from typing import TYPE_CHECKING

import numpy as np
import pytest

from tomomesh.io.volumes.zarr import packed_chunk
from tomomesh.io.volumes.zarr.packed_chunk import promised_bytes

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

PACKERS: dict[str, Callable[[bytes], bytes]] = {
    "gzip": gzip.compress,
    "zlib": zlib.compress,
    "bz2": bz2.compress,
    "lzma": lambda data: lzma.compress(data, preset=0),
}


@pytest.fixture(autouse=True)
def _counts_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packed_chunk, "UNCOUNTED_BYTES", {})


@pytest.mark.parametrize("packing", PACKERS)
@pytest.mark.parametrize("count", [1, 1000, 3_000_000])
def test_honest_chunks_are_counted(tmp_path: Path, packing: str, count: int) -> None:
    chunk = tmp_path / "c"
    chunk.write_bytes(PACKERS[packing](np.random.default_rng(0).integers(0, 9, count, np.uint8).tobytes()))
    assert promised_bytes(chunk, packing, 10**7, file="c") == count


@pytest.mark.parametrize("packing", PACKERS)
def test_bombs_are_counted_no_further_than_it_takes(tmp_path: Path, packing: str) -> None:
    chunk = tmp_path / "c"
    chunk.write_bytes(PACKERS[packing](bytes(2**26)))
    assert 2**20 < promised_bytes(chunk, packing, 2**20, file="c") <= 2**22


@pytest.mark.parametrize("packing", ["bz2", "lzma"])
def test_a_few_bytes_can_hold_much(tmp_path: Path, packing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()  # as it is shipped
    chunk = tmp_path / "c"
    chunk.write_bytes(PACKERS[packing](bytes(2**26)))
    assert chunk.stat().st_size < 2**14
    assert promised_bytes(chunk, packing, 2**20, file="c") > 2**20


@pytest.mark.parametrize("packing", PACKERS)
def test_a_second_stream_is_too_much(tmp_path: Path, packing: str) -> None:
    chunk = tmp_path / "c"
    chunk.write_bytes(PACKERS[packing](bytes(9)) + PACKERS[packing](bytes(9)))
    assert promised_bytes(chunk, packing, 100, file="c") > 100


@pytest.mark.parametrize("packing", PACKERS)
def test_damaged_chunks_are_left_to_who_unpacks_them(tmp_path: Path, packing: str) -> None:
    chunk, whole = tmp_path / "c", PACKERS[packing](bytes(5000))
    for broken in (b"", b"no chunk", whole[:-3], whole[:9]):
        chunk.write_bytes(broken)
        assert promised_bytes(chunk, packing, 10**6, file="c") <= 5000
