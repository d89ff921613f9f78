"""DICOMDIR: the files that it names, and no others. The discs are written by pydicom."""

from __future__ import annotations

import atexit
import gc
import shutil
import tempfile
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pydicom
import pytest
from pydicom.fileset import FileSet
from pydicom.uid import generate_uid

from studies import AFFINES, assert_in_place, sampled, save, slice_dataset
from tomomesh.errors import FormatError, GeometryError
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)


def write_disc(folder: Path, *, series: int = 1) -> Path:
    """Write a disc with some series of five slices: a copy of the one that pydicom wrote once."""
    return Path(shutil.copytree(pressed(series), folder))


@cache
def pressed(series: int) -> Path:
    """Let pydicom write a disc, which is slow."""
    folder = Path(tempfile.mkdtemp()) / "disc"
    atexit.register(shutil.rmtree, folder.parent)
    disc = FileSet()
    for number in range(1, series + 1):
        for k in range(5):
            data = slice_dataset(STORED[k] + number - 1, AXIAL, k)
            data.SOPInstanceUID = data.file_meta.MediaStorageSOPInstanceUID = generate_uid(
                entropy_srcs=[f"{number} {k}"]
            )
            data.SeriesInstanceUID, data.SeriesNumber = f"1.2.3.{number}", number
            data.StudyInstanceUID, data.StudyDate, data.StudyTime, data.StudyID = "1.2", "20200101", "120000", "S"
            disc.add(data)
    disc.write(folder)
    with warnings.catch_warnings():  # the set's own temporary folder goes with it
        warnings.simplefilter("ignore", ResourceWarning)
        del disc, data
        gc.collect()
    return folder


def images(disc: Path) -> list[Path]:
    return sorted(path for path in disc.rglob("*") if path.is_file() and path.name != "DICOMDIR")


def rename(disc: Path, name: list[str] | str) -> None:
    """Let the index name another file for its first image."""
    index = pydicom.dcmread(disc / "DICOMDIR")
    record = next(one for one in index.DirectoryRecordSequence if "ReferencedFileID" in one)
    with pydicom.config.disable_value_validation():
        record.ReferencedFileID = name
        index.save_as(disc / "DICOMDIR")


@pytest.mark.parametrize("name", ["", "DICOMDIR"])
class TestDiscs:
    """The same whether its folder is given, or the index itself."""

    def test_the_files_that_it_names_are_read_and_no_others(self, tmp_path: Path, name: str) -> None:
        disc = write_disc(tmp_path / "disc")
        save(slice_dataset(STORED[0] + 9, AXIAL, 7), disc / "stray.dcm")
        volume = read_volume(disc / name)
        assert_in_place(volume)
        assert volume.notes == ()

    def test_several_series_are_listed(self, tmp_path: Path, name: str) -> None:
        disc = write_disc(tmp_path / "disc", series=2)
        with pytest.raises(GeometryError, match="2 series"):
            read_volume(disc / name)
        volume = read_volume(disc / name, settings=ReadSettings(series=2))
        np.testing.assert_array_equal(volume.voxels, STORED + 1)

    def test_missing_files_are_refused_or_left_out(self, tmp_path: Path, name: str) -> None:
        disc = write_disc(tmp_path / "disc")
        [last] = [path for path in images(disc) if pydicom.dcmread(path).InstanceNumber == 5]
        last.unlink()
        with pytest.raises(FormatError, match=rf"1 of 5 files that DICOMDIR names.*{last.name}.*--skip-bad"):
            read_volume(disc / name)
        volume = read_volume(disc / name, settings=ReadSettings(skip_bad=True))
        assert_in_place(volume)
        assert volume.shape == (4, 7, 9)
        assert volume.notes == ("left out: 1 missing, though DICOMDIR names them",)

    @pytest.mark.parametrize("parts", [["..", "SECRET"], "/etc/passwd", "..\\SECRET", ["A", "..", "..", "SECRET"]])
    def test_a_file_outside_is_refused(self, tmp_path: Path, name: str, parts: list[str] | str) -> None:
        disc = write_disc(tmp_path / "disc")
        save(slice_dataset(STORED[0], AXIAL, 0), tmp_path / "SECRET")
        rename(disc, parts)
        for settings in (ReadSettings(), ReadSettings(skip_bad=True)):
            with pytest.raises(FormatError, match="outside of its folder") as caught:
                read_volume(disc / name, settings=settings)
            assert "SECRET" not in str(caught.value)


def test_a_disc_mounted_in_lower_case_is_read(tmp_path: Path) -> None:
    disc = write_disc(tmp_path / "disc")
    for path in [*images(disc), disc / "DICOMDIR"]:
        low = tmp_path / "low" / path.relative_to(disc).as_posix().lower()
        low.parent.mkdir(parents=True, exist_ok=True)
        path.rename(low)
    assert_in_place(read_volume(tmp_path / "low"))


def test_links_that_leave_the_disc_are_not_followed(tmp_path: Path) -> None:
    disc = write_disc(tmp_path / "disc")
    first = images(disc)[0]
    first.rename(tmp_path / "elsewhere")
    first.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(FormatError, match="1 of 5 files that DICOMDIR names are missing"):
        read_volume(disc)


@pytest.mark.parametrize("left", [60, 500])
def test_an_index_that_is_cut_off_is_refused(tmp_path: Path, left: int) -> None:
    disc = write_disc(tmp_path / "disc")
    (disc / "DICOMDIR").write_bytes((disc / "DICOMDIR").read_bytes()[:left])
    with pytest.raises(FormatError, match="DICOMDIR"):
        read_volume(disc)


def test_a_name_that_no_file_can_have_is_missing(tmp_path: Path) -> None:
    disc = write_disc(tmp_path / "disc")
    raw = (disc / "DICOMDIR").read_bytes()
    name = images(disc)[0].name.encode()
    (disc / "DICOMDIR").write_bytes(raw.replace(name, b"\0" * len(name)))
    with pytest.raises(FormatError, match="DICOMDIR names are missing"):
        read_volume(disc)
