"""Zip files: read like the folder in them; nothing leaves the private folder, and that is gone afterwards."""

from __future__ import annotations

import os
import shutil
import signal
import stat
import struct
import subprocess
import sys
import tempfile
import time
import zipfile
from types import SimpleNamespace
from typing import TYPE_CHECKING

import nibabel
import numpy as np
import pytest
from PIL import Image

from studies import AFFINES, LPS_TO_RAS, assert_in_place, sampled, shared, write_nifti, write_series
from tomomesh.errors import FormatError, GeometryError, ResourceError, TomomeshError, UnreadableError
from tomomesh.io import read_volume
from tomomesh.io.files import archive, limits
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)


@pytest.fixture(autouse=True)
def private(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Keep temporary files in a folder of their own, and find it empty after every test."""
    folder = tmp_path / "private"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    yield folder
    assert list(folder.iterdir()) == []


def zipped(path: Path, members: dict[str, bytes | Path], method: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", method) as target:
        for name, content in members.items():
            target.writestr(name, content if isinstance(content, bytes) else content.read_bytes())
    return path


def series(folder: Path, inside: str = "") -> dict[str, bytes | Path]:
    return {inside + path.name: path for path in sorted(write_series(folder / "s", STORED, AXIAL).iterdir())}


class TestRead:
    @pytest.mark.parametrize("inside", ["", "study/series 1/", "größe/"])
    @pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_LZMA])
    def test_a_series_is_read_as_from_its_folder(self, tmp_path: Path, inside: str, method: int) -> None:
        volume = read_volume(zipped(tmp_path / "s.zip", series(tmp_path, inside), method))
        folder = read_volume(tmp_path / "s")
        np.testing.assert_array_equal(volume.voxels, folder.voxels)
        np.testing.assert_array_equal(volume.affine, folder.affine)
        assert volume.notes == folder.notes == ()

    def test_the_only_volume_is_read(self, tmp_path: Path) -> None:
        nifti = write_nifti(tmp_path / "a.nii", STORED, AXIAL)
        assert_in_place(read_volume(zipped(tmp_path / "s.ZIP", {"x/a.nii": nifti, "readme.txt": b"x"})))

    @pytest.mark.parametrize("packed", ["", ".gz"])
    def test_a_pair_of_header_and_voxels_is_one_volume(self, tmp_path: Path, packed: str) -> None:
        nibabel.save(nibabel.Nifti1Pair(STORED.T, LPS_TO_RAS @ AXIAL), tmp_path / f"a.img{packed}")
        pair: dict[str, bytes | Path] = {f"a{kind}{packed}": tmp_path / f"a{kind}{packed}" for kind in (".hdr", ".img")}
        assert_in_place(read_volume(zipped(tmp_path / "s.zip", pair)))

    @pytest.mark.parametrize("inside", ["", "scan.zarr/", "scan/"])
    @pytest.mark.parametrize("zarr_format", [2, 3])
    def test_a_zarr_store_is_read_as_from_its_folder(self, tmp_path: Path, inside: str, zarr_format: int) -> None:
        pytest.importorskip("zarr", reason="the package zarr is not installed")
        from stores import write

        store = write(tmp_path / "s.zarr", zarr_format=zarr_format)
        files = [path for path in store.rglob("*") if path.is_file()]
        members: dict[str, bytes | Path] = {inside + path.relative_to(store).as_posix(): path for path in files}
        volume, folder = read_volume(zipped(tmp_path / "s.zip", members)), read_volume(store)
        np.testing.assert_array_equal(volume.voxels, folder.voxels)
        np.testing.assert_array_equal(volume.affine, folder.affine)

    def test_pictures_are_read_as_slices(self, tmp_path: Path) -> None:
        members: dict[str, bytes | Path] = {}
        for k in range(3):
            Image.fromarray(np.full((4, 5), k, np.uint8)).save(tmp_path / f"{k}.png")
            members[f"{k}.png"] = tmp_path / f"{k}.png"
        volume = read_volume(zipped(tmp_path / "s.zip", members), settings=ReadSettings(spacing=(1, 1, 1)))
        assert volume.voxels[:, 0, 0].tolist() == [0, 1, 2]

    def test_a_head_is_read_as_from_its_folder(self, tmp_path: Path) -> None:
        members = {path.name: path for path in shared("dicom2nifti/siemens/anatomical/001").iterdir()}
        volume = read_volume(zipped(tmp_path / "s.zip", dict(members)))
        np.testing.assert_array_equal(volume.voxels, read_volume(shared("dicom2nifti/siemens/anatomical/001")).voxels)


class TestErrors:
    """An error names the archive that was typed, never the private folder."""

    def test_of_a_series(self, tmp_path: Path) -> None:
        members = series(tmp_path)
        path = zipped(tmp_path / "s.zip", dict(item for n, item in enumerate(members.items()) if n != 1))
        with pytest.raises(GeometryError, match=rf"missing: 1. File: {path} \[") as caught:
            read_volume(path)
        assert "private" not in str(caught.value)

    def test_of_a_single_volume(self, tmp_path: Path) -> None:
        path = zipped(tmp_path / "s.zip", {"in/a.nii.gz": b"no gzip"})
        with pytest.raises(FormatError, match=rf"File: {path}: in/a\.nii\.gz") as caught:
            read_volume(path)
        assert "private" not in str(caught.value)

    def test_of_an_archive_without_images(self, tmp_path: Path) -> None:
        nested = zipped(tmp_path / "inner.zip", series(tmp_path))
        path = zipped(tmp_path / "s.zip", {"inner.zip": nested, "a.txt": b"x"})
        with pytest.raises(FormatError, match=rf"0 of 2 files are images. File: {path} \[1 \.zip files, 1 of an"):
            read_volume(path)

    def test_of_an_empty_archive(self, tmp_path: Path) -> None:
        with pytest.raises(UnreadableError, match="empty"):
            read_volume(zipped(tmp_path / "s.zip", {}))


class TestHostile:
    @pytest.mark.parametrize(
        "name",
        [
            "../out.dcm",
            "a/../../out.dcm",
            "/out.dcm",
            "..\\out.dcm",
            "C:\\out.dcm",
            "C:out.dcm",
            "\\\\host\\share\\x",
        ],
    )
    def test_names_that_leave_the_folder_are_refused(self, tmp_path: Path, name: str) -> None:
        path = zipped(tmp_path / "s.zip", {**series(tmp_path), name: b"x"})
        with pytest.raises(FormatError, match="would leave its folder"):
            read_volume(path)
        assert not list(tmp_path.rglob("out.dcm"))

    @pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR, stat.S_IFBLK, stat.S_IFSOCK])
    def test_links_and_devices_are_refused(self, tmp_path: Path, kind: int) -> None:
        path = zipped(tmp_path / "s.zip", series(tmp_path))
        with zipfile.ZipFile(path, "a") as target:
            member = zipfile.ZipInfo("link.dcm")
            member.external_attr = (kind | 0o777) << 16
            target.writestr(member, "/etc/passwd")
        with pytest.raises(FormatError, match="a link or a device"):
            read_volume(path)

    def test_an_encrypted_archive_is_refused(self, tmp_path: Path) -> None:
        path = zipped(tmp_path / "s.zip", {"a.dcm": b"x" * 50})
        raw = bytearray(path.read_bytes())
        raw[6] |= 1
        raw[raw.rindex(b"PK\x01\x02") + 8] |= 1
        path.write_bytes(raw)
        with pytest.raises(FormatError, match=r"encrypted.*the unpacked folder"):
            read_volume(path)

    def test_a_bomb_is_refused_before_it_is_unpacked(self, tmp_path: Path, private: Path) -> None:
        path = zipped(tmp_path / "s.zip", {"a.dcm": bytes(2**27)})
        with pytest.raises(ResourceError, match=r"unpacked size = 134217728 bytes.*at most 500 times"):
            read_volume(path)

    def test_a_member_that_holds_more_than_it_promises_is_refused(self, tmp_path: Path) -> None:
        path = zipped(tmp_path / "s.zip", {"a.dcm": bytes(2**22)})
        raw = bytearray(path.read_bytes())
        for place in (22, raw.rindex(b"PK\x01\x02") + 24):
            raw[place : place + 4] = struct.pack("<I", 1000)
        path.write_bytes(raw)
        with pytest.raises(FormatError):
            read_volume(path)

    def test_many_files_are_refused(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(archive, "MOST_MEMBERS", 4)
        with pytest.raises(ResourceError, match=r"files = 5.*at most 4"):
            read_volume(zipped(tmp_path / "s.zip", series(tmp_path)))

    @pytest.mark.parametrize("wide", [False, True])
    def test_a_long_table_is_refused_before_it_is_read(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wide: bool
    ) -> None:
        path = zipped(tmp_path / "s.zip", series(tmp_path))
        if wide:
            monkeypatch.setattr(zipfile, "ZIP_FILECOUNT_LIMIT", 2)
            path = zipped(tmp_path / "wide.zip", series(tmp_path))
            assert b"PK\x06\x06" in path.read_bytes()
            monkeypatch.undo()
        assert_in_place(read_volume(path))
        monkeypatch.setattr(archive, "DIRECTORY_BYTES", 100)
        monkeypatch.setattr(zipfile, "ZipFile", None)
        with pytest.raises(ResourceError, match="table of contents = "):
            read_volume(path)

    def test_more_than_the_memory_is_refused(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(limits, "physical_memory", lambda: 1000)
        with pytest.raises(ResourceError, match="do not fit into the memory"):
            read_volume(zipped(tmp_path / "s.zip", series(tmp_path)))

    def test_more_than_the_disk_is_refused(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=10))
        with pytest.raises(ResourceError, match="free space"):
            read_volume(zipped(tmp_path / "s.zip", series(tmp_path)))

    def test_two_members_of_one_name_are_refused(self, tmp_path: Path) -> None:
        path = zipped(tmp_path / "s.zip", {"a.dcm": b"a"})
        with zipfile.ZipFile(path, "a") as target, pytest.warns(UserWarning, match="Duplicate"):
            target.writestr("a.dcm", "b")
        with pytest.raises(FormatError, match="cannot be unpacked"):
            read_volume(path)

    @pytest.mark.parametrize("change", [slice(0, 4), slice(60, 64), slice(-30, -20), slice(200, None)])
    def test_damage_is_told_in_one_line(self, tmp_path: Path, change: slice) -> None:
        path = zipped(tmp_path / "s.zip", series(tmp_path))
        raw = bytearray(path.read_bytes())
        raw[change] = b"" if change.stop is None else b"\xff" * len(raw[change])
        path.write_bytes(raw)
        with pytest.raises(TomomeshError) as caught:
            read_volume(path)
        assert caught.value.exit_code in (4, 7)
        assert "\n" not in str(caught.value)


class TestPrivate:
    def test_nobody_else_may_enter(self, tmp_path: Path) -> None:
        with archive.unpacked_zip(zipped(tmp_path / "s.zip", series(tmp_path))) as folder:
            assert stat.S_IMODE(folder.stat().st_mode) == 0o700
            assert len(list(folder.iterdir())) == 5
        assert not folder.exists()

    def test_it_is_gone_after_an_error_of_another_kind(self, tmp_path: Path) -> None:
        path = zipped(tmp_path / "s.zip", series(tmp_path))
        with pytest.raises(KeyboardInterrupt), archive.unpacked_zip(path) as folder:
            raise KeyboardInterrupt
        assert not folder.exists()

    def test_it_is_gone_after_kill_9(self, tmp_path: Path, private: Path) -> None:
        path = zipped(tmp_path / "s.zip", series(tmp_path))
        code = (
            "import sys, time; from pathlib import Path; from tomomesh.io.files.archive import unpacked_zip\n"
            "with unpacked_zip(Path(sys.argv[1])) as folder:\n"
            "    print(len(list(folder.iterdir())), flush=True); time.sleep(60)"
        )
        environment = {**os.environ, "TMPDIR": str(private)}
        command = [sys.executable, "-c", code, str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, start_new_session=True) as child:
            assert child.stdout is not None
            assert child.stdout.readline() == b"5\n"
            assert len(list(private.iterdir())) == 1
            os.killpg(child.pid, signal.SIGKILL)
        for _ in range(500):
            if not list(private.iterdir()):
                break
            time.sleep(0.02)
