"""Which of the series in a folder is read."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from studies import AFFINES, assert_in_place, sampled, save, setting, slice_dataset, write_series
from tomomesh.errors import FormatError, GeometryError, UsageError
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from pydicom.dataset import Dataset

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)


class TestSeries:
    def two(self, folder: Path, slices: list[int]) -> Path:
        write_series(folder, STORED, AXIAL, setting(SeriesDescription="thick \x1b[31m"))

        def edit(data: Dataset, k: int) -> None:
            data.SeriesInstanceUID, data.SeriesNumber = "1.2.4", 2

        write_series(folder / "x", STORED + 1, AXIAL, edit, slices)
        for path in (folder / "x").iterdir():
            path.rename(folder / f"other-{path.name}")
        (folder / "x").rmdir()
        return folder

    def test_several_series_need_a_choice_and_are_listed(self, tmp_path: Path) -> None:
        folder = self.two(tmp_path / "s", [0, 1, 2])
        with pytest.raises(GeometryError) as caught:
            read_volume(folder)
        text = str(caught.value)
        assert "1: no description, slices 3, 0.5 x 0.7 x 2 mm" in text
        assert "2: thick ?[31m, slices 5" in text
        assert "--series" in text
        assert "ecret" not in text
        assert "SECRET" not in text

    def test_the_chosen_series_is_read(self, tmp_path: Path) -> None:
        folder = self.two(tmp_path / "s", [0, 1, 2])
        assert_in_place(read_volume(folder, settings=ReadSettings(series=2)))
        assert read_volume(folder, settings=ReadSettings(series=1)).shape == (3, 7, 9)
        with pytest.raises(UsageError, match="no such series"):
            read_volume(folder, settings=ReadSettings(series=3))
        with pytest.raises(UsageError, match="at least 1"):
            ReadSettings(series=0)

    def test_the_only_candidate_is_taken_and_said(self, tmp_path: Path) -> None:
        volume = read_volume(self.two(tmp_path / "s", [0]))
        assert_in_place(volume)
        assert "series 2 of 2" in volume.notes[0]

    def test_localizers_are_left_out_and_said(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        scout = slice_dataset(STORED[0], AFFINES["sagittal"], 0)
        scout.ImageType = ["ORIGINAL", "PRIMARY", "LOCALIZER"]
        save(scout, folder / "scout.dcm")
        volume = read_volume(folder)
        assert_in_place(volume)
        assert volume.notes == ("localizers left out: 1",)

    def test_files_that_are_no_images_are_counted(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        (folder / "notes.txt").write_text("x" * 200)
        report = slice_dataset(STORED[0], AXIAL, 0)
        report.SOPClassUID = report.file_meta.MediaStorageSOPClassUID = "1.2.840.10008.5.1.4.1.1.88.11"
        for keyword in ("Rows", "Columns", "PixelData"):
            delattr(report, keyword)
        save(report, folder / "report.dcm")
        volume = read_volume(folder)
        assert_in_place(volume)
        assert volume.notes == ("left out: 1 DICOM without pixels, 1 not DICOM",)
        for path in folder.glob("*-*.dcm"):
            path.unlink()
        with pytest.raises(FormatError, match="0 of 2 files are images"):
            read_volume(folder)

    def test_series_in_sub_folders_are_listed_beside_those_in_the_folder(self, tmp_path: Path) -> None:
        write_series(tmp_path / "s", STORED, AXIAL)
        write_series(tmp_path / "s" / "more", STORED + 1, AXIAL, setting(SeriesInstanceUID="1.9", SeriesNumber=9))
        with pytest.raises(GeometryError, match="2 series"):
            read_volume(tmp_path / "s")
        assert_in_place(read_volume(tmp_path / "s", settings=ReadSettings(series=1)))
