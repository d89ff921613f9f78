"""What `tomomesh inspect` tells: every series, what would be refused, and the command that goes on."""

from __future__ import annotations

import ast
import json
import re
import shlex
import subprocess
import sys
import zipfile
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pydicom
import pytest

import tomomesh
from studies import AFFINES, affine_of, as_ct, sampled, save, setting, shared, slice_dataset, write_nifti, write_series
from test_cli_dicom import PRIVATE, private
from tomomesh.cli import main
from tomomesh.cli.inspect.inspection import REFUSALS
from tomomesh.io import list_series
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from _pytest.capture import CaptureFixture
    from pydicom.dataset import Dataset

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)
TILTED = affine_of(np.eye(3)) + np.outer([0, 0.5, 0, 0], [0, 0, 1, 0])
"""Slices 2 mm apart, each shifted by 0.5 mm towards the back."""


def found(path: Path, capsys: CaptureFixture[str], *flags: str) -> dict[str, Any]:
    assert main(["inspect", str(path), "--json", *flags]) == 0
    return dict(json.loads(capsys.readouterr().out))


def told(path: Path, capsys: CaptureFixture[str], *flags: str) -> list[str]:
    assert main(["inspect", str(path), *flags]) == 0
    return capsys.readouterr().out.splitlines()


def _manual_of(command: str) -> str:
    with pytest.raises(SystemExit), redirect_stdout(StringIO()) as said:
        main([command, "--help"])
    return said.getvalue()


def scanner(folder: Path) -> Path:
    """Write a localizer, a sound series, one with a gap, one slice alone, and files that are none."""
    write_series(folder / "a", STORED, AXIAL, setting(SeriesNumber=1, SeriesInstanceUID="1.1", ImageType="LOCALIZER"))
    named = setting(SeriesNumber=2, SeriesInstanceUID="1.2", SeriesDescription="thin\x1b[2J\nsoft")
    write_series(folder / "b", STORED, AXIAL, named, [0, 1])
    write_series(folder / "c", STORED, TILTED, setting(SeriesNumber=3, SeriesInstanceUID="1.3"), [0, 1, 2, 4])
    write_series(folder / "d", STORED, AXIAL, setting(SeriesNumber=9, SeriesInstanceUID="1.9"), [0])
    (folder / "notes.txt").write_text("x" * 200)
    (folder / "bad.dcm").write_bytes(next((folder / "b").iterdir()).read_bytes()[:300])
    return folder


class TestTable:
    def test_every_series_is_described_from_its_headers(self, tmp_path: Path) -> None:
        folder = scanner(tmp_path)
        for path in folder.rglob("*-*.dcm"):
            data = pydicom.dcmread(path)
            del data.PixelData
            data.save_as(path)
        listing = list_series(folder)
        sound, gapped, single = listing.series
        assert [one.number for one in listing.series] == [1, 2, 3]
        assert [one.slices for one in listing.series] == [2, 4, 1]
        assert {one.size for one in listing.series} == {(7, 9)}
        assert [one.pixel_mm for one in listing.series] == [pytest.approx((0.5, 0.7))] * 3
        assert sound.refused is None
        assert sound.slice_spacing.distances_mm == pytest.approx((2, 2))
        assert sound.slice_spacing.tilt_deg == pytest.approx(0, abs=1e-4)
        assert gapped.slice_spacing.distances_mm == pytest.approx((2, 4))
        assert gapped.slice_spacing.tilt_deg == pytest.approx(np.degrees(np.arctan2(0.5, 2)))
        assert np.allclose(gapped.slice_spacing.gaps_mm, [(44, 48)])
        assert gapped.slice_spacing.missing == 1
        assert "--fill-gaps" in str(gapped.refused)
        assert single.slice_spacing.distances_mm is None
        assert "--spacing-z" in str(single.refused)
        assert dict(listing.left_out) == {"localizers": 5, "not DICOM": 1, "unreadable": 1}

    def test_flags_change_the_verdict(self, tmp_path: Path) -> None:
        listing = list_series(scanner(tmp_path), settings=ReadSettings(fill_gaps=True, spacing_z=2.0))
        assert [one.refused for one in listing.series] == [None] * 3

    def test_it_is_aligned_within_a_hundred_columns(
        self, tmp_path: Path, capsys: CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        scanner(tmp_path / "s")
        monkeypatch.chdir(tmp_path)
        lines = told(Path("s"), capsys, "--skip-bad")
        heading, *rows = lines[:4]
        for name, cells in (("modality", ["MR"] * 3), ("verdict", ["read", "exit 5", "exit 5"])):
            at = heading.index(name)
            assert [row[at:].split("  ")[0] for row in rows] == cells
        for name, cells in (("slices", ["2", "4", "1"]), ("missing", ["", "1", ""]), ("tilt", ["", "14.0 deg", ""])):
            end = heading.index(name) + len(name)
            assert [row[:end].split("  ")[-1].strip() for row in rows] == cells
        assert "thin [2J soft" in rows[0]
        assert heading.index("description") <= 100
        assert max(map(len, lines[4:-1])) <= 100
        assert "left out  5 localizers, 1 not DICOM, 1 unreadable" in lines
        assert lines[-1].endswith("--skip-bad --series 2 --fill-gaps")

    def test_slices_at_one_place_are_counted(self, tmp_path: Path) -> None:
        save(slice_dataset(STORED[1], AXIAL, 1), write_series(tmp_path, STORED, AXIAL) / "again.dcm")
        [series] = list_series(tmp_path).series
        assert (series.slice_spacing.repeats, series.slices) == (1, 6)

    @pytest.mark.parametrize("fields", [{"PixelSpacing": [0, 0]}, {"ImageOrientationPatient": [0.0] * 6}])
    def test_a_geometry_of_no_sense_is_no_distance(self, tmp_path: Path, fields: dict[str, Any]) -> None:
        [series] = list_series(write_series(tmp_path, STORED, AXIAL, setting(**fields))).series
        assert series.slice_spacing.distances_mm is None
        assert series.refused is not None

    def test_what_is_no_dicom_has_no_series(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        path = write_nifti(tmp_path / "a.nii", STORED, AXIAL)
        assert list_series(path).series == ()
        assert found(path, capsys)["series"] == []

    def test_an_archive_and_a_folder_say_the_same(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        folder = scanner(tmp_path / "study")
        with zipfile.ZipFile(tmp_path / "study.zip", "w") as target:
            for path in folder.rglob("*.*"):
                target.write(path, path.relative_to(folder))
        inside, outside = found(tmp_path / "study.zip", capsys), found(folder, capsys)
        assert json.dumps(inside).replace("study.zip", "study") == json.dumps(outside)


class TestRefusal:
    def test_the_command_that_it_names_goes_on(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        """From several series with a broken file to a study that is read, by nothing but the commands it prints."""
        line = ["tomomesh", "inspect", str(scanner(tmp_path / "a study"))]
        codes = []
        while line[1] == "inspect":
            assert main([*line[1:], "--json"]) == 0
            said = json.loads(capsys.readouterr().out)
            codes.append(said["refused"] and said["refused"]["exit_code"])
            line = shlex.split(said["next"])
        assert codes == [4, 5, None]
        assert line[2:] == [str(tmp_path / "a study"), "--series", "2", "--fill-gaps", "--skip-bad", "-o", "mesh.stl"]

    def test_it_is_the_one_of_reconstruct(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL, slices=[0, 1, 3, 4])
        refused = found(folder, capsys)["refused"]
        assert main(["reconstruct", str(folder), "-o", str(tmp_path / "m.stl")]) == refused["exit_code"] == 5
        assert capsys.readouterr().err.splitlines()[-1] == f"error: {refused['error']}"
        words = " ".join(" ".join(told(folder, capsys)).split())
        assert f"refused exit 5: {refused['error']}" in words

    def test_what_helps_is_known_without_reading_words(self) -> None:
        """Every refusal of a DICOM study whose hint names an option of reading says so to programs too."""
        options = {*re.findall(r"--[a-z][a-z-]+", _manual_of("inspect")), "--select"}
        kinds = {kind.__name__ for kind in REFUSALS}
        named = 0
        for path in (Path(tomomesh.__file__).parent / "io/dicom").rglob("*.py"):
            for call in ast.walk(ast.parse(path.read_text())):
                if not isinstance(call, ast.Call) or ast.unparse(call.func) not in kinds:
                    continue
                given = {word.arg: ast.unparse(word.value) for word in call.keywords}
                hinted = set(re.findall(r"--[a-z][a-z-]+", given.get("hint", ""))) & options
                assert set(ast.literal_eval(given.get("flags", "()"))) == hinted, (path.name, given)
                named += bool(hinted)
        assert named >= 8

    @pytest.mark.parametrize("name", ["a Try: --fill-gaps", "Try: --series --skip-bad"])
    def test_a_name_of_a_study_puts_no_words_into_its_mouth(
        self, name: str, tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        axes = ([1, 0, 0, 0, 1, 0],) * 4 + ([0, 1, 0, 0, 0, -1],)
        said = found(write_series(tmp_path / name, STORED, AXIAL, setting(ImageOrientationPatient=axes)), capsys)
        assert said["refused"]["exit_code"] == 5
        assert said["next"] is None

    def test_no_flag_no_command(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        axes = ([1, 0, 0, 0, 1, 0],) * 4 + ([0, 1, 0, 0, 0, -1],)
        said = found(write_series(tmp_path, STORED, AXIAL, setting(ImageOrientationPatient=axes)), capsys)
        assert said["refused"]["exit_code"] == 5
        assert said["next"] is None

    def test_where_nothing_can_be_said_it_fails(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        (tmp_path / "empty").mkdir()
        (tmp_path / "x.dcm").write_bytes(b"x" * 200)
        (tmp_path / "x.zip").write_bytes(b"PK\x03\x04" + b"x" * 200)
        (tmp_path / "x.abc").write_bytes(b"x" * 200)
        whole = save(slice_dataset(STORED[0], AXIAL, 0), tmp_path / "cut.dcm").read_bytes()
        (tmp_path / "cut.dcm").write_bytes(whole[:-9])
        codes = {"gone": 3, "empty": 3, "x.dcm": 4, "x.zip": 4, "x.abc": 4, "cut.dcm": 4}
        for name, code in codes.items():
            assert main(["inspect", str(tmp_path / name), "--spacing-z", "1"]) == code, name
        assert main(["inspect", str(scanner(tmp_path / "s")), "--series", "9", "--skip-bad"]) == 2
        assert len(capsys.readouterr().err.splitlines()) == len(codes) + 1


class TestRemarks:
    def test_windows_are_told_where_they_are_cut_off(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        stored = np.zeros((6, 8, 10), np.int16)
        stored[3:, 2:6, 4:] = 100
        windows = found(write_nifti(tmp_path / "a.nii", stored, np.eye(4)), capsys)["windows"]
        assert windows["otsu"]["cut_off_at"] == ["S", "L"]

    def test_what_a_mesh_will_show_is_told(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        thick = affine_of(np.eye(3), spacing=(0.5, 0.5, 4.0))
        [remark] = found(write_nifti(tmp_path / "a.nii", sampled(thick), thick), capsys)["remarks"]
        assert "8.0 pixels apart" in remark
        [remark] = found(write_nifti(tmp_path / "b.nii", STORED, AXIAL), capsys)["remarks"]
        assert "0.5 x 0.7 mm" in remark


@pytest.mark.parametrize("numbers", [(4,), (4, 9)])
def test_no_patient_is_named(tmp_path: Path, capsys: CaptureFixture[str], numbers: tuple[int, ...]) -> None:
    """Only the description of a series is told, and only where there are several to choose from."""

    def edit(data: Dataset, k: int) -> None:
        private(data, k)
        as_ct(data, k)
        data.SeriesDescription = "picked"

    for number in numbers:
        for path in write_series(tmp_path / str(number), STORED, AXIAL, edit).iterdir():
            data = pydicom.dcmread(path)
            data.SeriesNumber = number
            data.save_as(path)
    words = (" ".join(told(tmp_path, capsys)) + json.dumps(found(tmp_path, capsys))).replace(str(tmp_path), "")
    assert "CT" in words
    assert ("picked" in words) == (len(numbers) > 1)
    for secret in ("zorro", "secret", "1901", *PRIVATE.values()):
        assert secret.lower() not in words.lower()


class TestSharedStudies:
    def test_three_vendors_in_one_folder(self, capsys: CaptureFixture[str]) -> None:
        said = found(shared("derived/mixed_multi_series"), capsys)
        assert [one["slices"] for one in said["series"]] == [1, 4, 4]
        assert said["next"].endswith("--series 2")

    def test_a_tilted_uneven_head(self, capsys: CaptureFixture[str]) -> None:
        said = found(shared("dcm_qa_ct/In/GE"), capsys)
        [series] = said["series"]
        assert series["tilt_deg"] == pytest.approx(18.5, abs=0.01)
        assert series["distances_mm"] == pytest.approx([1.081, 6.999], abs=1e-3)
        assert said["next"].endswith("--resample-slices")

    @pytest.mark.parametrize(
        ("name", "ending"),
        [
            ("sliceincrement", "--fill-gaps"),
            ("sliceorientation", "--series 1"),
            ("gantrytilting", "-o mesh.stl"),
            ("slicecount", "-o mesh.stl"),
        ],
    )
    def test_studies_that_others_fail_on(self, name: str, ending: str, capsys: CaptureFixture[str]) -> None:
        assert found(shared(f"dicom2nifti/failing/{name}/001"), capsys)["next"].endswith(ending)

    def test_a_body_and_its_labels(self, capsys: CaptureFixture[str]) -> None:
        [series] = list_series(shared("totalsegmentator/example_ct_dicom")).series
        assert (series.slices, series.size, series.refused) == (20, (512, 512), None)


@pytest.mark.parametrize(("edge", "extent"), [(5e-6, "3e-05 x 3e-05 x 3e-05"), (4000.0, "24000 x 24000 x 24000")])
def test_the_extent_of_a_micrograph_is_not_nothing(
    tmp_path: Path, capsys: CaptureFixture[str], edge: float, extent: str
) -> None:
    path = write_nifti(tmp_path / "s.nii", np.arange(216, dtype=np.int16).reshape(6, 6, 6), np.diag([edge] * 3 + [1]))
    assert f"extent    {extent} mm, first voxel at (0, 0, 0) mm LPS" in told(path, capsys)


def test_a_study_of_a_stream_is_named_as_typed(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "study.zip", "w") as target:
        for path in write_series(tmp_path / "s", STORED, AXIAL, slices=[0, 1, 3]).iterdir():
            target.write(path, path.name)
    program = "import sys; from tomomesh.cli import main; sys.exit(main())"
    line = [sys.executable, "-c", program, "inspect", "-", "--input-format", "zip", "--json"]
    done = subprocess.run(line, input=(tmp_path / "study.zip").read_bytes(), capture_output=True, check=True)
    said = json.loads(done.stdout)
    assert "File: - [gap" in said["refused"]["error"]
    assert said["series"][0]["refused"] == said["refused"]
    assert said["next"] == "tomomesh inspect - --input-format zip --fill-gaps"
