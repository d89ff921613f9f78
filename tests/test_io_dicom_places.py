"""DICOM slices in millimeters, whatever their order, direction and tilt."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import numpy as np
import pydicom
import pytest
from pydicom.dataset import Dataset

from studies import (
    AFFINES,
    affine_of,
    as_ct,
    assert_in_place,
    enhanced,
    indices_of,
    rotation,
    sampled,
    save,
    setting,
    write_nifti,
    write_series,
)
from tomomesh.errors import GeometryError
from tomomesh.io import read_volume

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)


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

    @pytest.mark.parametrize("scale", [0.999, 1.0, 1.0005])
    def test_directions_that_are_not_quite_of_unit_length_are_no_tilt(self, tmp_path: Path, scale: float) -> None:
        turned = affine_of(rotation(0.0, 0.0, 0.1), (0.5, 0.5, 1.25), (-8.0, -8.0, 0.0))

        def longer(data: Dataset, k: int) -> None:
            data.ImageOrientationPatient = [scale * float(value) for value in data.ImageOrientationPatient]

        volume = read_volume(write_series(tmp_path / "s", sampled(turned), turned, longer))
        assert not any("tilt" in note for note in volume.notes)
        np.testing.assert_allclose(volume.spacing_mm, (0.5, 0.5, 1.25), rtol=1e-4)

    @pytest.mark.parametrize("turn", [(0.2, -0.3, 0.4), (0.0, 0.0, 0.1), (1.4, 0.3, 0.0)])
    @pytest.mark.parametrize("digits", [2, 3])
    def test_directions_with_few_decimals_are_made_straight(
        self, tmp_path: Path, turn: tuple[float, float, float], digits: int
    ) -> None:
        turned = affine_of(rotation(*turn), (0.5, 0.7, 1.25), (-8.0, -8.0, 0.0))

        def rounded(data: Dataset, k: int) -> None:
            data.ImageOrientationPatient = [round(float(value), digits) for value in data.ImageOrientationPatient]

        volume = read_volume(write_series(tmp_path / "s", sampled(turned), turned, rounded))
        across = volume.grid.affine[:3, :2] / [0.5, 0.7]
        np.testing.assert_allclose(across.T @ across, np.eye(2), atol=1e-5)
        np.testing.assert_allclose(across, rotation(*turn)[:, :2], atol=0.011 * 10.0 ** (2 - digits))
        assert any("made straight" in note for note in volume.notes) <= (digits == 2)

    @pytest.mark.parametrize("off", [-0.03, -0.01, 0.01, 0.03])
    @pytest.mark.parametrize("angle", [False, True])
    def test_two_hundredths_are_taken_and_told(self, tmp_path: Path, off: float, angle: bool) -> None:
        turned = AFFINES["oblique"]

        def edit(data: Dataset, k: int) -> None:
            rows, columns = np.array(data.ImageOrientationPatient, float).reshape(2, 3)
            both = (rows + off * columns, columns) if angle else ((1 + off) * rows, columns)
            data.ImageOrientationPatient = [float(f"{value:.10f}") for value in np.concatenate(both)]

        path = write_series(tmp_path / "s", sampled(turned), turned, edit)
        if abs(off) > 0.02:
            with pytest.raises(GeometryError, match="directions of the slices are invalid"):
                read_volume(path)
        else:
            volume = read_volume(path)
            assert any("0.01 off unit vectors at right angles" in note for note in volume.notes)
            np.testing.assert_allclose(volume.spacing_mm, sorted((0.5, 0.7, 2.0)), rtol=1e-3)

    @pytest.mark.parametrize(("digits", "notes"), [(3, 1), (5, 0)])
    def test_spacings_that_were_rounded_in_some_slices(self, tmp_path: Path, digits: int, notes: int) -> None:
        exact = 0.48828125
        affine = affine_of(np.eye(3), (exact, exact, 2.0), (-3.0, 11.0, 40.0))

        def rounded(which: int) -> Callable[[Dataset, int], None]:
            def edit(data: Dataset, k: int) -> None:
                data.PixelSpacing = [round(exact, digits) if k % 2 == which else exact] * 2

            return edit

        one, other = (
            read_volume(write_series(tmp_path / f"s{which}", sampled(affine), affine, rounded(which)))
            for which in (0, 1)
        )
        np.testing.assert_allclose(one.spacing_mm, (exact, exact, 2), atol=4e-4)
        assert len([note for note in one.notes if "PixelSpacing differs by up to 0.00028 mm" in note]) == notes
        np.testing.assert_allclose(other.spacing_mm, one.spacing_mm, atol=4e-4)

    def test_spacings_that_differ_by_more_are_refused(self, tmp_path: Path) -> None:
        def other(data: Dataset, k: int) -> None:
            data.PixelSpacing = [0.5, 0.501] if k == 3 else [0.5, 0.5]

        with pytest.raises(GeometryError, match="differ in PixelSpacing"):
            read_volume(write_series(tmp_path / "s", STORED, AXIAL, other))

    def test_the_first_file_decides_nothing(self, tmp_path: Path) -> None:
        rng = np.random.default_rng(3)
        noise = rng.uniform(-1e-4, 1e-4, (5, 6))

        def jittered(data: Dataset, k: int) -> None:
            data.ImageOrientationPatient = [
                float(a) + e for a, e in zip(data.ImageOrientationPatient, noise[k], strict=True)
            ]

        one = read_volume(write_series(tmp_path / "s", STORED, AXIAL, jittered))
        for path, name in zip(sorted((tmp_path / "s").iterdir()), "cbeda", strict=True):
            path.rename(path.with_name(name))
        np.testing.assert_array_equal(read_volume(tmp_path / "s").affine, one.affine)

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
