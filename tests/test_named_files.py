"""A study whose files are named one by one, as a shell does with ``ct/*.dcm``, and files whose suffix tells nothing."""

from __future__ import annotations

import json
import random
import shlex
import shutil
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from segmentations import written
from studies import AFFINES, as_ct, assert_in_place, sampled, write_nifti, write_series
from tomomesh.cli import main
from tomomesh.errors import FormatError, UnreadableError, UsageError
from tomomesh.io import list_series, read_volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)


def slices(folder: Path) -> list[str]:
    """Write a series and return its files, in no order."""
    names = [str(path) for path in write_series(folder, STORED, AXIAL, as_ct).iterdir()]
    random.Random(1).shuffle(names)
    return names


class TestRead:
    def test_slices_of_dicom_are_one_study(self, tmp_path: Path) -> None:
        volume = read_volume(slices(tmp_path / "ct"))
        assert_in_place(volume)
        assert volume.shape == STORED.shape

    def test_what_is_no_slice_is_left_out_and_folders_are_opened(self, tmp_path: Path) -> None:
        names = slices(tmp_path / "ct")
        (tmp_path / "notes.txt").write_text("nothing" * 40)
        volume = read_volume([str(tmp_path / "notes.txt"), str(tmp_path / "ct"), names[0]])
        assert_in_place(volume)
        assert volume.notes == ("left out: 1 not DICOM",)

    def test_pictures_are_one_study_in_the_order_of_their_numbers(self, tmp_path: Path) -> None:
        names = []
        for k in (10, 9, 2, 11):
            names.append(tmp_path / f"slice{k}.png")
            Image.fromarray(np.full((4, 5), k, np.uint8)).save(names[-1])
        volume = read_volume(names, settings=ReadSettings(spacing=(1, 1, 2)))
        assert volume.voxels[:, 0, 0].tolist() == [2, 9, 10, 11]

    def test_one_file_and_a_header_with_its_data_are_read_as_ever(self, tmp_path: Path) -> None:
        path = write_nifti(tmp_path / "s.nii", STORED, AXIAL)
        np.testing.assert_array_equal(read_volume([path]).voxels, read_volume(path).voxels)
        (tmp_path / "s.raw").write_bytes(STORED.tobytes())
        head = tmp_path / "s.mhd"
        head.write_text(
            "NDims = 3\nDimSize = 9 7 5\nElementType = MET_SHORT\nElementSpacing = 1 1 1\nElementDataFile = s.raw\n"
        )
        np.testing.assert_array_equal(read_volume([tmp_path / "s.raw", head]).voxels, STORED)

    def test_a_segmentation_alone_among_them_is_read(self, tmp_path: Path) -> None:
        mask = np.zeros(STORED.shape, bool)
        mask[1:3, 2:4, 2:4] = True
        path = written({1: mask}, AXIAL, tmp_path / "seg.dcm")
        (tmp_path / "notes.txt").write_text("nothing" * 40)
        assert read_volume([path, tmp_path / "notes.txt"]).voxels.sum() == mask.sum()

    def test_volumes_are_no_study_together(self, tmp_path: Path) -> None:
        paths = [write_nifti(tmp_path / f"{name}.nii", STORED, AXIAL) for name in "ab"]
        with pytest.raises(FormatError, match=r"0 of 2 files are images\. File: .*a\.nii and 1 more \[2 \.nii files\]"):
            read_volume(paths)
        with pytest.raises(UnreadableError, match="nowhere"):
            read_volume([paths[0], tmp_path / "nowhere.dcm"])
        with pytest.raises(UsageError, match="no study"):
            read_volume([])

    def test_their_series_are_listed(self, tmp_path: Path) -> None:
        names = slices(tmp_path / "ct")
        assert list_series(names) == list_series(tmp_path / "ct")


class TestCommands:
    def test_the_same_mesh_as_of_the_folder(self, tmp_path: Path) -> None:
        names = slices(tmp_path / "ct")
        rest = ["--lower", "1600", "--way", "voxels", "--quiet"]
        assert main(["reconstruct", *names, *rest, "-o", str(tmp_path / "a.stl")]) == 0
        assert main(["reconstruct", str(tmp_path / "ct"), *rest, "-o", str(tmp_path / "b.stl")]) == 0
        assert main(["reconstruct", *rest, "-o", str(tmp_path / "c.stl"), *names]) == 0
        assert len({(tmp_path / f"{name}.stl").read_bytes() for name in "abc"}) == 1
        assert main(["segment", *names, "--lower", "1600", "--quiet", "-o", str(tmp_path / "p.ply")]) == 0

    def test_inspect_shows_a_command_that_a_shell_expands(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        folder = tmp_path / "a b"
        names = slices(folder)
        assert main(["inspect", "--json", *names]) == 0
        found = json.loads(capsys.readouterr().out)
        assert f"{shlex.quote(str(folder))}/*.dcm" in found["next"]
        assert len(found["series"]) == 1
        (folder / "other.dcm").write_bytes(b"")
        assert main(["inspect", "--json", *names[:3]]) == 0
        found = json.loads(capsys.readouterr().out)
        assert f"{names[0]} and 2 more" in found["refused"]["error"]
        assert shlex.split(found["next"])[2:5] == names[:3]

    def test_an_output_is_none_of_them(self, tmp_path: Path) -> None:
        names = slices(tmp_path / "ct")
        assert main(["reconstruct", *names, "-o", str(tmp_path / "m.stl"), "--report", names[0]]) == 2
        assert main(["reconstruct", names[0], "-", "-o", str(tmp_path / "m.stl")]) == 2
        assert main(["reconstruct", *names, "--each", "-o", str(tmp_path / "out")]) == 2
        assert not (tmp_path / "m.stl").exists()


class TestInputFormat:
    def test_it_names_what_a_suffix_does_not(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        path = write_nifti(tmp_path / "scan.nii", STORED, AXIAL)
        shutil.copy(path, tmp_path / "scan 1.dat")
        rest = ["--lower", "1600", "--way", "voxels", "--quiet"]
        assert main(["reconstruct", str(path), *rest, "-o", str(tmp_path / "a.stl")]) == 0
        command = ["reconstruct", str(tmp_path / "scan 1.dat"), "--input-format", "nii", *rest]
        assert main([*command, "-o", str(tmp_path / "b.stl")]) == 0
        assert (tmp_path / "a.stl").read_bytes() == (tmp_path / "b.stl").read_bytes()
        assert main([*command, "-o", str(tmp_path / "scan 1.dat")]) == 2
        capsys.readouterr()
        assert main(["inspect", "--json", str(tmp_path / "scan 1.dat"), "--input-format", "nii"]) == 0
        assert f"'{tmp_path}/scan 1.dat' --input-format nii" in json.loads(capsys.readouterr().out)["next"]

    def test_faults_name_the_file_that_was_typed(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        (tmp_path / "scan.dat").write_bytes(b"nothing" * 100)
        for name, code in (("scan.dat", 4), ("nowhere", 3)):
            assert main(["inspect", str(tmp_path / name), "--input-format", "nii"]) == code
            assert f"File: {tmp_path / name}" in capsys.readouterr().err
        assert main(["inspect", str(tmp_path), "--input-format", "nii"]) == 2

    def test_clouds_too(self, tmp_path: Path) -> None:
        sphere = np.random.default_rng(0).normal(size=(4000, 3))
        np.savetxt(tmp_path / "cloud.dat", 10 * sphere / np.linalg.norm(sphere, axis=1)[:, None])
        command = ["surface", str(tmp_path / "cloud.dat"), "--input-format", "xyz", "--quiet"]
        assert main([*command, "-o", str(tmp_path / "m.stl")]) == 0
