"""Segmentations and structure sets among the files of a study: never its slices, and read or named where alone."""

from __future__ import annotations

import json
import shlex
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pydicom.uid import EncapsulatedPDFStorage

from segmentations import segmentation, written
from structure_sets import circle, structure_set
from studies import AFFINES, as_ct, sampled, save, slice_dataset, write_series
from tomomesh.cli import main
from tomomesh.errors import FormatError
from tomomesh.io import find_studies, list_series, read_volume

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)


def masks() -> dict[int, Any]:
    """Return two segments that overlap."""
    both = {number: np.zeros(STORED.shape, bool) for number in (1, 2)}
    both[1][1:3, 2:5, 2:5] = both[2][2:4, 3:6, 3:6] = True
    return both


def report(path: Path) -> Path:
    """Write a DICOM file that is neither an image nor one of those."""
    data = slice_dataset(STORED[0], AXIAL, 0)
    data.SOPClassUID = data.file_meta.MediaStorageSOPClassUID = EncapsulatedPDFStorage
    for keyword in ("Rows", "Columns", "PixelData"):
        delattr(data, keyword)
    return save(data, path)


class TestAmongSlices:
    def test_a_segmentation_is_left_out(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "ct", STORED, AXIAL, as_ct)
        other = segmentation(masks(), AXIAL)
        other.SeriesInstanceUID, other.SeriesNumber = "1.9", 9
        save(other, folder / "seg.dcm")
        volume = read_volume(folder)
        np.testing.assert_array_equal(volume.voxels, read_volume(write_series(tmp_path / "c", STORED, AXIAL)).voxels)
        assert volume.notes == ("left out: 1 segmentations",)
        listing = list_series(folder)
        assert [one.modality for one in listing.series] == ["CT"]
        assert dict(listing.left_out)["segmentations"] == 1
        assert [(one.name, one.series) for one in find_studies(tmp_path) if one.path == folder] == [("ct", None)]

    def test_several_segmentations_are_not_merged(self, tmp_path: Path) -> None:
        for name in ("a", "b"):
            written(masks(), AXIAL, tmp_path / "s" / f"{name}.dcm")
        with pytest.raises(FormatError, match=r"0 of 2 files are images.*2 segmentations.*one of the segmentations"):
            read_volume(tmp_path / "s", select=(1,))


class TestInspect:
    @pytest.mark.parametrize("name", ["", "seg.dcm"])
    def test_segments_that_overlap_are_told_and_the_command_for_one_goes_on(
        self, tmp_path: Path, capsys: CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str
    ) -> None:
        monkeypatch.chdir(tmp_path)
        path = written(masks(), AXIAL, tmp_path / "s" / "seg.dcm").parent / name
        assert main(["inspect", str(path)]) == 0
        said = capsys.readouterr().out.splitlines()
        assert said[0] == "segments  1 Liver, 2 Left [31m kidney"
        assert said[1].startswith("refused   exit 5: segments overlap")
        assert said[-1] == f"next      tomomesh reconstruct --labels-in {path} --select 1 -o mesh.stl"
        assert main([*shlex.split(said[-1])[2:], "--network", "none", "--quiet"]) == 0
        assert main(["inspect", str(path), "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["segments"] == {"1": "Liver", "2": "Left [31m kidney"}
        assert found["refused"]["exit_code"] == 5
        assert main(["reconstruct", str(path), "-o", "m.stl"]) == 5

    def test_a_broken_segmentation_is_refused(self, tmp_path: Path) -> None:
        path = written(masks(), AXIAL, tmp_path / "seg.dcm")
        path.write_bytes(path.read_bytes()[:-20])
        assert main(["inspect", str(path)]) == 4


class TestAlone:
    def test_a_segmentation_beside_what_is_no_image_is_read(self, tmp_path: Path) -> None:
        path = written(masks(), AXIAL, tmp_path / "s" / "seg.dcm")
        report(tmp_path / "s" / "pdf.dcm")
        volume = read_volume(tmp_path / "s", select=(1,))
        np.testing.assert_array_equal(volume.voxels, read_volume(path, select=(1,)).voxels)

    @pytest.mark.parametrize("name", ["", "rt.dcm"])
    def test_a_structure_set_names_the_command_for_it(self, tmp_path: Path, name: str) -> None:
        save(structure_set({"Bone": [circle(5.0, 0.0)]}), tmp_path / "s" / "rt.dcm")
        path = tmp_path / "s" / name
        with pytest.raises(FormatError, match=r"contours, no voxels.*tomomesh surface rt\.dcm --structure N") as caught:
            read_volume(path)
        assert f"File: {path} [" in str(caught.value)
