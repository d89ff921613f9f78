"""NIfTI as a pair of files, without an orientation, and Analyze 7.5; nibabel and SimpleITK as judges."""

from __future__ import annotations

import gzip
import shutil
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest

from studies import AFFINES, LPS_TO_RAS, assert_in_place, sampled, shared
from tomomesh.cli import main
from tomomesh.errors import FormatError, GeometryError, UnreadableError
from tomomesh.io import read_volume
from tomomesh.io.studies.folder import find_studies
from tomomesh.io.volumes.nifti_frame import UNPLACED
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

STORED = sampled(AFFINES["oblique"])
SPACING = ReadSettings(spacing=(0.5, 0.7, 2.0))


def pair(folder: Path, kind: Any = nibabel.Nifti1Pair, suffix: str = ".img") -> Path:
    """Write a pair by nibabel, which packs both files or none."""
    nibabel.save(kind(STORED.T, LPS_TO_RAS @ AFFINES["oblique"]), folder / f"s{suffix}")
    return folder / "s.hdr"


def unplaced(path: Path, pixdim: tuple[float, float, float] = (0.5, 0.7, 2.0), unit: str = "mm") -> Path:
    image = nibabel.Nifti1Image(STORED.T, None)
    image.header.set_zooms(pixdim)
    image.header.set_xyzt_units(unit)
    nibabel.save(image, path)
    return path


class TestPairs:
    @pytest.mark.parametrize("kind", [nibabel.Nifti1Pair, nibabel.Nifti2Pair])
    @pytest.mark.parametrize("given", ["s.hdr", "s.img"])
    def test_either_file_brings_the_study(self, tmp_path: Path, kind: Any, given: str) -> None:
        pair(tmp_path, kind)
        volume = read_volume(tmp_path / given)
        assert_in_place(volume)
        np.testing.assert_array_equal(volume.grid.restore(volume.voxels), STORED)
        assert volume.notes == ()

    @pytest.mark.parametrize("packed", [("s.img",), ("s.hdr",), ("s.hdr", "s.img")])
    def test_each_may_be_packed(self, tmp_path: Path, packed: tuple[str, ...]) -> None:
        pair(tmp_path)
        for name in packed:
            (tmp_path / f"{name}.gz").write_bytes(gzip.compress((tmp_path / name).read_bytes()))
            (tmp_path / name).unlink()
        for path in sorted(tmp_path.iterdir()):
            assert_in_place(read_volume(path))

    def test_it_is_one_study_of_a_folder(self, tmp_path: Path) -> None:
        pair(tmp_path)
        assert [(study.path.name, len(study.files)) for study in find_studies(tmp_path)] == [("s.hdr", 2)]

    def test_simpleitk_agrees(self, tmp_path: Path) -> None:
        sitk = pytest.importorskip("SimpleITK", reason="the package SimpleITK is not installed")
        image = sitk.ReadImage(str(pair(tmp_path)))
        volume = read_volume(tmp_path / "s.hdr")
        np.testing.assert_array_equal(volume.grid.restore(volume.voxels), sitk.GetArrayFromImage(image))
        np.testing.assert_allclose(volume.grid.affine[:3, 3], image.GetOrigin(), atol=1e-4)

    def test_names_in_capitals_belong_together(self, tmp_path: Path) -> None:
        for name in ("s.hdr", "s.img"):
            pair(tmp_path).with_name(name).rename(tmp_path / name.upper())
        assert_in_place(read_volume(tmp_path / "S.HDR"))

    @pytest.mark.parametrize("given", ["s.hdr", "s.img"])
    def test_without_its_partner_it_is_refused(self, tmp_path: Path, given: str) -> None:
        other = pair(tmp_path).with_name("s.img" if given == "s.hdr" else "s.hdr")
        other.unlink()
        with pytest.raises(FormatError, match="other file of the pair"):
            read_volume(tmp_path / given)

    def test_a_partner_outside_of_the_folder_is_never_opened(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (tmp_path / "in").mkdir()
        shutil.move(pair(tmp_path), tmp_path / "in" / "s.hdr")
        (tmp_path / "in" / "s.img").symlink_to(tmp_path / "s.img")
        monkeypatch.setattr("tomomesh.io.volumes.nifti.unpacked", None)
        with pytest.raises(FormatError, match="outside of its header's folder"):
            read_volume(tmp_path / "in" / "s.hdr")

    def test_voxels_that_are_cut_off_are_refused(self, tmp_path: Path) -> None:
        pair(tmp_path)
        (tmp_path / "s.img").write_bytes((tmp_path / "s.img").read_bytes()[:-1])
        with pytest.raises(FormatError, match="cut off"):
            read_volume(tmp_path / "s.hdr")

    def test_the_words_of_other_programs_are_no_header(self, tmp_path: Path) -> None:
        pair(tmp_path).write_text("ENVI\nsamples = 9\nlines = 7\n" * 30)
        with pytest.raises(FormatError, match="no NIfTI"):
            read_volume(tmp_path / "s.img")

    def test_an_empty_half_is_refused(self, tmp_path: Path) -> None:
        pair(tmp_path).write_bytes(b"")
        for name in ("s.hdr", "s.img"):
            with pytest.raises((FormatError, UnreadableError)):
                read_volume(tmp_path / name)


class TestWithoutAnOrientation:
    def test_it_is_read_as_the_standards_method_1_and_said(self, tmp_path: Path) -> None:
        volume = read_volume(unplaced(tmp_path / "s.nii"))
        np.testing.assert_allclose(volume.grid.affine, np.diag([-0.5, -0.7, 2.0, 1.0]), atol=1e-6)
        assert volume.notes == (UNPLACED,)

    def test_the_others_take_the_same_spacing_and_their_own_directions(self, tmp_path: Path) -> None:
        """Nibabel turns x, and puts 0 into the middle; ITK turns it half around: all three are documented."""
        sitk = pytest.importorskip("SimpleITK", reason="the package SimpleITK is not installed")
        found = read_volume(unplaced(tmp_path / "s.nii")).grid.affine
        itk, nib = sitk.ReadImage(str(tmp_path / "s.nii")), LPS_TO_RAS @ nibabel.load(tmp_path / "s.nii").affine
        np.testing.assert_allclose(np.abs(found[:3, :3]), np.diag(itk.GetSpacing()), atol=1e-6)
        np.testing.assert_allclose(LPS_TO_RAS[:3, :3] @ found[:3, :3], np.diag(itk.GetSpacing()), atol=1e-6)
        np.testing.assert_allclose(nib[:3, :3], np.diag([-1, 1, 1]) @ found[:3, :3], atol=1e-6)
        assert np.linalg.det(found[:3, :3]) > 0  # as the standard's right-handed axes have it, and as ITK

    def test_its_unit_counts(self, tmp_path: Path) -> None:
        volume = read_volume(unplaced(tmp_path / "s.nii", (500, 700, 2000), "micron"))
        np.testing.assert_allclose(volume.spacing_mm, (0.5, 0.7, 2.0))
        assert UNPLACED in volume.notes

    @pytest.mark.parametrize("value", [0.0, np.nan, -1.0])
    def test_a_spacing_that_cannot_be_is_refused_still(self, tmp_path: Path, value: float) -> None:
        raw = bytearray(unplaced(tmp_path / "s.nii").read_bytes())
        raw[80:84] = np.float32(value).tobytes()
        (tmp_path / "s.nii").write_bytes(bytes(raw))
        with pytest.raises(GeometryError, match=r"pixdim\[1\]"):
            read_volume(tmp_path / "s.nii")

    def test_the_command_line_says_so(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        study, mesh = unplaced(tmp_path / "s.nii"), tmp_path / "m.ply"
        level = str(float(np.median(STORED)))
        assert main(["reconstruct", str(study), "-o", str(mesh), "--lower", level, "--network", "none"]) == 0
        assert "no orientation in the file" in capsys.readouterr().out

    def test_the_shared_one_is_read(self) -> None:
        volume = read_volume(shared("malformed/no_qform_no_sform.nii.gz"))
        assert UNPLACED in volume.notes


class TestAnalyze:
    def write(self, folder: Path) -> Path:
        image = nibabel.AnalyzeImage(STORED.T, None)
        image.header.set_zooms((0.5, 0.7, 2.0))
        nibabel.save(image, folder / "a.hdr")
        return folder / "a.hdr"

    def test_left_and_right_must_be_decided(self, tmp_path: Path) -> None:
        with pytest.raises(GeometryError, match=r"which side is left.*--spacing x y z"):
            read_volume(self.write(tmp_path))

    def test_a_spacing_decides(self, tmp_path: Path) -> None:
        volume = read_volume(self.write(tmp_path), settings=SPACING)
        np.testing.assert_array_equal(volume.voxels, STORED)
        np.testing.assert_array_equal(volume.affine, np.diag([0.5, 0.7, 2.0, 1.0]))
        assert "--spacing" in volume.notes[0]

    def test_other_words_in_the_place_of_forms_do_not_count(self, tmp_path: Path) -> None:
        raw = bytearray(self.write(tmp_path).read_bytes())
        raw[252:263] = b"\2\0\1" + bytes(8)  # orient and originator, where NIfTI keeps its codes
        (tmp_path / "a.hdr").write_bytes(bytes(raw))
        np.testing.assert_array_equal(
            read_volume(tmp_path / "a.hdr", settings=SPACING).affine, np.diag([0.5, 0.7, 2.0, 1.0])
        )
