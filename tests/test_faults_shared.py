"""The broken files among the public data, through the command line: what each must end in."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from doors import contents, reconstructing, refused
from studies import shared
from tomomesh.cli import main

if TYPE_CHECKING:
    from _pytest.capture import CaptureFixture

STUDIES = {
    "bad_datatype.nii.gz": 4,
    "corrupt_gzip_crc.nii.gz": 4,
    "dim_huge_bomb.nii.gz": 7,
    "dim_zero.nii.gz": 4,
    "empty.nii.gz": 4,
    "missing_raw.mhd": 4,
    "no_ipp.dcm": 5,
    "no_pixelspacing.dcm": 5,
    "pixdim_zero.nii.gz": 5,
    "sizes_mismatch.nrrd": 4,
    "text_named.dcm": 4,
    "truncated.mha": 4,
    "truncated_data.nii": 4,
    "truncated_header.dcm": 4,
}
CLOUDS = {
    "header_only.ply": 4,
    "lying_count_binary.ply": 4,
    "nan_points.xyz": 4,
    "ragged.xyz": 4,
}
ODD_CLOUDS = ("collinear.xyz", "duplicates.xyz", "huge_offset_sphere.xyz", "one_point.xyz", "two_spheres_far.xyz")
SERIES = {"gantrytilting": 0, "slicecount": 0, "sliceincrement": 5, "sliceorientation": 5}
"""Exit codes of ``reconstruct``: a tilt is followed, and two slices are enough here."""


def copied(name: str, folder: Path) -> Path:
    """Copy a file beside nothing else, so that whatever is left there is seen."""
    source = shared("malformed") / name
    if not source.exists():
        pytest.skip(f"{name} is not among the public data here")
    return Path(shutil.copy(source, folder / name))


@pytest.mark.parametrize("name", STUDIES)
def test_studies_are_refused(tmp_path: Path, capsys: CaptureFixture[str], name: str) -> None:
    said = refused(reconstructing(copied(name, tmp_path), tmp_path), STUDIES[name], tmp_path, capsys)
    assert name in said


@pytest.mark.parametrize("name", STUDIES)
def test_so_they_are_by_segment(tmp_path: Path, capsys: CaptureFixture[str], name: str) -> None:
    line = ["segment", str(copied(name, tmp_path)), "-o", str(tmp_path / "p.ply")]
    refused(line, STUDIES[name], tmp_path, capsys)


@pytest.mark.parametrize("name", STUDIES)
def test_inspect_refuses_them_or_tells_that_they_are_refused(
    tmp_path: Path, capsys: CaptureFixture[str], name: str
) -> None:
    path = copied(name, tmp_path)
    if not (STUDIES[name] == 5 and name.endswith(".dcm")):
        refused(["inspect", str(path)], STUDIES[name], tmp_path, capsys)
        return
    before = contents(tmp_path)
    assert main(["inspect", str(path)]) == 0
    assert f"refused   exit {STUDIES[name]}: " in capsys.readouterr().out
    assert contents(tmp_path) == before


def test_a_cut_picture_is_refused(tmp_path: Path, capsys: CaptureFixture[str]) -> None:
    copied("truncated.png", tmp_path)
    refused(reconstructing(tmp_path, tmp_path, "--spacing", "1", "1", "1"), 4, tmp_path, capsys)


@pytest.mark.parametrize("name", CLOUDS)
def test_clouds_are_refused(tmp_path: Path, capsys: CaptureFixture[str], name: str) -> None:
    path = copied(name, tmp_path)
    refused(["surface", str(path), "-o", str(tmp_path / "m.stl")], CLOUDS[name], tmp_path, capsys)


@pytest.mark.parametrize("name", ODD_CLOUDS)
def test_odd_clouds_are_closed_or_refused(tmp_path: Path, capsys: CaptureFixture[str], name: str) -> None:
    path, mesh = copied(name, tmp_path), tmp_path / "m.ply"
    before = contents(tmp_path)
    code = main(["surface", str(path), "-o", str(mesh), "--quiet"])
    assert code in (0, 5, 7), capsys.readouterr().err
    assert mesh.exists() == (code == 0)
    mesh.unlink(missing_ok=True)
    assert contents(tmp_path) == before


def test_every_broken_file_is_tried() -> None:
    known = {*STUDIES, *CLOUDS, *ODD_CLOUDS, "truncated.png", "no_qform_no_sform.nii.gz"}
    assert {path.name for path in shared("malformed").iterdir() if path.name != "README.md"} <= known


@pytest.mark.parametrize("name", SERIES)
def test_series_that_fail_elsewhere(tmp_path: Path, capsys: CaptureFixture[str], name: str) -> None:
    source = shared("dicom2nifti/failing") / name
    if not source.exists():
        pytest.skip(f"{name} is not among the public data here")
    shutil.copytree(source, tmp_path / "s")
    line = ["inspect", str(tmp_path / "s")]
    before = contents(tmp_path)
    assert main(line) == 0
    assert ("refused   exit 5: " in capsys.readouterr().out) == (SERIES[name] == 5)
    assert contents(tmp_path) == before
    if SERIES[name]:
        refused(reconstructing(tmp_path / "s", tmp_path), SERIES[name], tmp_path, capsys)
