"""A study of a batch is read from the very files that it was numbered and dated by."""

from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from studies import setting, write_series
from test_io_dicom_index import STORED, write_disc
from tomomesh.cli import main
from tomomesh.io import find_studies, read_volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from tomomesh.io import Study


def series(folder: Path, number: int) -> Path:
    """Write a series whose gray levels are all its number."""
    named = setting(SeriesNumber=number, SeriesInstanceUID=f"1.2.{number}")
    return write_series(folder, np.full((3, 4, 5), number, np.int16), np.eye(4), named)


def moved_up(folder: Path, start: str) -> None:
    for path in list(folder.iterdir()):
        path.rename(folder.parent / f"{start}{path.name}")
    folder.rmdir()


def level(study: Study) -> int:
    """Return the gray level of the series that is read as a study."""
    return int(read_volume(study.path, settings=ReadSettings(series=study.series)).voxels.max())


class TestSeries:
    def test_slices_in_the_folder_and_below_are_numbered_together(self, tmp_path: Path) -> None:
        for number in (5, 6):
            moved_up(series(tmp_path / "s" / "x", number), f"{number}-")
        series(tmp_path / "s" / "sub", 1)
        studies = find_studies(tmp_path / "s")
        assert {one.name: level(one) for one in studies} == {"s-series-1": 1, "s-series-2": 5, "s-series-3": 6}

    def test_a_disc_is_read_by_its_index_once(self, tmp_path: Path) -> None:
        disc, levels = write_disc(tmp_path / "discs" / "a", series=2), [STORED.max(), STORED.max() + 1]
        series(disc / "AAA", 0)  # the index does not name it
        for folder in (disc, disc.parent):
            studies = find_studies(folder)
            assert [one.name for one in studies] == ["a-series-1", "a-series-2"]
            assert [level(one) for one in studies] == levels

    def test_a_broken_disc_is_one_study_that_fails(self, tmp_path: Path) -> None:
        series(tmp_path / "disc" / "a", 1)
        (tmp_path / "disc" / "DICOMDIR").write_bytes(b"x" * 200)
        assert main(["reconstruct", str(tmp_path / "disc"), "--each", "-o", str(tmp_path / "out"), "--quiet"]) == 10
        with (tmp_path / "out" / "reports.csv").open(newline="", encoding="utf-8") as file:
            assert [(row["name"], row["exit_code"]) for row in csv.DictReader(file)] == [("disc", "4")]

    def test_nested_folders_are_a_study_each(self, tmp_path: Path) -> None:
        for patient, visit, number in (("a", "1", 1), ("a", "2", 2), ("b", "1", 3)):
            series(tmp_path / "s" / patient / visit / "series", number)
        (tmp_path / "s" / "notes.txt").write_text("no slice")
        studies = find_studies(tmp_path / "s")
        assert {one.name: level(one) for one in studies} == {"a-series-1": 1, "a-series-2": 2, "b": 3}

    def test_images_in_a_folder_hide_the_slices_below_as_they_do_alone(self, tmp_path: Path) -> None:
        from PIL import Image

        series(tmp_path / "s" / "a" / "dicom", 7)
        for k in range(3):
            Image.fromarray(np.full((4, 5), 50, np.uint8)).save(tmp_path / "s" / "a" / f"{k}.png")
        [study] = find_studies(tmp_path / "s")
        assert [path.name for path in study.files] == ["0.png", "1.png", "2.png"]


class TestState:
    @pytest.mark.parametrize("document", [".zattrs", ".zgroup"])
    def test_an_edited_document_of_a_zarr_store_is_a_change(self, tmp_path: Path, document: str) -> None:
        store = tmp_path / "s" / "a.zarr"
        store.mkdir(parents=True)
        scale: dict[str, Any] = {"scale": [1, 1, 1]}
        (store / document).write_text(json.dumps(scale))
        [before] = find_studies(tmp_path / "s")
        state = before.state
        (store / document).write_text(json.dumps(scale | {"scale": [1, 1, 10]}))
        [after] = find_studies(tmp_path / "s")
        assert after.state != state
