"""OME-Zarr and plain Zarr: stores that lie, lack chunks or leave their folder."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from stores import FORMATS, SCALE, STORED, chunk, multiscales, write
from tomomesh.cli import main
from tomomesh.errors import FormatError, GeometryError, ResourceError, TomomeshError, UsageError
from tomomesh.io import read_volume
from tomomesh.io.files import limits
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

zarr = pytest.importorskip("zarr", reason="the package zarr is not installed")


def isle(shape: tuple[int, int, int] = (16, 16, 16)) -> NDArray[np.int16]:
    """Return a ball that touches no side, in a background of 0."""
    away = np.linalg.norm(np.indices(shape) - np.array(shape).reshape(3, 1, 1, 1) / 3, axis=0)
    return np.where(away < 3.5, 1000, 0).astype(np.int16)


class TestMissingChunks:
    @FORMATS
    def test_what_the_writer_left_out_is_its_fill_and_is_said(self, tmp_path: Path, zarr_format: int) -> None:
        folder = write(tmp_path / "s.zarr", isle(), zarr_format=zarr_format)
        volume = read_volume(folder)
        np.testing.assert_array_equal(volume.voxels, isle())
        (note,) = [note for note in volume.notes if "chunks" in note]
        stored = len(list((folder / "0").rglob("*[0-9]")))
        there = sum(path.is_file() for path in (folder / "0").rglob("*") if path.name[0] not in ".z")
        assert stored
        assert note.endswith(f"{64 - there} of 64")

    @FORMATS
    @pytest.mark.parametrize("lost", ["1/1/1", "0/1/1", "1/0/2"])
    def test_one_that_was_lost_is_refused_and_counted(self, tmp_path: Path, zarr_format: int, lost: str) -> None:
        folder = write(tmp_path / "s.zarr", zarr_format=zarr_format)
        chunk(folder, lost).unlink()
        with pytest.raises(FormatError, match=r"missing = 1 of 12.*--fill-chunks"):
            read_volume(folder)
        volume = read_volume(folder, settings=ReadSettings(fill_chunks=True))
        assert (volume.voxels == 0).sum() > (STORED == 0).sum()
        assert "1 of 12" in volume.notes[-1]

    def test_a_hole_in_a_ball_is_refused(self, tmp_path: Path) -> None:
        folder = write(tmp_path / "s.zarr", isle())
        chunk(folder, "1/1/1").unlink()
        with pytest.raises(FormatError, match="chunks of the array are missing"):
            read_volume(folder)

    def test_a_fill_that_is_no_number_counts_too(self, tmp_path: Path) -> None:
        stored = isle().astype(np.float32)
        stored[9:] = np.nan
        folder = write(tmp_path / "s.zarr", stored, fill_value=np.nan, config={"write_empty_chunks": False})
        assert any("16 of 64" in note for note in read_volume(folder).notes)
        chunk(folder, "0/0/0").unlink()
        with pytest.raises(FormatError, match="missing"):
            read_volume(folder)

    def test_all_of_them_are_never_taken_for_fill(self, tmp_path: Path) -> None:
        folder = write(tmp_path / "s.zarr", np.zeros((8, 8, 8), np.int16))
        with pytest.raises(FormatError, match="missing = 8 of 8"):
            read_volume(folder, settings=ReadSettings(fill_chunks=True))

    def test_a_lost_shard_is_refused(self, tmp_path: Path) -> None:
        folder = write(tmp_path / "s.zarr", chunks=(2, 2, 2), shards=(4, 4, 4))
        chunk(folder).unlink()
        with pytest.raises(FormatError, match="missing = 1 of 12"):
            read_volume(folder)


class TestDamage:
    @pytest.mark.parametrize("cut", [1, 5, 30, 10**6])
    @pytest.mark.parametrize("packing", ["auto", None])
    @FORMATS
    def test_a_chunk_that_is_cut_off_is_refused(
        self, tmp_path: Path, zarr_format: int, cut: int, packing: str | None
    ) -> None:
        folder = write(tmp_path / "s.zarr", zarr_format=zarr_format, compressors=packing)
        path = chunk(folder)
        path.write_bytes(path.read_bytes()[: -min(cut, path.stat().st_size)])
        with pytest.raises(FormatError):
            read_volume(folder)

    @pytest.mark.parametrize("name", ["Blosc", "Zstd"])
    def test_a_chunk_that_holds_far_more_is_refused(self, tmp_path: Path, name: str) -> None:
        numcodecs = pytest.importorskip("numcodecs", reason="the package numcodecs is not installed")
        codec = getattr(numcodecs, name)()
        folder = write(tmp_path / "s.zarr", zarr_format=2, compressors=codec)
        chunk(folder).write_bytes(codec.encode(bytes(2**22)))
        with pytest.raises(ResourceError, match="far more than its voxels"):
            read_volume(folder)

    def edited(self, folder: Path, **fields: Any) -> Path:
        path = next(path for path in (folder / "0" / "zarr.json", folder / "0" / ".zarray") if path.exists())
        path.write_text(json.dumps(json.loads(path.read_text()) | fields))
        return folder

    @pytest.mark.parametrize(
        ("zarr_format", "fields", "told"),
        [
            (2, {"filters": [{"id": "pickle"}]}, "codec = pickle"),
            (2, {"compressor": {"id": "imagecodecs_jpegxl"}}, "codec = imagecodecs_jpegxl"),
            (3, {"codecs": [{"name": "bytes"}, {"name": "secret.codec"}]}, "codec = secret.codec"),
            (3, {"codecs": [{"name": "numcodecs.pickle"}]}, "codec = numcodecs.pickle"),
            (3, {"codecs": [{"name": "sharding_indexed", "configuration": {"codecs": [{"name": "q"}]}}]}, "codec = q"),
        ],
    )
    def test_unknown_codecs_are_named(self, tmp_path: Path, zarr_format: int, fields: Any, told: str) -> None:
        folder = self.edited(write(tmp_path / "s.zarr", zarr_format=zarr_format), **fields)
        with pytest.raises(FormatError) as fault:
            read_volume(folder)
        assert told in str(fault.value)

    def test_sizes_are_compared_with_the_memory_first(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        folder = self.edited(write(tmp_path / "s.zarr", zarr_format=2), shape=[32767] * 3)
        with pytest.raises(ResourceError, match="memory"):
            read_volume(folder)
        monkeypatch.setattr(limits, "physical_memory", lambda: 100)
        with pytest.raises(ResourceError, match="at most 100 bytes"):
            read_volume(write(tmp_path / "s.zarr"))

    @pytest.mark.parametrize("path", ["../other", "..", "/", "nowhere", "", "0/0"])
    def test_a_level_outside_of_the_folder_is_never_opened(self, tmp_path: Path, path: str) -> None:
        images = multiscales()
        images[0]["datasets"][0]["path"] = str(tmp_path / "other") if path == "/" else path
        write(tmp_path / "other", images=images)
        folder = write(tmp_path / "s.zarr", images=images)
        with pytest.raises(FormatError) as fault:
            read_volume(folder)
        assert str(tmp_path / "other") not in str(fault.value)

    @pytest.mark.parametrize("linked", ["0", "0/c", "0/c/1", "0/c/1/1/1", "0/zarr.json"])
    def test_links_that_leave_the_folder_are_never_followed(self, tmp_path: Path, linked: str) -> None:
        folder = write(tmp_path / "s.zarr")
        target = tmp_path / "outside"
        (folder / linked).rename(target)
        (folder / linked).symlink_to(target)
        with pytest.raises(FormatError, match=r"outside|no regular file"):
            read_volume(folder)

    def test_a_pipe_is_never_opened(self, tmp_path: Path) -> None:
        if not hasattr(os, "mkfifo"):
            pytest.skip("there are no pipes here")
        folder = write(tmp_path / "s.zarr")
        path = chunk(folder)
        path.unlink()
        os.mkfifo(path)
        with pytest.raises(FormatError, match="no regular file"):
            read_volume(folder)

    @pytest.mark.parametrize(
        ("told", "words"),
        [
            ({"bioformats2raw.layout": 3}, "the folder of one image"),
            ({"plate": {}}, "the folder of one image"),
            ({}, "no multiscales"),
        ],
    )
    def test_other_stores_say_what_to_give(self, tmp_path: Path, told: Any, words: str) -> None:
        zarr.open_group(tmp_path / "s.zarr", mode="w", zarr_format=2).attrs.update(told)
        with pytest.raises(FormatError, match=words):
            read_volume(tmp_path / "s.zarr")

    @pytest.mark.parametrize(
        ("change", "kind"),
        [
            (lambda image: image["axes"].pop(0), GeometryError),
            (lambda image: image["axes"][0].update(name="w"), FormatError),
            (lambda image: image["axes"].append({"name": "t"}), FormatError),
            (lambda image: image["datasets"].clear(), UsageError),
            (lambda image: image["datasets"][0].pop("path"), FormatError),
            (lambda image: image["datasets"][0]["coordinateTransformations"][0]["scale"].pop(), FormatError),
            (lambda image: image["datasets"][0]["coordinateTransformations"][0].update(type="affine"), FormatError),
            (
                lambda image: image["datasets"][0]["coordinateTransformations"][0].update(scale=[1, 0, 1]),
                GeometryError,
            ),
            (lambda image: image["datasets"][0].pop("coordinateTransformations"), GeometryError),
            (lambda image: image.pop("axes"), FormatError),
        ],
    )
    def test_metadata_that_lie_are_refused(self, tmp_path: Path, change: Any, kind: type[TomomeshError]) -> None:
        images = multiscales()
        change(images[0])
        folder = write(tmp_path / "s.zarr", images=images)
        with pytest.raises(kind) as fault:
            read_volume(folder)
        assert str(fault.value).isprintable()

    def test_a_missing_package_is_named(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        folder = write(tmp_path / "s.zarr")
        monkeypatch.setitem(__import__("sys").modules, "zarr", None)
        with pytest.raises(FormatError, match=r"tomomesh\[zarr\]"):
            read_volume(folder)

    def test_the_command_line_says_one_line(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        folder = write(tmp_path / "s.zarr")
        chunk(folder).unlink()
        assert main(["reconstruct", str(folder), "-o", str(tmp_path / "m.ply"), "--lower", "0"]) == 4
        lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
        assert len(lines) == 1
        assert not (tmp_path / "m.ply").exists()


@FORMATS
def test_damage_ends_in_a_result_or_in_one_line(tmp_path: Path, zarr_format: int) -> None:
    folder = write(tmp_path / "s.zarr", zarr_format=zarr_format)
    whole = {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}
    edit = st.tuples(st.integers(0, len(whole) - 1), st.integers(0, 2**12), st.integers(0, 6), st.binary(max_size=6))

    @hypothesis_settings(max_examples=40, suppress_health_check=list(HealthCheck))
    @given(edits=st.lists(edit, min_size=1, max_size=3))
    def damage(edits: list[tuple[int, int, int, bytes]]) -> None:
        for path, data in whole.items():
            path.write_bytes(data)
        for which, at, gone, new in edits:
            path = list(whole)[which]
            raw = bytearray(whole[path])
            raw[at % len(raw) : at % len(raw) + gone] = new
            path.write_bytes(bytes(raw))
        told: list[TomomeshError] = []
        try:
            read_volume(folder, settings=ReadSettings(spacing=SCALE))
        except TomomeshError as fault:
            told.append(fault)
        assert all(str(fault).isprintable() and fault.exit_code in (2, 4, 5, 7) for fault in told)

    damage()
