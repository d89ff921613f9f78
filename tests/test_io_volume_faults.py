"""Volumes that lie, leave their folder or are damaged: one line, and little memory."""

from __future__ import annotations

import bz2
import gzip
import tracemalloc
import zlib
from typing import TYPE_CHECKING

import nibabel
import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from PIL import Image

from studies import AFFINES, LPS_TO_RAS, sampled
from tomomesh.cli import main
from tomomesh.errors import FormatError, GeometryError, ResourceError, TomomeshError
from tomomesh.io import read_volume
from tomomesh.io.files import unpack
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

SPACING = ReadSettings(spacing=(0.5, 0.7, 2.0))
STORED = sampled(AFFINES["axial"])
NRRD = (
    "NRRD0005\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 9 7 5\n"
    "space directions: (0.5,0,0) (0,0.7,0) (0,0,2)\nendian: little\nencoding: raw\nspace origin: (-3,11,40)\n"
)
META = (
    "ObjectType = Image\nNDims = 3\nDimSize = 9 7 5\nElementType = MET_SHORT\nElementSpacing = 0.5 0.7 2\n"
    "Offset = -3 11 40\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n"
)


def nrrd(head: str = NRRD, data: bytes = STORED.tobytes()) -> bytes:
    return f"{head}\n".encode() + data


def meta(head: str = META, data: bytes = STORED.tobytes()) -> bytes:
    return f"{head}ElementDataFile = LOCAL\n".encode() + data


def mgh() -> bytes:
    return bytes(nibabel.MGHImage(STORED.T, LPS_TO_RAS @ AFFINES["axial"]).to_bytes())


def with_gzip(head: str = NRRD) -> str:
    return head.replace("raw", "gzip")


HUGE = NRRD.replace("9 7 5", "32767 32767 32767")

FAULTS: dict[str, tuple[bytes, type[TomomeshError], str]] = {
    "empty.nrrd": (b"", FormatError, "empty"),
    "text.nrrd": (b"hello", FormatError, "no NRRD header"),
    "endless.nrrd": (NRRD.encode() + b"#" * 2**21, FormatError, "no NRRD header"),
    "no end.nrrd": (NRRD.encode(), FormatError, "does not end"),
    "no sizes.nrrd": (nrrd(NRRD.replace("sizes", "sized")), FormatError, "missing = sizes"),
    "short.nrrd": (nrrd()[:-1], FormatError, "cut off"),
    "short gzip.nrrd": (nrrd(with_gzip(), gzip.compress(STORED.tobytes())[:-9]), FormatError, "damaged"),
    "wrong sum.nrrd": (nrrd(with_gzip(), gzip.compress(STORED.tobytes())[:-8] + bytes(8)), FormatError, "damaged"),
    "no gzip.nrrd": (nrrd(with_gzip(), b"garbage" * 99), FormatError, "damaged"),
    "no bzip2.nrrd": (nrrd(NRRD.replace("raw", "bzip2"), b"garbage" * 99), FormatError, "damaged"),
    "few words.nrrd": (nrrd(NRRD.replace("raw", "ascii"), b"1234567 " * 99), FormatError, "voxels = 99"),
    "no words.nrrd": (nrrd(NRRD.replace("raw", "ascii"), b"one two " * 999), FormatError, "numpy"),
    "wide words.nrrd": (nrrd(NRRD.replace("raw", "ascii"), b"99999 " * 999), FormatError, "numpy"),
    "huge.nrrd": (nrrd(HUGE.replace("32767", "3276700")), ResourceError, "memory"),
    "large.nrrd": (nrrd(with_gzip(HUGE.replace("32767", "1000")), bytes(99)), FormatError, "cut off"),
    "long.nrrd": (nrrd(NRRD.replace("9 7 5", f"{10**30} 7 5")), FormatError, "sizes"),
    "zero.nrrd": (nrrd(NRRD.replace("9 7 5", "9 0 5")), FormatError, "sizes"),
    "negative.nrrd": (nrrd(NRRD.replace("9 7 5", "-9 -7 5")), FormatError, "sizes"),
    "few sizes.nrrd": (nrrd(NRRD.replace("9 7 5", "63 5")), FormatError, "sizes"),
    "singular.nrrd": (nrrd(NRRD.replace("(0,0.7,0)", "(1,0,0)")), GeometryError, "singular"),
    "nan.nrrd": (nrrd(NRRD.replace("(0,0.7,0)", "(0,nan,0)")), GeometryError, "singular"),
    "words.nrrd": (nrrd(NRRD.replace("(0,0.7,0)", "(0,b,0)")), FormatError, "space directions"),
    "two.nrrd": (nrrd(NRRD.replace("(0,0.7,0)", "(0,0.7)")), FormatError, "three numbers"),
    "few directions.nrrd": (nrrd(NRRD.replace("(0,0.7,0)", "")), FormatError, "contradicts"),
    "infinite origin.nrrd": (nrrd(NRRD.replace("-3,11", "inf,11")), GeometryError, "singular"),
    "space.nrrd": (nrrd(NRRD.replace("left-posterior-superior", "3D-left-handed")), GeometryError, "no patient's"),
    "unit.nrrd": (nrrd(f'{NRRD}space units: "mm" "mm" "parsec"\n'), GeometryError, "unit"),
    "type.nrrd": (nrrd(NRRD.replace("short", "block")), FormatError, "type = block"),
    "endian.nrrd": (nrrd(NRRD.replace("little", "middle")), FormatError, "byte order"),
    "encoding.nrrd": (nrrd(NRRD.replace("raw", "lzma")), FormatError, "encoding = lzma"),
    "skip.nrrd": (nrrd(f"{NRRD}byte skip: -7\n"), FormatError, "byteskip"),
    "far.nrrd": (nrrd(f"{NRRD}byte skip: 999999999\n"), FormatError, "cut off"),
    "lines.nrrd": (nrrd(f"{NRRD}line skip: 9999\n"), FormatError, "fewer lines"),
    "frames.nrrd": (
        nrrd(NRRD.replace("dimension: 3", "dimension: 4").replace("9 7 5", "9 7 1 5").replace("space dir", "no dir")),
        FormatError,
        "several frames",
    ),
    "text.mha": (b"hello", FormatError, "no MetaImage header"),
    "no type.mha": (meta(META.replace("ElementType", "Kind")), FormatError, "missing = ElementType"),
    "mesh.mha": (meta(META.replace("Image", "Mesh")), FormatError, "no MetaImage header"),
    "short.mha": (meta()[:-1], FormatError, "cut off"),
    "short zlib.mha": (
        meta(f"{META}CompressedData = True\n", zlib.compress(STORED.tobytes())[:-9]),
        FormatError,
        "damaged",
    ),
    "no zlib.mha": (meta(f"{META}CompressedData = True\n", b"garbage" * 99), FormatError, "damaged"),
    "huge.mha": (meta(META.replace("9 7 5", "3276700 3276700 3276700")), ResourceError, "memory"),
    "zero.mha": (meta(META.replace("9 7 5", "9 0 5")), FormatError, "DimSize"),
    "zero spacing.mha": (meta(META.replace("0.5 0.7 2", "0.5 0 2")), GeometryError, r"ElementSpacing\[1\] = 0"),
    "nan spacing.mha": (meta(META.replace("0.5 0.7 2", "0.5 nan 2")), GeometryError, "ElementSpacing"),
    "minus spacing.mha": (meta(META.replace("0.5 0.7 2", "-0.5 0.7 2")), GeometryError, "ElementSpacing"),
    "singular.mha": (meta(META.replace("0 1 0", "1 0 0")), GeometryError, "singular"),
    "few.mha": (meta(META.replace("-3 11 40", "-3 11")), FormatError, "Offset"),
    "type.mha": (meta(META.replace("MET_SHORT", "MET_OTHER")), FormatError, "MET_OTHER"),
    "slice.mha": (meta(META.replace("NDims = 3", "NDims = 2").replace("9 7 5", "9 7")), GeometryError, "one slice"),
    "skip.mha": (meta(f"{META}HeaderSize = what\n"), FormatError, "HeaderSize"),
    "channels.mha": (meta(f"{META}ElementNumberOfChannels = 0\n"), FormatError, "Channels"),
    "short.mgh": (mgh()[:-200], FormatError, "cut off"),
    "header.mgh": (mgh()[:100], FormatError, "cut off"),
    "version.mgh": (b"\1\1\1\1" + mgh()[4:], FormatError, "version"),
    "zero.mgh": (mgh()[:4] + bytes(4) + mgh()[8:], FormatError, "dims"),
    "frames.mgh": (mgh()[:16] + b"\0\0\0\2" + mgh()[20:], FormatError, "several frames"),
    "huge.mgh": (mgh()[:4] + b"\x7f\xff\xff\xff" * 3 + mgh()[16:], ResourceError, "memory"),
    "type.mgh": (mgh()[:20] + b"\0\0\0\7" + mgh()[24:], FormatError, "type = 7"),
    "spacing.mgh": (mgh()[:30] + bytes(4) + mgh()[34:], GeometryError, "delta"),
    "damaged.mgz": (gzip.compress(mgh())[:-20], FormatError, "damaged"),
    "marked.mgz": (b"\x1f\x8b" + mgh(), FormatError, "damaged"),
    "text.npy": (b"hello", FormatError, "numpy"),
    "text.tif": (b"hello" * 99, FormatError, "tifffile"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_told_in_one_line_and_costs_little(tmp_path: Path, name: str) -> None:
    if name.endswith(".tif"):
        pytest.importorskip("tifffile", reason="the package tifffile is not installed")
    data, kind, words = FAULTS[name]
    (tmp_path / name).write_bytes(data)
    tracemalloc.start()
    try:
        with pytest.raises(kind, match=words) as fault:
            read_volume(tmp_path / name)
        assert tracemalloc.get_traced_memory()[1] < 2**25
    finally:
        tracemalloc.stop()
    assert str(fault.value).isprintable()


class TestBombs:
    @pytest.mark.parametrize(("encoding", "packed"), [("gzip", gzip.compress), ("bzip2", bz2.compress)])
    def test_a_stream_that_goes_on_is_stopped(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, encoding: str, packed: Callable[[bytes], bytes]
    ) -> None:
        monkeypatch.setattr(unpack, "SURPLUS_BYTES", 2**20)
        data = packed(STORED.tobytes() + bytes(2**22))
        (tmp_path / "s.nrrd").write_bytes(nrrd(NRRD.replace("raw", encoding), data))
        with pytest.raises(ResourceError, match="goes on"):
            read_volume(tmp_path / "s.nrrd")

    def test_a_zlib_stream_that_goes_on_is_stopped(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(unpack, "SURPLUS_BYTES", 2**20)
        (tmp_path / "s.mha").write_bytes(meta(f"{META}CompressedData = True\n", zlib.compress(bytes(2**22))))
        with pytest.raises(ResourceError, match="goes on"):
            read_volume(tmp_path / "s.mha")


class TestDetached:
    def detached(self, folder: Path, kind: str, named: str) -> Path:
        folder.mkdir(exist_ok=True)
        text = f"{NRRD}data file: {named}\n" if kind == ".nhdr" else f"{META}ElementDataFile = {named}\n"
        (folder / f"study{kind}").write_text(text, encoding="utf-8")
        return folder / f"study{kind}"

    @pytest.mark.parametrize("kind", [".nhdr", ".mhd"])
    def test_a_file_below_the_header_is_read(self, tmp_path: Path, kind: str) -> None:
        header = self.detached(tmp_path / "in", kind, "./deep er/ä.raw")
        (tmp_path / "in" / "deep er").mkdir()
        (tmp_path / "in" / "deep er" / "ä.raw").write_bytes(STORED.tobytes())
        np.testing.assert_array_equal(read_volume(header).voxels, STORED)

    @pytest.mark.parametrize("kind", [".nhdr", ".mhd"])
    @pytest.mark.parametrize("way", ["above", "absolute", "link", "folder link", "list", "pattern"])
    def test_one_outside_is_never_opened(
        self, tmp_path: Path, kind: str, way: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        outside = tmp_path / "secret0.raw"
        outside.write_bytes(STORED.tobytes())
        named = {
            "above": "../secret0.raw", "absolute": str(outside), "link": "link.raw", "folder link": "l/secret0.raw",
            "list": "LIST\n../secret0.raw", "pattern": "../secret%d.raw 0 0 1",
        }[way]  # fmt: skip
        header = self.detached(tmp_path / "in", kind, named)
        if "link" in way:
            (tmp_path / "in" / "link.raw").symlink_to(outside)
            (tmp_path / "in" / "l").symlink_to(tmp_path)
        monkeypatch.setattr("tomomesh.io.volumes.raster.unpacked", None)
        with pytest.raises(FormatError, match="outside of its header's folder") as fault:
            read_volume(header)
        assert str(tmp_path / "secret") not in str(fault.value)

    @pytest.mark.parametrize("kind", [".nhdr", ".mhd"])
    @pytest.mark.parametrize(
        "named", ["nowhere.raw", ".", "a\0b", "%d%d.raw 1 2 1", "x%d.raw", "x%d 1 99999999 1", "%s 1 2 1"]
    )
    def test_a_name_that_leads_nowhere_is_refused(self, tmp_path: Path, kind: str, named: str) -> None:
        with pytest.raises(FormatError) as fault:
            read_volume(self.detached(tmp_path / "in", kind, named))
        assert str(fault.value).isprintable()

    @pytest.mark.parametrize("kind", [".nhdr", ".mhd"])
    def test_one_that_is_too_short_is_refused(self, tmp_path: Path, kind: str) -> None:
        header = self.detached(tmp_path / "in", kind, "a.raw")
        (tmp_path / "in" / "a.raw").write_bytes(STORED.tobytes()[:-1])
        with pytest.raises(FormatError, match="cut off"):
            read_volume(header)

    def test_a_pipe_is_never_opened(self, tmp_path: Path) -> None:
        import os

        if not hasattr(os, "mkfifo"):
            pytest.skip("there are no pipes here")
        header = self.detached(tmp_path / "in", ".nhdr", "pipe.raw")
        os.mkfifo(tmp_path / "in" / "pipe.raw")
        with pytest.raises(FormatError, match="cannot be read"):
            read_volume(header)


def whole_files(folder: Path) -> dict[str, bytes]:
    """Return one small valid file for each reader."""
    data = STORED.tobytes()
    found = {
        "a.nrrd": nrrd(),
        "g.nrrd": nrrd(with_gzip(), gzip.compress(data, mtime=0)),
        "b.nrrd": nrrd(NRRD.replace("raw", "bzip2"), bz2.compress(data)),
        "t.nrrd": nrrd(NRRD.replace("raw", "ascii"), " ".join(map(str, STORED.ravel())).encode()),
        "d.nhdr": f"{NRRD}data file: x%d.raw 1 1 1\n".encode(),
        "a.mha": meta(),
        "z.mha": meta(f"{META}CompressedData = True\n", zlib.compress(data)),
        "d.mhd": f"{META}ElementDataFile = x1.raw\n".encode(),
        "a.mgh": mgh(),
        "a.mgz": gzip.compress(mgh(), mtime=0),
    }
    (folder / "x1.raw").write_bytes(data)
    np.save(folder / "a.npy", STORED)
    pages = [Image.fromarray(pixels.astype(np.uint16)) for pixels in STORED]
    pages[0].save(folder / "a.tif", save_all=True, append_images=pages[1:])
    return found | {name: (folder / name).read_bytes() for name in ("a.npy", "a.tif")}


NAMES = (
    "a.nrrd", "g.nrrd", "b.nrrd", "t.nrrd", "d.nhdr", "a.mha", "z.mha", "d.mhd", "a.mgh", "a.mgz", "a.npy", "a.tif",
)  # fmt: skip
EDITS = st.lists(st.tuples(st.integers(0, 2**12), st.integers(0, 6), st.binary(max_size=6)), min_size=1, max_size=4)


@pytest.mark.parametrize("name", NAMES)
def test_damage_ends_in_a_result_or_in_one_line(tmp_path: Path, name: str) -> None:
    if name.endswith(".tif"):
        pytest.importorskip("tifffile", reason="the package tifffile is not installed")
    whole = whole_files(tmp_path)[name]
    (tmp_path / name).write_bytes(whole)
    assert read_volume(tmp_path / name, settings=SPACING).shape == STORED.shape

    @hypothesis_settings(max_examples=60, suppress_health_check=list(HealthCheck))
    @given(edits=EDITS, cut=st.one_of(st.none(), st.integers(1, len(whole))))
    def damage(edits: list[tuple[int, int, bytes]], cut: int | None) -> None:
        raw = bytearray(whole)
        for at, gone, new in edits:
            raw[at % len(whole) : at % len(whole) + gone] = new
        (tmp_path / name).write_bytes(bytes(raw[:cut]))
        told: list[TomomeshError] = []
        tracemalloc.start()
        try:
            read_volume(tmp_path / name, settings=SPACING)
        except TomomeshError as fault:
            told.append(fault)
        finally:
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
        assert peak < 2**26
        assert all(str(fault).isprintable() and fault.exit_code in (4, 5, 7) for fault in told)

    damage()


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("short.nrrd", 4),
        ("singular.nrrd", 5),
        ("huge.nrrd", 7),
        ("short.mha", 4),
        ("zero spacing.mha", 5),
        ("short.mgh", 4),
    ],
)
def test_the_command_line_says_one_line_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, code: int
) -> None:
    (tmp_path / name).write_bytes(FAULTS[name][0])
    assert main(["reconstruct", str(tmp_path / name), "-o", str(tmp_path / "m.ply"), "--lower", "0"]) == code
    lines = capsys.readouterr().err.strip().splitlines()
    assert lines[-1].startswith("error: ")
    assert sum(line.startswith("error: ") for line in lines) == 1
    assert [path.name for path in tmp_path.iterdir()] == [name]
