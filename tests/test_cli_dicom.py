"""Faults of DICOM studies at the door: the exit code, one line without patient data, nothing written."""

from __future__ import annotations

import json
import re
import zipfile
from typing import TYPE_CHECKING

import numpy as np
import pydicom
import pytest

from studies import AFFINES, enhanced, sampled, save, setting, slice_dataset, without, write_series
from tomomesh.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from pydicom.dataset import Dataset

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)

PRIVATE = {
    "PatientName": "Zorro^Name", "PatientID": "ZORRO-1", "PatientBirthDate": "19011231", "PatientComments": "Zorro",
    "InstitutionName": "Zorro Hospital", "ReferringPhysicianName": "Zorro^Doctor", "OperatorsName": "Zorro^Nurse",
    "StudyDescription": "Zorro study", "ProtocolName": "Zorro protocol", "AccessionNumber": "ZORRO-2",
    "StudyDate": "19011230", "SeriesDate": "19011230", "AcquisitionDate": "19011230", "StudyTime": "190112",
    "StudyInstanceUID": "1.2.1901", "DeviceSerialNumber": "ZORRO-3",
}  # fmt: skip
"""Everything that must never be said."""


def private(data: Dataset, k: int) -> None:
    for keyword, value in PRIVATE.items():
        setattr(data, keyword, value)


def series(folder: Path, slices: list[int] | None = None, **fields: object) -> Path:
    def edit(data: Dataset, k: int) -> None:
        private(data, k)
        setting(**fields)(data, k)

    return write_series(folder, STORED, AXIAL, edit, slices)


def first(folder: Path) -> Path:
    return next(folder.glob("*-0.dcm"))


def no_image(folder: Path) -> None:
    folder.mkdir()
    (folder / "a.txt").write_text("x")


def cut_header(folder: Path) -> None:
    path = first(series(folder))
    path.write_bytes(path.read_bytes()[:300])


def cut_pixels(folder: Path) -> None:
    path = first(series(folder))
    path.write_bytes(path.read_bytes()[:-9])


def echoes(folder: Path) -> None:
    series(folder, EchoTime=10)
    data = slice_dataset(STORED[2] + 1, AXIAL, 2)
    private(data, 2)
    data.EchoTime = 20
    save(data, folder / "echo.dcm")


def two_series(folder: Path) -> None:
    series(folder)
    for path in series(folder / "x", SeriesInstanceUID="1.9", SeriesNumber=9).iterdir():
        path.rename(folder / f"x{path.name}")


def uneven(folder: Path) -> None:
    places = tuple([-3, 11, z] for z in (40, 42, 44.3, 46, 48))
    series(folder, ImagePositionPatient=places)


def without_place(folder: Path) -> None:
    def edit(data: Dataset, k: int) -> None:
        private(data, k)
        without("ImagePositionPatient")(data, k)

    write_series(folder, STORED, AXIAL, edit)


def with_gap(folder: Path) -> None:
    data = enhanced(STORED, AXIAL, [0, 1, 3, 4])
    private(data, 0)
    save(data, folder / "e.dcm")


def no_scale(folder: Path) -> None:
    with pydicom.config.disable_value_validation():
        series(folder, RescaleIntercept="0", RescaleSlope="0")


def mixed(folder: Path) -> None:
    axes = [[1, 0, 0, 0, 1, 0]] * 4 + [[0, 1, 0, 0, 0, -1]]
    series(folder, ImageOrientationPatient=tuple(axes))


FAULTS: list[tuple[str, Callable[[Path], object], int, str, list[str]]] = [
    ("2: no images", no_image, 4, "0 of 1 files are images", []),
    ("3: a header cut off", cut_header, 4, "--skip-bad", ["--skip-bad"]),
    ("3: pixels cut off", cut_pixels, 4, "--skip-bad", ["--skip-bad"]),
    ("7: a slice missing", lambda folder: series(folder, [0, 1, 3, 4]), 5, "--fill-gaps", ["--fill-gaps"]),
    ("8: two echoes", echoes, 5, r"EchoTime = 10\.0 and 20\.0", []),
    ("9: two series", two_series, 5, r"1: .*slices 5, 0\.5 x 0\.7 x 2 mm; 2: .*--series", ["--series", "1"]),
    ("10: mixed orientations", mixed, 5, "ImageOrientationPatient", []),
    ("11: two spacings", lambda folder: series(folder, PixelSpacing=([1, 1], *[[0.7, 0.5]] * 4)), 5, "Spacing", []),
    ("13: uneven spacing", uneven, 5, "--resample-slices", ["--resample-slices"]),
    ("14: no positions", without_place, 5, "--spacing-z", ["--spacing-z", "2"]),
    ("17: no spacing", lambda folder: series(folder, PixelSpacing=[0, 0]), 5, "PixelSpacing = 0", []),
    ("19: a scale of 0", no_scale, 4, "slope = 0", []),
    ("22: an enhanced file with a gap", with_gap, 5, "--fill-gaps", ["--fill-gaps"]),
    ("24: one slice", lambda folder: series(folder, [0]), 5, "--spacing-z", ["--spacing-z", "2"]),
]


@pytest.mark.parametrize(("make", "code", "said", "flags"), [row[1:] for row in FAULTS], ids=[row[0] for row in FAULTS])
def test_the_line_says_what_helps_and_the_flag_that_it_names_does(
    tmp_path: Path,
    capsys: CaptureFixture[str],
    make: Callable[[Path], object],
    code: int,
    said: str,
    flags: list[str],
) -> None:
    make(tmp_path / "study")
    before = sorted(tmp_path.rglob("*"))
    assert main(["reconstruct", str(tmp_path / "study"), "-o", str(tmp_path / "mesh.stl")]) == code
    *_, line = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert re.search(said, line)
    assert "zorro" not in line.lower()
    assert "1901" not in line
    assert sorted(tmp_path.rglob("*")) == before
    if flags:
        assert main(["inspect", str(tmp_path / "study"), "--json", *flags]) == 0
        out = capsys.readouterr().out
        found = json.loads(out)
        assert found["notes"] or "--series" in flags
        assert "zorro" not in out.lower()
        assert "1901" not in out


def test_an_archive_is_read_and_a_hostile_one_refused(tmp_path: Path, capsys: CaptureFixture[str]) -> None:
    with zipfile.ZipFile(tmp_path / "study.zip", "w") as target:
        for path in series(tmp_path / "study").iterdir():
            target.write(path, path.name)
    assert main(["inspect", str(tmp_path / "study.zip"), "--json"]) == 0
    assert np.allclose(json.loads(capsys.readouterr().out)["spacing_mm"], [0.5, 0.7, 2])
    with zipfile.ZipFile(tmp_path / "hostile.zip", "w") as target:
        target.writestr("../Zorro.dcm", "x")
    assert main(["inspect", str(tmp_path / "hostile.zip")]) == 4
    [line] = capsys.readouterr().err.splitlines()
    assert "would leave its folder" in line
    assert "Zorro" not in line
