"""NIfTI's two frames, their quirks, and labels at one place for every reader: SimpleITK and nibabel judge."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest
import SimpleITK
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from studies import AFFINES, LPS_TO_RAS, SHEARED, TURNED, assert_in_place, rotation, sampled, write_nifti
from tomomesh.cli import main
from tomomesh.errors import FormatError, GeometryError
from tomomesh.io import read_volume, write_labels
from tomomesh.io.volumes import nifti_frame
from tomomesh.io.volumes.nifti_header import unpack_header
from tomomesh.model.volume import Volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

AXIAL, OBLIQUE = AFFINES["axial"], AFFINES["oblique"]


def placed_by_itk(image: Any) -> NDArray[np.float64]:
    """Return index to millimeters, LPS, of an image of SimpleITK."""
    affine = np.eye(4)
    affine[:3, :3] = np.reshape(image.GetDirection(), (3, 3)) * image.GetSpacing()
    affine[:3, 3] = image.GetOrigin()
    return affine


def qform_alone(path: Path, affine: NDArray[np.float64], edit: Any = None) -> Path:
    """Write a study whose place its qform alone tells."""
    image = nibabel.Nifti1Image(sampled(affine).T, None)
    image.header.set_qform(LPS_TO_RAS @ affine, code=1)
    image.header.set_xyzt_units("mm")
    raw = bytearray(image.to_bytes())
    header = nibabel.Nifti1Header(bytes(raw[:348]), check=False)
    if edit:
        edit(header)
    path.write_bytes(header.binaryblock + bytes(raw[348:]))
    return path


def two_forms(path: Path, sform: NDArray[np.float64], qform: NDArray[np.float64], stored: NDArray[Any]) -> Path:
    """Write voxels (K, J, I) with two places, LPS."""
    image = nibabel.Nifti1Image(stored.T, None)
    image.header.set_sform(LPS_TO_RAS @ sform, code=1)
    image.header.set_qform(LPS_TO_RAS @ qform, code=1)
    image.header.set_xyzt_units("mm")
    path.write_bytes(image.to_bytes())
    return path


class TestQuirks:
    @pytest.mark.parametrize("qfac", [0.0, 1.0, 5.0, np.nan])
    def test_a_qfac_that_is_not_negative_is_1(self, tmp_path: Path, qfac: float) -> None:
        def edit(header: Any) -> None:
            header["pixdim"][0] = qfac

        path = qform_alone(tmp_path / "q.nii", OBLIQUE, edit)
        volume = read_volume(path)
        assert_in_place(volume)
        np.testing.assert_allclose(volume.grid.affine, placed_by_itk(SimpleITK.ReadImage(str(path))), atol=1e-4)

    @pytest.mark.parametrize("qfac", [-1.0, -3.0])
    def test_a_negative_one_turns_the_slices(self, tmp_path: Path, qfac: float) -> None:
        def edit(header: Any) -> None:
            header["pixdim"][0] = qfac

        path = qform_alone(tmp_path / "q.nii", TURNED["left-handed"], edit)
        assert_in_place(read_volume(path))

    @given(x=st.floats(3.0, 3.2), y=st.floats(-0.1, 0.1), z=st.floats(-0.1, 0.1), longer=st.sampled_from([1.0, 1.0001]))
    @law(30)
    def test_a_quaternion_that_rounding_made_too_long_is_read(
        self, tmp_path_factory: pytest.TempPathFactory, x: float, y: float, z: float, longer: float
    ) -> None:
        affine = np.eye(4)
        affine[:3, :3] = rotation(x, y, z)

        def edit(header: Any) -> None:
            for letter in "bcd":
                header[f"quatern_{letter}"] *= longer

        path = qform_alone(tmp_path_factory.mktemp("q") / "q.nii", affine, edit)
        np.testing.assert_allclose(read_volume(path).grid.affine, affine, atol=0.03)
        itk = placed_by_itk(SimpleITK.ReadImage(str(path)))
        # twice the fourth number that three ulps of 32 bits leave open: readers round it to 0 or not
        np.testing.assert_allclose(read_volume(path).grid.affine, itk, atol=2 * (3 * 2**-23) ** 0.5)

    @pytest.mark.parametrize("length", [1.02, 3.0, np.nan, np.inf])
    def test_one_that_is_no_turn_is_refused(self, tmp_path: Path, length: float) -> None:
        def edit(header: Any) -> None:
            for letter, value in zip("bcd", (0.6, 0.0, 0.8), strict=True):
                header[f"quatern_{letter}"] = value * length

        path = qform_alone(tmp_path / "q.nii", OBLIQUE, edit)
        with pytest.raises(FormatError, match="the quaternion is no turn"):
            read_volume(path)

    @pytest.mark.parametrize("order", ["<", ">"])
    @pytest.mark.parametrize("kind", [nibabel.Nifti1Header, nibabel.Nifti2Header])
    @pytest.mark.parametrize("form", ["sform", "qform"])
    @given(seed=st.integers(0, 2**32 - 1), half=st.booleans())
    @law(25)
    def test_either_form_of_either_version_is_where_nibabel_puts_it(
        self, kind: Any, order: str, form: str, seed: int, half: bool
    ) -> None:
        """Half a turn, too, whose fourth number is 0."""
        chosen, header = np.random.default_rng(seed), kind(endianness=order)
        quaternion = chosen.normal(size=3) / (1.0 if half else 4.0)
        quaternion /= np.linalg.norm(quaternion) if half else 1 + np.linalg.norm(quaternion)
        header["pixdim"][:4] = [chosen.choice([-1, 1]), *chosen.uniform(0.1, 9, 3)]
        for letter, value in zip("bcd", quaternion, strict=True):
            header[f"quatern_{letter}"] = value
        for axis in "xyz":
            header[f"qoffset_{axis}"], header[f"srow_{axis}"] = chosen.normal(), chosen.normal(size=4)
        start = header.binaryblock
        start = start[:344] + b"n+1\0" if len(start) == 348 else start
        ours = nifti_frame._form(unpack_header(start, ReadSettings(), paired=False, file="s.nii"), form, "s.nii")
        np.testing.assert_allclose(ours, getattr(header, f"get_{form}")(), rtol=0, atol=1e-12)

    @pytest.mark.parametrize("slope", [np.nan, np.inf, 0.0])
    def test_a_slope_that_is_none_scales_nothing(self, tmp_path: Path, slope: float) -> None:
        def edit(header: Any) -> None:
            header["scl_slope"], header["scl_inter"] = slope, 5

        path = write_nifti(tmp_path / "s.nii", sampled(AXIAL), AXIAL, edit)
        volume = read_volume(path)
        assert_in_place(volume)
        np.testing.assert_array_equal(np.asarray(nibabel.load(path).dataobj).T, sampled(AXIAL))
        assert any("scl_slope" in note for note in volume.notes) == (slope != 0)


class TestTwoFrames:
    def test_the_sform_is_taken_and_the_qform_by_an_option(self, tmp_path: Path) -> None:
        for taken in ("sform", "qform"):
            stored = sampled(AXIAL if taken == "sform" else OBLIQUE)
            path = two_forms(tmp_path / "t.nii", AXIAL, OBLIQUE, stored)
            volume = read_volume(path, settings=ReadSettings(nifti_form=taken))
            assert_in_place(volume)
            other = "qform" if taken == "sform" else "sform"
            assert volume.other_frame == f"--nifti-form {other}"
            assert f"{taken} was taken, --nifti-form {other} takes the other" in volume.notes[0]

    def test_the_only_form_is_taken_whatever_is_asked_for(self, tmp_path: Path) -> None:
        for path in (write_nifti(tmp_path / "s.nii", sampled(AXIAL), AXIAL), qform_alone(tmp_path / "q.nii", AXIAL)):
            for form in ("sform", "qform"):
                volume = read_volume(path, settings=ReadSettings(nifti_form=form))
                assert_in_place(volume)

    @given(share=st.floats(0.0, 0.5), axis=st.integers(0, 2))
    @law(20)
    def test_forms_within_a_tenth_of_a_voxel_agree(
        self, tmp_path_factory: pytest.TempPathFactory, share: float, axis: int
    ) -> None:
        moved = AXIAL.copy()
        moved[axis, 3] += share * 0.5  # the smallest side of a voxel
        volume = read_volume(two_forms(tmp_path_factory.mktemp("t") / "t.nii", AXIAL, moved, sampled(AXIAL)))
        if abs(share - 0.1) > 1e-4:
            assert bool(volume.other_frame) == (share > 0.1)

    def test_a_mask_of_the_other_frame_is_offered_it(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        k, j, i = np.indices((12, 12, 12))
        ball = ((i - 6) ** 2 + (j - 6) ** 2 + (k - 6) ** 2 <= 16).astype(np.int16)
        study = two_forms(tmp_path / "t.nii", AXIAL, OBLIQUE, 100 * ball)
        image: Any = SimpleITK.GetImageFromArray(ball)
        image.SetSpacing((0.5, 0.7, 2.0))
        image.SetOrigin(OBLIQUE[:3, 3].tolist())
        image.SetDirection((OBLIQUE[:3, :3] / (0.5, 0.7, 2.0)).ravel().tolist())
        SimpleITK.WriteImage(image, str(tmp_path / "mask.nii"))
        command = ["reconstruct", str(study), "--labels-in", str(tmp_path / "mask.nii"), "--select", "1"]
        command += ["--way", "voxels", "--quiet", "-o", str(tmp_path / "m.stl")]
        assert main(command) == GeometryError.exit_code
        assert "--nifti-form qform, for the study holds two frames that disagree" in capsys.readouterr().err
        assert main([*command, "--nifti-form", "qform"]) == 0


class TestLabels:
    @pytest.mark.parametrize("name", sorted(TURNED))
    def test_every_reader_puts_them_at_the_same_place(self, tmp_path: Path, name: str) -> None:
        affine = TURNED[name]
        study = Volume.from_stored(sampled(affine), affine)
        labels = (study.voxels > np.median(study.voxels)).astype(np.uint16)
        write_labels(labels, study, tmp_path / "l.nii.gz")
        written = nibabel.load(tmp_path / "l.nii.gz")
        np.testing.assert_allclose(written.header.get_zooms(), (0.5, 0.7, 2.0), rtol=1e-6)
        for form in (written.header.get_qform(), written.header.get_sform()):
            np.testing.assert_allclose(LPS_TO_RAS @ form, affine, atol=1e-4)
        assert int(written.header["qform_code"]) == int(written.header["sform_code"]) == 1
        image: Any = SimpleITK.ReadImage(str(tmp_path / "l.nii.gz"))
        np.testing.assert_allclose(placed_by_itk(image), affine, atol=1e-4)
        measure: Any = SimpleITK.LabelShapeStatisticsImageFilter
        shape = measure()
        shape.Execute(image)
        voxels = np.argwhere(labels)[:, ::-1]
        assert shape.GetPhysicalSize(1) == pytest.approx(len(voxels) * 0.5 * 0.7 * 2.0, rel=1e-5)
        np.testing.assert_allclose(shape.GetCentroid(1), study.to_mm(voxels.mean(axis=0)[None])[0], atol=1e-3)

    def test_a_shear_is_in_the_sform_alone_and_the_zooms(self, tmp_path: Path) -> None:
        study = Volume.from_stored(sampled(SHEARED), SHEARED)
        write_labels(np.ones(study.shape, np.uint16), study, tmp_path / "l.nii")
        header = nibabel.load(tmp_path / "l.nii").header
        assert (int(header["qform_code"]), int(header["sform_code"])) == (0, 1)
        np.testing.assert_allclose(header.get_zooms(), np.linalg.norm(SHEARED[:3, :3], axis=0), rtol=1e-6)
        np.testing.assert_allclose(LPS_TO_RAS @ header.get_sform(), SHEARED, atol=1e-4)

    @pytest.mark.parametrize("option", ["--labels", "--mask-out"])
    def test_the_command_line_writes_them_so(self, tmp_path: Path, option: str) -> None:
        k, j, i = np.indices((16, 16, 16))
        ball = ((i - 8) ** 2 + (j - 8) ** 2 + (k - 8) ** 2 <= 25).astype(np.int16) * 100
        affine = OBLIQUE @ np.diag([2.0, 1.5, 0.5, 1.0])
        study = write_nifti(tmp_path / "s.nii", ball, affine)
        out = tmp_path / "out.nii.gz"
        command = ["reconstruct", str(study), "--lower", "50", "--way", "voxels", "--quiet", option, str(out)]
        assert main([*command, "-o", str(tmp_path / "m.stl")]) == 0
        image: Any = SimpleITK.ReadImage(str(out))
        np.testing.assert_allclose(placed_by_itk(image), affine, atol=1e-4)
        size = np.count_nonzero(SimpleITK.GetArrayFromImage(image)) * np.prod(image.GetSpacing())
        assert size == pytest.approx(np.count_nonzero(ball) * 1.0 * 1.05 * 1.0, rel=0.1)
