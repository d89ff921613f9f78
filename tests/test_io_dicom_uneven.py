"""Slices that are missing or unevenly spaced: the flag that the error names, and the stack that it gives."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pydicom
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import binary_dilation, map_coordinates

from conftest import law
from studies import AFFINES, affine_of, assert_in_place, indices_of, sampled, save, shared, slice_dataset
from tomomesh.errors import GeometryError
from tomomesh.io import read_volume
from tomomesh.io.dicom.series.regular import regular
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tomomesh.model.volume import Volume

AXIAL = AFFINES["axial"]
TILT = np.radians(18.5)
TILTED = affine_of(np.array([[1, 0, 0], [0, np.cos(TILT), 0], [0, -np.sin(TILT), 1]]), (0.5, 0.5, 1.0), (-8, -8, 0))
HEAD = "dcm_qa_ct/In/GE"


def write_uneven(folder: Path, fine: NDArray[np.int16], affine: NDArray[np.float64], slices: list[int]) -> Path:
    """Write some of the slices of a fine stack: their distances are whole numbers of its own."""
    for n, k in enumerate(slices):
        save(slice_dataset(fine[k], affine, k), folder / f"{n}.dcm")
    return folder


FILL, RESAMPLE = ReadSettings(fill_gaps=True), ReadSettings(resample_slices=True)


class TestFlags:
    """Each flag is for its own fault, and the error names it."""

    @pytest.mark.parametrize(
        ("steps", "flag", "helps", "other"),
        [
            ((0, 4, 8, 16), "--fill-gaps", FILL, RESAMPLE),
            ((0, 4, 5, 7, 12.3), "--resample-slices", RESAMPLE, FILL),
            ((0, 4, 8, 12.2), "--resample-slices", RESAMPLE, FILL),
        ],
    )
    def test_the_error_names_the_flag_that_helps(
        self, tmp_path: Path, steps: tuple[float, ...], flag: str, helps: ReadSettings, other: ReadSettings
    ) -> None:
        affine = affine_of(np.eye(3), (0.5, 0.7, 0.37))
        for n, step in enumerate(steps):
            data = slice_dataset(np.full((3, 4), n, np.int16), affine, 0)
            data.ImagePositionPatient = [0, 0, round(step * 0.37, 6)]
            save(data, tmp_path / f"{n}.dcm")
        for settings in (ReadSettings(), other):
            with pytest.raises(GeometryError, match=flag):
                read_volume(tmp_path, settings=settings)
        assert "linearly" in read_volume(tmp_path, settings=helps).notes[0]

    def test_filled_gaps_keep_every_slice(self) -> None:
        levels, notes = regular(np.array([1.0, 3, 5, 11, 13]), FILL, pixel=1, study="s")
        assert levels.tolist() == [0, 1, 2, 5, 6]
        assert notes == ("slices interpolated linearly: 2 of 7",)

    def test_a_slice_between_others_is_kept(self) -> None:
        levels, _ = regular(np.array([0.0, 4, 8, 10, 14]), RESAMPLE, pixel=1, study="s")
        assert levels.tolist() == [0, 2, 4, 5, 7]

    def test_two_slices_that_nearly_touch_do_not_ask_for_thousands(self) -> None:
        heights = np.array([0.0, 5, 5.02, 10, 15])
        levels, _ = regular(heights, RESAMPLE, pixel=0.5, study="s")
        assert levels[-1] == 30

    def test_slices_nearer_than_a_pixel_are_not_thinned_out(self) -> None:
        heights = np.array([0.0, 0.5, 0.97, 1.5, 2.0])
        levels, _ = regular(heights, RESAMPLE, pixel=3, study="s")
        assert levels[-1] == 4

    @given(st.lists(st.floats(0.6, 9), min_size=2, max_size=20))
    @law(100)
    def test_levels_are_heights_in_even_steps_and_no_two_slices_share_one(self, gaps: list[float]) -> None:
        heights = np.concatenate([[-7.0], -7 + np.cumsum(gaps)])
        settings = ReadSettings(fill_gaps=True, resample_slices=True)
        levels, _ = regular(heights, settings, pixel=0.5, study="s")
        extent = heights[-1] - heights[0]
        assert levels[0] == 0
        assert levels[-1].is_integer()
        step = extent / levels[-1]
        np.testing.assert_allclose(levels * step, heights - heights[0], atol=0.1 * step)
        assert step <= 1.5 * min(gaps)


class TestSynthetic:
    def test_gray_levels_lie_on_the_line_between_slices(self, tmp_path: Path) -> None:
        affine = affine_of(np.eye(3), (0.5, 0.7, 0.4))
        folder = write_uneven(tmp_path, sampled(affine, (31, 7, 9)), affine, [0, 10, 13, 30])
        volume = read_volume(folder, settings=RESAMPLE)
        assert_in_place(volume, 1.01)
        assert volume.spacing_mm[2] == pytest.approx(1.2)
        assert volume.notes == ("slices resampled linearly: 11, 1.2 mm apart, from 4 that were 1.2 to 6.8 mm apart",)

    def test_a_rod_in_a_tilted_uneven_stack_comes_out_straight(self, tmp_path: Path) -> None:
        shape = (40, 33, 33)
        places = indices_of(shape) @ TILTED[:3, :3].T + TILTED[:3, 3]
        rod = (1000 * (np.hypot(places[:, 0], places[:, 1]) < 5)).reshape(shape).astype(np.int16)
        folder = write_uneven(tmp_path, rod, TILTED, [0, 7, 9, 20, 39])
        volume = read_volume(folder, settings=RESAMPLE)
        assert np.abs(middles(volume)[:, :2]).max() < 0.25
        assert any("18.5 degrees" in note for note in volume.notes)


def middles(volume: Volume) -> NDArray[np.float64]:
    """Return the mean place of each slice, weighted by its gray levels, mm."""
    weights = volume.voxels.astype(float).reshape(len(volume.voxels), -1)
    k, j, i = np.indices(volume.shape).reshape(3, len(volume.voxels), -1)
    return volume.to_mm(np.stack([(n * weights).sum(axis=1) / weights.sum(axis=1) for n in (i, j, k)], axis=1))


@pytest.fixture(scope="module")
def volume() -> Volume:
    return read_volume(shared(HEAD), settings=RESAMPLE)


@pytest.fixture(scope="module")
def slices() -> list[pydicom.Dataset]:
    found = [pydicom.dcmread(path) for path in shared(HEAD).iterdir()]
    return sorted(found, key=lambda data: float(data.ImagePositionPatient[2]))


class TestHead:
    """A head, 18.5 degrees of tilt, its slices 1.1, 4 and 7 mm apart; its truth is worked out from each file."""

    def test_it_is_refused_with_the_flag_that_reads_it(self) -> None:
        with pytest.raises(GeometryError, match=r"varies.*1\.081 to 6\.999 mm.*--resample-slices"):
            read_volume(shared(HEAD))

    def test_every_pixel_of_every_file_is_where_the_file_says(
        self, volume: Volume, slices: list[pydicom.Dataset]
    ) -> None:
        inverse = np.linalg.inv(volume.affine)
        for data in slices:
            across, down = np.array(data.ImageOrientationPatient, float).reshape(2, 3)
            row, column = map(float, data.PixelSpacing)
            corners = np.array([[i, j] for i in (0, 511) for j in (0, 511)], float)
            places = np.array(data.ImagePositionPatient, float) + corners * [column, row] @ [across, down]
            found = places @ inverse[:3, :3].T + inverse[:3, 3]
            np.testing.assert_allclose(found[:, :2], corners, atol=0.01)
            assert np.ptp(found[:, 2]) < 0.01
            assert -0.01 < found[0, 2] < volume.shape[0] - 0.99

    def test_gray_levels_lie_on_the_line_between_the_files(self, volume: Volume, slices: list[pydicom.Dataset]) -> None:
        heights = [float(data.ImagePositionPatient[2]) for data in slices]
        stored = np.array([data.pixel_array[::7, ::7] * float(data.RescaleSlope) for data in slices])
        stored += float(slices[0].RescaleIntercept)
        wanted = volume.affine[2, 3] + volume.affine[2, 2] * np.arange(volume.shape[0])
        for j, i in np.ndindex(stored.shape[1:]):
            expected = np.interp(wanted, heights, stored[:, j, i])
            assert np.abs(volume.voxels[:, 7 * j, 7 * i] - expected).max() <= 30
        ends = stored[[0, -1]]
        np.testing.assert_array_equal(volume.voxels[[0, -1], ::7, ::7], ends)

    @pytest.mark.parametrize(("above", "share"), [(-300, 1e-3), (300, 1e-2)])
    def test_skin_and_bone_stay_within_a_pixel_of_where_they_are_in_the_files(
        self, volume: Volume, slices: list[pydicom.Dataset], above: float, share: float
    ) -> None:
        inverse = np.linalg.inv(volume.affine)
        j, i = np.indices((512, 512)).reshape(2, -1, 1)
        for data in slices[::4]:
            across, down = np.array(data.ImageOrientationPatient, float).reshape(2, 3) * float(data.PixelSpacing[0])
            places = np.array(data.ImagePositionPatient, float) + i * across + j * down
            indices = (places @ inverse[:3, :3].T + inverse[:3, 3]).T[::-1]
            gray = data.pixel_array * float(data.RescaleSlope) + float(data.RescaleIntercept)
            truth = gray > above
            found = map_coordinates(volume.voxels, indices, np.float32, order=1, mode="nearest") > above
            found = found.reshape(truth.shape)
            far = (found & ~near(truth)) | (truth & ~near(found))
            assert far.sum() < share * truth.sum()


def near(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the pixels of a mask and their neighbors."""
    return np.asarray(binary_dilation(mask, np.ones((3, 3), bool)))
