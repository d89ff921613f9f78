"""DICOM series whose geometry needs a decision or a flag."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pydicom
import pytest

from studies import (
    AFFINES,
    SHAPE,
    assert_in_place,
    sampled,
    save,
    set_pixels,
    setting,
    slice_dataset,
    without,
    write_series,
)
from tomomesh.errors import GeometryError
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from pydicom.dataset import Dataset

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)


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
