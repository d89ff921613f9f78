"""DICOM: millimeters whatever the order of the files, and every fault of a folder."""

from __future__ import annotations

import os
import random
from typing import TYPE_CHECKING, Any

import numpy as np
import pydicom
import pytest
from pydicom.dataset import Dataset
from pydicom.sequence import Sequence
from pydicom.uid import JPEGLSLossless, RLELossless

from studies import (
    AFFINES,
    SHAPE,
    affine_of,
    as_ct,
    assert_in_place,
    enhanced,
    indices_of,
    sampled,
    save,
    set_pixels,
    shared,
    slice_dataset,
    write_nifti,
    write_series,
)
from tomomesh.errors import FormatError, GeometryError, ResourceError, UnreadableError, UsageError
from tomomesh.io import limits, read_volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)


def setting(**fields: Any) -> Callable[[Dataset, int], None]:
    """Return an edit that sets fields of every slice; a list holds one value a slice."""

    def edit(data: Dataset, k: int) -> None:
        for keyword, value in fields.items():
            setattr(data, keyword, value[k] if isinstance(value, tuple) else value)

    return edit


def without(*keywords: str) -> Callable[[Dataset, int], None]:
    def edit(data: Dataset, k: int) -> None:
        for keyword in keywords:
            delattr(data, keyword)

    return edit


class TestMillimeters:
    @pytest.mark.parametrize("name", AFFINES)
    def test_every_voxel_is_where_its_gray_level_says(self, tmp_path: Path, name: str) -> None:
        volume = read_volume(write_series(tmp_path / "s", sampled(AFFINES[name]), AFFINES[name]))
        assert_in_place(volume)
        assert volume.unit == "stored"
        assert volume.voxels.dtype == np.int16

    @pytest.mark.parametrize("name", AFFINES)
    def test_dicom_and_nifti_give_the_same_canonical_volume(self, tmp_path: Path, name: str) -> None:
        stored, affine = sampled(AFFINES[name]), AFFINES[name]
        a = read_volume(write_series(tmp_path / "s", stored, affine))
        b = read_volume(write_nifti(tmp_path / "s.nii", stored, affine))
        np.testing.assert_array_equal(a.voxels, b.voxels)
        np.testing.assert_allclose(a.affine, b.affine, atol=1e-5)

    def test_names_and_numbers_of_the_files_do_not_matter(self, tmp_path: Path) -> None:
        reference = read_volume(write_series(tmp_path / "a", STORED, AXIAL))
        numbers = random.Random(0).sample(range(100), len(STORED))
        write_series(tmp_path / "b", STORED, AXIAL, setting(InstanceNumber=tuple(numbers)))
        for path, name in zip(sorted((tmp_path / "b").iterdir()), "eadcb", strict=True):
            path.rename(path.with_name(f"{name}.IMA"))
        volume = read_volume(tmp_path / "b")
        np.testing.assert_array_equal(volume.voxels, reference.voxels)
        np.testing.assert_array_equal(volume.affine, reference.affine)
        assert volume.notes == reference.notes == ()

    def test_pixels_that_are_not_square_keep_a_ball_round(self, tmp_path: Path) -> None:
        affine, shape = affine_of(np.eye(3), (0.5, 0.7, 2.0), (-10.0, -10.5, -11.0)), (12, 31, 41)
        places = indices_of(shape) @ affine[:3, :3].T + affine[:3, 3]
        ball = ((places**2).sum(axis=1) < 82).reshape(shape).astype(np.int16)
        volume = read_volume(write_series(tmp_path / "s", ball, affine))
        k, j, i = np.nonzero(volume.voxels)
        inside = volume.to_mm(np.stack([i, j, k], axis=1).astype(float))
        assert np.abs(np.ptp(inside, axis=0) - 18).max() < 2
        np.testing.assert_allclose(np.linalg.norm(inside, axis=1).max(), 9, atol=0.2)

    def test_a_tilted_gantry_keeps_a_cylinder_straight(self, tmp_path: Path) -> None:
        tilt = np.radians(18)
        affine = affine_of(
            np.array([[1, 0, 0], [0, np.cos(tilt), 0], [0, -np.sin(tilt), 1]]), (0.5, 0.5, 3.0), (-8, -8, 0)
        )
        shape = (8, 33, 33)
        places = indices_of(shape) @ affine[:3, :3].T + affine[:3, 3]
        rod = (np.hypot(places[:, 0], places[:, 1]) < 5).reshape(shape).astype(np.int16)
        volume = read_volume(write_series(tmp_path / "s", rod, affine, as_ct))
        assert volume.unit == "HU"
        assert "18.0 degrees" in volume.notes[0]
        for k in range(8):
            j, i = np.nonzero(volume.voxels[k])
            middle = volume.to_mm(np.stack([i, j, np.full(len(i), k)], axis=1).astype(float)).mean(axis=0)
            assert np.abs(middle[:2]).max() < 0.25
        assert_in_place(read_volume(write_series(tmp_path / "t", sampled(affine), affine)))

    @pytest.mark.parametrize("order", [[0, 1, 2, 3, 4], [3, 0, 4, 1, 2]])
    def test_frames_of_an_enhanced_file_are_sorted_too(self, tmp_path: Path, order: list[int]) -> None:
        affine = AFFINES["oblique"]
        path = save(enhanced(sampled(affine), affine, order), tmp_path / "e.dcm")
        assert_in_place(read_volume(path))
        assert_in_place(read_volume(tmp_path))

    def test_an_enhanced_file_with_a_gap_is_refused(self, tmp_path: Path) -> None:
        path = save(enhanced(STORED, AXIAL, [0, 1, 3, 4]), tmp_path / "e.dcm")
        with pytest.raises(GeometryError, match="missing: 1"):
            read_volume(path)

    def test_a_file_without_preamble_is_known_by_its_content(self, tmp_path: Path) -> None:
        for path in write_series(tmp_path / "s", STORED, AXIAL).iterdir():
            data = pydicom.dcmread(path)
            bare = Dataset()
            bare.update({element.tag: element for element in data})
            bare.save_as(path.with_suffix(""), implicit_vr=True, little_endian=True)
            path.unlink()
        assert_in_place(read_volume(tmp_path / "s"))

    def test_sub_folders_are_searched_where_the_folder_holds_no_image(self, tmp_path: Path) -> None:
        write_series(tmp_path / "study" / "deep", STORED, AXIAL)
        (tmp_path / "study" / "readme.txt").write_text("x")
        assert_in_place(read_volume(tmp_path / "study"))


class TestGrayLevels:
    def test_the_scale_of_each_slice_is_its_own(self, tmp_path: Path) -> None:
        def edit(data: Dataset, k: int) -> None:
            data.RescaleSlope, data.RescaleIntercept = k + 1, -10 * k
            set_pixels(data, np.rint((STORED[k] + 10.0 * k) / (k + 1)).astype(np.int16))

        volume = read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))
        assert_in_place(volume, 3.1)
        assert volume.voxels.dtype.kind == "i"

    def test_hounsfield_units_stay_integers(self, tmp_path: Path) -> None:
        def edit(data: Dataset, k: int) -> None:
            as_ct(data, k)
            set_pixels(data, (STORED[k] + 1024).astype(np.uint16))
            data.BitsStored, data.HighBit = 12, 11
            data.RescaleSlope, data.RescaleIntercept = 1, -1024

        volume = read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))
        assert volume.unit == "HU"
        np.testing.assert_array_equal(volume.voxels, STORED)
        assert volume.voxels.dtype == np.int16

    @pytest.mark.parametrize(("slope", "intercept"), [("0", "1"), ("nan", "0"), ("inf", "0"), ("1", "nan")])
    def test_an_invalid_scale_is_refused(self, tmp_path: Path, slope: str, intercept: str) -> None:
        def edit(data: Dataset, k: int) -> None:
            data.RescaleIntercept = intercept
            data.RescaleSlope = slope

        with pydicom.config.disable_value_validation(), pytest.raises(FormatError, match="slope"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))

    @pytest.mark.parametrize("kind", [np.int16, np.uint16, np.uint8])
    def test_monochrome1_is_inverted(self, tmp_path: Path, kind: type) -> None:
        stored: NDArray[Any] = (STORED % 200).astype(kind)

        def edit(data: Dataset, k: int) -> None:
            data.PhotometricInterpretation = "MONOCHROME1"

        volume = read_volume(write_series(tmp_path / "s", stored, AXIAL, edit))
        turned = volume.voxels.astype(np.int64)
        assert len(set((turned + stored).ravel().tolist())) == 1
        assert "inverted" in volume.notes[-1]

    def test_signed_twelve_bits_keep_their_sign(self, tmp_path: Path) -> None:
        signed = (STORED - 2000).astype(np.int16)

        def edit(data: Dataset, k: int) -> None:
            set_pixels(data, signed[k] & np.int16(0x0FFF))
            data.BitsStored, data.HighBit, data.PixelRepresentation = 12, 11, 1

        np.testing.assert_array_equal(read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit)).voxels, signed)

    def test_overlay_bits_are_masked(self, tmp_path: Path) -> None:
        def edit(data: Dataset, k: int) -> None:
            set_pixels(data, STORED[k].astype(np.uint16) | np.uint16(0x8000 * (k % 2)))
            data.BitsStored, data.HighBit = 12, 11
            data.add_new(0x60000102, "US", 15)

        np.testing.assert_array_equal(read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit)).voxels, STORED)

    def test_signed_numbers_called_unsigned_are_refused(self, tmp_path: Path) -> None:
        def edit(data: Dataset, k: int) -> None:
            set_pixels(data, (STORED[k] - 2000).astype(np.int16).view(np.uint16))
            data.BitsStored, data.HighBit = 12, 11

        with pytest.raises(FormatError, match="PixelRepresentation = 1"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))

    def test_color_has_three_channels(self, tmp_path: Path) -> None:
        colors = np.stack([STORED % 251, STORED % 7, STORED % 13], axis=-1).astype(np.uint8)
        volume = read_volume(write_series(tmp_path / "s", colors, AXIAL))
        np.testing.assert_array_equal(volume.voxels, colors)

    def test_palette_color_is_refused(self, tmp_path: Path) -> None:
        write_series(tmp_path / "s", STORED, AXIAL, setting(PhotometricInterpretation="PALETTE COLOR"))
        with pytest.raises(FormatError, match="PALETTE COLOR"):
            read_volume(tmp_path / "s")


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
        for wrong in (0, 3):
            with pytest.raises(UsageError, match="no such series"):
                read_volume(folder, settings=ReadSettings(series=wrong))

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


class TestGeometry:
    def test_a_missing_slice_is_refused_or_interpolated(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL, slices=[0, 1, 3, 4])
        with pytest.raises(GeometryError, match=r"missing: 1.*gap = 42 to 46 mm.*every 2 mm.*--fill-gaps"):
            read_volume(folder)
        volume = read_volume(folder, settings=ReadSettings(fill_gaps=True))
        assert_in_place(volume, 1.01)
        np.testing.assert_array_equal(np.delete(volume.voxels, 2, axis=0), np.delete(STORED, 2, axis=0))
        assert volume.notes == ("slices interpolated linearly: 1 of 5",)

    def test_a_slice_twice_is_kept_once(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        save(slice_dataset(STORED[2], AXIAL, 2), folder / "again.dcm")
        volume = read_volume(folder)
        assert_in_place(volume)
        assert volume.notes == ("slices that repeat another, left out: 1",)

    def test_different_slices_at_one_position_are_refused(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL, setting(EchoTime=10))
        other = slice_dataset(STORED[1], AXIAL, 2)
        other.EchoTime = 80
        save(other, folder / "z.dcm")
        with pytest.raises(GeometryError, match=r"EchoTime = 10.0 and 80.0"):
            read_volume(folder)

    @pytest.mark.parametrize(
        ("keyword", "value", "word"),
        [
            ("ImageOrientationPatient", [0, 1, 0, 0, 0, -1], "ImageOrientationPatient"),
            ("PixelSpacing", [0.7, 0.51], "PixelSpacing"),
        ],
    )
    def test_one_slice_that_differs_is_refused(self, tmp_path: Path, keyword: str, value: Any, word: str) -> None:
        def edit(data: Dataset, k: int) -> None:
            if k == 3:
                setattr(data, keyword, value)

        with pytest.raises(GeometryError, match=f"differ in {word}"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))

    def test_one_slice_of_another_size_is_refused(self, tmp_path: Path) -> None:
        def edit(data: Dataset, k: int) -> None:
            if k == 3:
                set_pixels(data, STORED[k][:-1])

        with pytest.raises(GeometryError, match="Rows, Columns = 6, 9"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))

    @pytest.mark.parametrize(("jitter", "fits"), [(0.009, True), (0.05, False), (0.3, False)])
    def test_spacing_may_vary_by_one_per_cent(self, tmp_path: Path, jitter: float, fits: bool) -> None:
        def edit(data: Dataset, k: int) -> None:
            data.ImagePositionPatient = [-3, 11, 40 + 2 * (k + (jitter if k == 4 else 0))]

        folder = write_series(tmp_path / "s", STORED, AXIAL, edit)
        if fits:
            assert_in_place(read_volume(folder), 1)
            return
        with pytest.raises(GeometryError, match="varies"):
            read_volume(folder)
        volume = read_volume(folder, settings=ReadSettings(resample_slices=True))
        assert "resampled" in volume.notes[0]
        assert volume.shape == SHAPE
        np.testing.assert_array_equal(volume.voxels[[0, -1]], STORED[[0, -1]])

    def test_positions_off_their_line_are_refused(self, tmp_path: Path) -> None:
        def edit(data: Dataset, k: int) -> None:
            data.ImagePositionPatient = [-3 + (k == 2), 11, 40 + 2 * k]

        with pytest.raises(GeometryError, match="straight line"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))

    def test_slices_without_positions_need_their_distance(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL, without("ImagePositionPatient"))
        with pytest.raises(GeometryError, match=r"ImagePositionPatient = missing.*--spacing-z"):
            read_volume(folder)
        volume = read_volume(folder, settings=ReadSettings(spacing_z=2))
        np.testing.assert_array_equal(volume.voxels, STORED)
        np.testing.assert_allclose(volume.affine, np.diag([0.5, 0.7, 2, 1]))
        assert "numbers" in volume.notes[0]

    def test_slices_without_positions_and_numbers_are_refused(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL, without("ImagePositionPatient", "InstanceNumber"))
        with pytest.raises(GeometryError, match="InstanceNumber"):
            read_volume(folder, settings=ReadSettings(spacing_z=2))

    def test_one_slice_needs_a_distance(self, tmp_path: Path) -> None:
        path = save(slice_dataset(STORED[1], AXIAL, 1), tmp_path / "one.dcm")
        with pytest.raises(GeometryError, match=r"one slice.*--spacing-z"):
            read_volume(path)
        volume = read_volume(path, settings=ReadSettings(spacing_z=2))
        assert_in_place(volume)
        assert volume.shape == (1, 7, 9)

    def test_a_plain_file_of_several_frames_needs_their_distance(self, tmp_path: Path) -> None:
        data = slice_dataset(STORED[0], AXIAL, 0)
        set_pixels(data, STORED)
        data.NumberOfFrames = len(STORED)
        path = save(data, tmp_path / "many.dcm")
        with pytest.raises(GeometryError, match="--spacing-z"):
            read_volume(path)
        np.testing.assert_array_equal(read_volume(path, settings=ReadSettings(spacing_z=2)).voxels, STORED)

    @pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", "1e-30"])
    def test_an_invalid_spacing_names_its_field(self, tmp_path: Path, value: str) -> None:
        with pydicom.config.disable_value_validation():
            folder = write_series(tmp_path / "s", STORED, AXIAL, setting(PixelSpacing=["0.7", value]))
            with pytest.raises(GeometryError, match="PixelSpacing = "):
                read_volume(folder)

    def test_a_missing_spacing_can_be_given(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL, without("PixelSpacing"))
        with pytest.raises(GeometryError, match=r"PixelSpacing = missing.*--spacing"):
            read_volume(folder)
        volume = read_volume(folder, settings=ReadSettings(spacing=(0.5, 0.7, 9)))
        assert_in_place(volume)
        assert "not used" in volume.notes[0]

    @pytest.mark.parametrize("axes", [[1, 0, 0, 1, 0, 0], [0, 0, 0, 0, 0, 0], [2, 0, 0, 0, 1, 0]])
    def test_directions_that_are_none_are_refused(self, tmp_path: Path, axes: list[float]) -> None:
        with pytest.raises(GeometryError, match="directions"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, setting(ImageOrientationPatient=axes)))

    def test_a_position_that_is_no_number_is_refused(self, tmp_path: Path) -> None:
        with pydicom.config.disable_value_validation():
            folder = write_series(tmp_path / "s", STORED, AXIAL, setting(ImagePositionPatient=["0", "nan", "1"]))
            with pytest.raises(GeometryError, match="position is invalid"):
                read_volume(folder)


class TestBrokenFiles:
    def test_a_header_that_is_cut_off_is_named(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        worst = sorted(folder.iterdir())[2]
        worst.write_bytes(worst.read_bytes()[:400])
        with pytest.raises(FormatError, match=worst.name):
            read_volume(folder)

    def test_pixels_that_are_cut_off_are_named_with_both_sizes(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        worst = sorted(folder.iterdir())[2]
        worst.write_bytes(worst.read_bytes()[:-20])
        with pytest.raises(FormatError) as caught:
            read_volume(folder)
        assert f"{worst.name} [data = 106 bytes]. Expected: 126 bytes" in str(caught.value)

    @pytest.mark.parametrize(("rows", "word"), [(14, "cut off"), (3, "more pixels")])
    def test_a_wrong_number_of_rows_is_refused(self, tmp_path: Path, rows: int, word: str) -> None:
        with pytest.raises(FormatError, match=word):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, setting(Rows=rows)))

    def test_a_header_without_pixels_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(FormatError, match="PixelData = missing"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, without("PixelData")))

    def test_pixels_beyond_the_memory_are_refused(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        monkeypatch.setattr(limits, "physical_memory", lambda: 200)
        with pytest.raises(ResourceError):
            read_volume(folder)

    @pytest.mark.parametrize("depth", [10, 300])
    def test_nested_sequences_never_recurse_without_end(self, tmp_path: Path, depth: int) -> None:
        raw = b""
        for _ in range(depth):
            item = b"\xfe\xff\x00\xe0\xff\xff\xff\xff" + raw + b"\xfe\xff\x0d\xe0\x00\x00\x00\x00"
            raw = b"\x40\x00\x30\xa7SQ\x00\x00\xff\xff\xff\xff" + item
            raw += b"\xfe\xff\xdd\xe0\x00\x00\x00\x00"
        path = save(slice_dataset(STORED[0], AXIAL, 0), tmp_path / "deep.dcm")
        whole = path.read_bytes()
        place = whole.index(b"\xe0\x7f\x10\x00")
        path.write_bytes(whole[:place] + raw + whole[place:])
        settings = ReadSettings(spacing_z=1)
        if depth < 100:
            assert read_volume(path, settings=settings).shape == (1, 7, 9)
        else:
            with pytest.raises(FormatError):
                read_volume(path, settings=settings)

    def test_text_with_the_suffix_of_dicom_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "t.dcm").write_text("text " * 100)
        with pytest.raises(FormatError, match="0 of 1 files"):
            read_volume(tmp_path / "t.dcm")

    def test_a_field_of_text_where_a_number_belongs_is_refused_without_its_value(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        path = sorted(folder.iterdir())[0]
        path.write_bytes(
            path.read_bytes().replace(b"0.7000000000", b"Secret^Name "[:12]).replace(b"0.7\\0.5 ", b"Secr\\t. ")
        )
        with pytest.raises(FormatError) as caught:
            read_volume(folder)
        assert "Secr" not in str(caught.value)

    def test_modality_tables_are_refused(self, tmp_path: Path) -> None:
        def edit(data: Dataset, k: int) -> None:
            data.ModalityLUTSequence = Sequence([Dataset()])

        with pytest.raises(FormatError, match="table"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))


class TestCompression:
    def test_run_lengths_are_decoded(self, tmp_path: Path) -> None:
        for path in write_series(tmp_path / "s", STORED, AXIAL).iterdir():
            data = pydicom.dcmread(path)
            data.compress(RLELossless, generate_instance_uid=False)
            data.save_as(path)
        assert_in_place(read_volume(tmp_path / "s"))

    def test_what_cannot_be_decoded_names_the_package(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        from pydicom.pixels.decoders import base

        def edit(data: Dataset, k: int) -> None:
            data.PixelData = pydicom.encaps.encapsulate([b"\xff\xd8\xff\xf7" + bytes(20)])
            data["PixelData"].VR, data["PixelData"].is_undefined_length = "OB", True
            data.file_meta.TransferSyntaxUID = JPEGLSLossless

        monkeypatch.setattr(base.Decoder, "is_available", False)
        with pytest.raises(FormatError, match=r"JPEG-LS.*python-gdcm"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, edit))


class TestPaths:
    def test_links_that_leave_the_folder_are_not_followed(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL, slices=[0, 1, 2])
        write_series(tmp_path / "t", STORED, AXIAL, slices=[3])
        (folder / "out.dcm").symlink_to(next((tmp_path / "t").iterdir()))
        (folder / "loop.dcm").symlink_to(folder / "loop.dcm")
        os.mkfifo(folder / "pipe.dcm")
        volume = read_volume(folder)
        assert volume.shape == (3, 7, 9)
        assert volume.notes == (
            "left out: 1 links that lead nowhere, 1 links that leave the folder, 1 no regular files",
        )

    def test_links_inside_the_folder_are_read(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", STORED, AXIAL)
        first = sorted(folder.iterdir())[0]
        (folder / ".hidden").mkdir()
        first.rename(folder / ".hidden" / "x")
        first.symlink_to(folder / ".hidden" / "x")
        assert_in_place(read_volume(folder))

    def test_an_empty_folder_is_unreadable(self, tmp_path: Path) -> None:
        with pytest.raises(UnreadableError, match="empty"):
            read_volume(tmp_path)

    def test_a_folder_without_images_counts_the_reasons(self, tmp_path: Path) -> None:
        (tmp_path / "a.txt").write_text("x")
        (tmp_path / "b.nii").write_text("x")
        (tmp_path / ".c").write_text("x")
        with pytest.raises(
            FormatError, match=r"0 of 3 files are images.*1 \.nii files, 1 hidden, 1 of an unknown kind"
        ):
            read_volume(tmp_path)


class TestSharedData:
    @pytest.mark.parametrize(
        ("name", "shape"),
        [
            ("dicom2nifti/siemens", (256, 256, 4)),
            ("dicom2nifti/philips", (240, 4, 240)),
            ("dicom2nifti/philips_enhanced", (256, 256, 8)),
            ("dicom2nifti/generic/rgb", (4, 77, 52)),
            ("dicom2nifti/generic/compressed_rle", (256, 256, 4)),
            ("dicom2nifti/generic/anatomical/002_non_isotropic", (4, 28, 64)),
            ("niivue/demos/images/enh.dcm", (6, 64, 64)),
        ],
    )
    def test_series_of_several_vendors_are_read(self, name: str, shape: tuple[int, int, int]) -> None:
        assert read_volume(shared(name)).shape == shape

    def test_compressed_slices_lie_where_plain_ones_do(self) -> None:
        plain = read_volume(shared("dicom2nifti/generic/anatomical/001"))
        packed = read_volume(shared("dicom2nifti/generic/compressed_rle"))
        np.testing.assert_array_equal(plain.affine, packed.affine)

    def test_a_body_lies_where_its_labels_do(self) -> None:
        body = read_volume(shared("totalsegmentator/example_ct_dicom"))
        labels = read_volume(shared("totalsegmentator/example_seg_dicom.nii.gz"))
        assert body.unit == "HU"
        np.testing.assert_allclose(body.affine, labels.affine, atol=1e-3)

    def test_mixed_vendors_are_listed_as_three_series(self) -> None:
        folder = shared("derived/mixed_multi_series")
        with pytest.raises(GeometryError, match=r"1: .*; 2: .*; 3: "):
            read_volume(folder)
        assert read_volume(folder, settings=ReadSettings(series=3)).shape == (240, 4, 240)

    def test_a_head_of_mixed_spacing_is_refused_or_interpolated(self) -> None:
        folder = shared("dcm_qa_ct/In/GE")
        with pytest.raises(GeometryError, match=r"varies.*1\.081 to 6\.999 mm"):
            read_volume(folder)
        volume = read_volume(folder, settings=ReadSettings(resample_slices=True))
        assert any("18.5 degrees" in note for note in volume.notes)

    @pytest.mark.parametrize(
        ("name", "error", "word"),
        [
            ("dicom2nifti/failing/sliceincrement", GeometryError, "missing: 1"),
            ("dicom2nifti/failing/sliceorientation", GeometryError, "2 series"),
            ("malformed/no_ipp.dcm", GeometryError, "ImagePositionPatient"),
            ("malformed/no_pixelspacing.dcm", GeometryError, "PixelSpacing"),
            ("malformed/truncated_header.dcm", FormatError, "cut off"),
            ("malformed/text_named.dcm", FormatError, "0 of 1"),
        ],
    )
    def test_faults_are_refused(self, name: str, error: type[Exception], word: str) -> None:
        with pytest.raises(error, match=word):
            read_volume(shared(name))

    def test_a_tilted_gantry_is_not_ignored(self) -> None:
        volume = read_volume(shared("dicom2nifti/failing/gantrytilting"))
        assert volume.notes == ("gantry tilt of 14.0 degrees: the axes are sheared",)
