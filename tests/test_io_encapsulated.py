"""Meshes for the archive: DICOM Encapsulated STL, read back by pydicom, and by dcmtk and dicom3tools where they are."""

from __future__ import annotations

import io
import json
import shutil
import subprocess
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import pydicom
import pytest
import trimesh

from segmentations import segmentation
from structure_sets import circle, structure_set
from studies import AFFINES, as_ct, save, write_nifti, write_series
from tomomesh import TriMesh, read_mesh
from tomomesh.cli import main
from tomomesh.errors import FormatError, UsageError
from tomomesh.io import frame_of_file, read_volume, write_encapsulated

if TYPE_CHECKING:
    from pathlib import Path

    from pydicom.dataset import Dataset

FRAME, STUDY = "1.2.826.7", "1.2.826.1"
PERSONAL = {
    "PatientName": "Müller^Änne", "PatientID": "SECRET-ID", "PatientBirthDate": "19700102", "PatientSex": "F",
    "StudyDate": "20260101", "StudyTime": "120000", "StudyID": "77", "AccessionNumber": "A-9",
    "ReferringPhysicianName": "House^Gregory",
}  # fmt: skip
AFFINE = AFFINES["oblique"] @ np.diag([2.0, 1.5, 0.5, 1.0])
SHAPE = (16, 16, 16)


def in_archive(data: Dataset, k: int) -> None:
    """Make a slice one of a CT of somebody."""
    as_ct(data, k)
    data.RescaleSlope, data.RescaleIntercept, data.SpecificCharacterSet = 1, 0, "ISO_IR 100"
    data.FrameOfReferenceUID, data.StudyInstanceUID, data.PositionReferenceIndicator = FRAME, STUDY, ""
    for keyword, value in PERSONAL.items():
        setattr(data, keyword, value)


def ball() -> Any:
    """Return the voxels of a ball (K, J, I)."""
    k, j, i = np.indices(SHAPE)
    return (1000 - 60 * np.sqrt((i - 8) ** 2 + (j - 8) ** 2 + (k - 8) ** 2)).astype(np.int16)


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """Return a CT of a ball."""
    return write_series(tmp_path / "ct", ball(), AFFINE, in_archive)


def made(study: Path, output: Path, *options: str) -> int:
    """Reconstruct the ball."""
    return main(
        ["reconstruct", str(study), "--lower", "700", "--way", "voxels", "--quiet", *options, "-o", str(output)]
    )


class TestWritten:
    def test_it_holds_the_mesh_in_the_studys_own_frame(self, study: Path, tmp_path: Path) -> None:
        assert made(study, tmp_path / "m.dcm", "--frame", "ras") == 0
        assert made(study, tmp_path / "m.stl") == 0
        data = pydicom.dcmread(tmp_path / "m.dcm")
        assert data.SOPClassUID == pydicom.uid.EncapsulatedSTLStorage == data.file_meta.MediaStorageSOPClassUID
        assert (data.FrameOfReferenceUID, data.StudyInstanceUID, data.Modality) == (FRAME, STUDY, "M3D")
        assert data.MIMETypeOfEncapsulatedDocument == "model/stl"
        assert data.MeasurementUnitsCodeSequence[0].CodeValue == "mm"
        document = data.EncapsulatedDocument[: data.EncapsulatedDocumentLength]
        assert document == (tmp_path / "m.stl").read_bytes()
        judge = trimesh.load(io.BytesIO(document), file_type="stl")
        assert judge.is_watertight
        np.testing.assert_allclose(judge.center_mass, (AFFINE @ [8, 8, 8, 1])[:3], atol=0.02)
        slices = {str(pydicom.dcmread(path).SOPInstanceUID) for path in study.iterdir()}
        assert {str(one.ReferencedSOPInstanceUID) for one in data.SourceInstanceSequence} == slices

    def test_personal_fields_are_there_where_they_are_asked_for_alone(self, study: Path, tmp_path: Path) -> None:
        assert made(study, tmp_path / "without.dcm") == made(study, tmp_path / "with.dcm", "--patient") == 0
        without, named = (pydicom.dcmread(tmp_path / f"{name}.dcm") for name in ("without", "with"))
        for keyword, value in PERSONAL.items():
            assert str(without[keyword].value or "") == ""
            assert str(named[keyword].value) == value
        raw = (tmp_path / "without.dcm").read_bytes()
        assert not any(
            value.encode(code) in raw for value in PERSONAL.values() if len(value) > 3 for code in ("utf8", "latin1")
        )
        assert without.SOPInstanceUID != named.SOPInstanceUID

    def test_the_bytes_repeat(self, study: Path, tmp_path: Path) -> None:
        for name in "ab":
            assert made(study, tmp_path / f"{name}.dcm") == 0
        assert (tmp_path / "a.dcm").read_bytes() == (tmp_path / "b.dcm").read_bytes()

    def test_other_programs_find_no_fault(self, study: Path, tmp_path: Path) -> None:
        tools = [[tool, *rest] for tool, *rest in (("dcmdump", "+P", "0020,0052"), ("dciodvfy",)) if shutil.which(tool)]
        if not tools:
            pytest.skip("neither dcmtk nor dicom3tools is installed")
        assert made(study, tmp_path / "m.dcm", "--patient") == 0
        for tool in tools:
            told = subprocess.run([*tool, str(tmp_path / "m.dcm")], capture_output=True, text=True, check=True)
            assert "error" not in (told.stdout + told.stderr).lower()
            assert tool[0] != "dcmdump" or FRAME in told.stdout

    def test_we_read_what_we_write(self, study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert made(study, tmp_path / "m.dcm") == made(study, tmp_path / "m.stl") == 0
        one, other = (read_mesh(tmp_path / f"m.{kind}") for kind in ("dcm", "stl"))
        np.testing.assert_array_equal(one.vertices, other.vertices)
        np.testing.assert_array_equal(one.faces, other.faces)
        assert main(["check", str(tmp_path / "m.dcm")]) == 0
        assert "closed, manifold, outward" in capsys.readouterr().out

    def test_it_is_in_the_frame_of_its_study(
        self, study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert made(study, tmp_path / "m.dcm", "--frame", "ras") == 0
        assert frame_of_file(tmp_path / "m.dcm") == {"unit": "mm", "frame": "LPS"}
        assert main(["check", str(tmp_path / "m.dcm"), "--against", str(study), "--lower", "700", "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["dice"] > 0.99
        assert found["against"]["notes"] == []

    @pytest.mark.parametrize(("code", "size"), [("um", 1e-3), ("[in_i]", 25.4), ("cm", 10.0), ("furlong", 1.0)])
    def test_the_unit_is_the_one_that_it_states(self, study: Path, tmp_path: Path, code: str, size: float) -> None:
        assert made(study, tmp_path / "m.dcm") == 0
        data = pydicom.dcmread(tmp_path / "m.dcm")
        data.MeasurementUnitsCodeSequence[0].CodeValue = code
        data.save_as(tmp_path / "other.dcm")
        assert main(["print", str(tmp_path / "other.dcm"), "-o", str(tmp_path / "part.stl"), "--quiet"]) == 0
        one, other = read_mesh(tmp_path / "m.dcm"), read_mesh(tmp_path / "part.stl")
        np.testing.assert_allclose(np.ptp(other.vertices, axis=0), size * np.ptp(one.vertices, axis=0), rtol=1e-5)

    def test_dcmtk_makes_one_that_we_read(self, study: Path, tmp_path: Path) -> None:
        """It states micrometers where it is not told."""
        tool = shutil.which("stl2dcm")
        if tool is None:
            pytest.skip("dcmtk is not installed")
        assert made(study, tmp_path / "m.stl") == 0
        for name, told in (("um", []), ("mm", ["--measurement-units", "UCUM", "mm", "mm"])):
            path = tmp_path / f"{name}.dcm"
            source = ["--study-from", str(next(study.iterdir()))]
            subprocess.run([tool, *source, *told, str(tmp_path / "m.stl"), str(path)], capture_output=True, check=True)
            assert frame_of_file(path) == {"unit": name, "frame": "LPS"}
            np.testing.assert_array_equal(read_mesh(path).vertices, read_mesh(tmp_path / "m.stl").vertices)

    def test_a_lone_file_of_a_study_is_no_mesh_to_compare_with(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        mask = ball() > 700
        save(segmentation({1: mask}, AFFINE), tmp_path / "seg.dcm")
        line = f"reconstruct {tmp_path}/seg.dcm --select 1 --network none --quiet -o {tmp_path}/m.ply"
        assert main(line.split()) == 0
        assert main(f"check {tmp_path}/m.ply --against {tmp_path}/seg.dcm --select liver --json".split()) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["against"]["against"] == "labels"
        assert found["dice"] > 0.95

    def test_it_is_no_slice_of_its_study(self, study: Path, tmp_path: Path) -> None:
        assert made(study, tmp_path / "m.dcm") == 0
        shutil.copy(tmp_path / "m.dcm", study / "m.dcm")
        volume = read_volume(study)
        assert volume.shape == SHAPE
        assert volume.notes[0] == "left out: 1 DICOM without pixels"


class TestRefused:
    def test_a_study_that_is_no_dicom(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        path = write_nifti(tmp_path / "s.nii", ball(), AFFINE)
        assert made(path, tmp_path / "m.dcm") == UsageError.exit_code
        assert "belongs to a DICOM study" in capsys.readouterr().err
        assert not (tmp_path / "m.dcm").exists()

    def test_a_study_without_a_frame_of_reference(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert made(write_series(tmp_path / "s", ball(), AFFINE, as_ct), tmp_path / "m.dcm") == UsageError.exit_code
        assert "UID = missing" in capsys.readouterr().err

    def test_a_study_in_several_frames_of_reference(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        def moved(data: Dataset, k: int) -> None:
            in_archive(data, k)
            data.FrameOfReferenceUID = f"1.2.826.{7 + k // 8}"

        study = write_series(tmp_path / "moved", ball(), AFFINE, moved)
        assert made(study, tmp_path / "m.dcm") == UsageError.exit_code
        assert "FrameOfReferenceUID = several" in capsys.readouterr().err
        assert made(study, tmp_path / "m.stl") == 0

    def test_what_does_not_go_with_it(self, study: Path, tmp_path: Path) -> None:
        assert made(study, tmp_path / "m.stl", "--patient") == UsageError.exit_code
        assert made(study, tmp_path / "m.dcm", "--scale", "0.5") == UsageError.exit_code
        assert made(study, tmp_path / "m.dcm", "--frame", "voxel") == UsageError.exit_code
        assert list(tmp_path.iterdir()) == [study]
        save(structure_set({"Bone": [circle(5.0, z) for z in (0.0, 1, 2)]}), tmp_path / "rt.dcm")
        assert main(["surface", str(tmp_path / "rt.dcm"), "-o", str(tmp_path / "m.dcm")]) == UsageError.exit_code

    def test_dicom_that_holds_no_mesh(self, study: Path) -> None:
        with pytest.raises(FormatError, match="holds no mesh"):
            read_mesh(next(study.iterdir()))

    def test_a_document_that_is_cut_off(self, study: Path, tmp_path: Path) -> None:
        assert made(study, tmp_path / "m.dcm") == 0
        data = pydicom.dcmread(tmp_path / "m.dcm")
        data.EncapsulatedDocument = data.EncapsulatedDocument[:2000]
        with pytest.raises(FormatError, match="cut off"):
            read_mesh(save(data, tmp_path / "short.dcm"))

    def test_nothing_is_told_of_the_patient(
        self, study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        report = tmp_path / "r.json"
        assert made(study, tmp_path / "m.dcm", "--patient", "--report", str(report)) == 0
        said = "".join(capsys.readouterr()) + report.read_text() + repr(read_volume(study))
        assert not any(value in said for value in PERSONAL.values() if len(value) > 3)

    @pytest.mark.filterwarnings("ignore:Invalid value for VR")  # of the study that is made here
    def test_nor_where_the_patients_fields_break_the_rules(
        self, tmp_path: Path, caplog: pytest.LogCaptureFixture
    ) -> None:
        """An old birth date with points in it: copied as it is, and never in a warning or a log."""

        def old(data: Dataset, k: int) -> None:
            in_archive(data, k)
            data.PatientBirthDate = "1970.01.02"

        study = write_series(tmp_path / "old", ball(), AFFINE, old)
        caplog.clear()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert made(study, tmp_path / "m.dcm", "--patient") == 0
        assert pydicom.dcmread(tmp_path / "m.dcm").PatientBirthDate == "1970.01.02"
        assert "1970" not in caplog.text

    def test_a_mesh_of_python_needs_its_study_too(self, tmp_path: Path) -> None:
        corner = TriMesh(np.eye(4, 3, -1), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
        with pytest.raises(UsageError, match="StudyInstanceUID = missing"):
            write_encapsulated(corner, tmp_path / "m.dcm", {})
