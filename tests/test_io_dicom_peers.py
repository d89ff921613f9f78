"""Every valid public DICOM series beside SimpleITK: the same voxels at the same millimeters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pydicom
import pytest

from studies import shared
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tomomesh.model.volume import Volume

sitk: Any = pytest.importorskip("SimpleITK")

FOLDERS = (
    "dicom2nifti/siemens/anatomical/001",
    "dicom2nifti/philips/anatomical/001",
    "dicom2nifti/generic/anatomical/001",
    "dicom2nifti/generic/anatomical/002_non_isotropic",
    "dicom2nifti/generic/compressed_jpeg/001",
    "dicom2nifti/generic/compressed_jpegls/001",
    "dicom2nifti/generic/compressed_rle/001",
    "dicom2nifti/generic/rgb/001",
    "dicom2nifti/failing/slicecount/001",
    "totalsegmentator/example_ct_dicom",
)
SERIES = (
    ("derived/mixed_multi_series", 2),
    ("derived/mixed_multi_series", 3),
    ("dicom2nifti/failing/sliceorientation/001", 1),
    ("dicom2nifti/failing/sliceorientation/001", 2),
)
FILES = ("dicom2nifti/philips_enhanced/anatomical/001/IM-0001-0170-0001.dcm", "niivue/demos/images/enh.dcm")


def affine_from(image: Any) -> NDArray[np.float64]:
    affine = np.eye(4)
    affine[:3, :3] = np.array(image.GetDirection()).reshape(3, 3) * image.GetSpacing()
    affine[:3, 3] = image.GetOrigin()
    return affine


def assert_the_same(volume: Volume, image: Any) -> None:
    """Compare the voxels in the order of the file, and both ways from an index to millimeters."""
    layers = np.moveaxis(volume.voxels.reshape(*volume.shape, -1), -1, 0)
    stored = np.stack([volume.grid.restore(layer) for layer in layers], axis=-1)
    np.testing.assert_allclose(np.squeeze(stored), sitk.GetArrayFromImage(image), rtol=1e-6)
    np.testing.assert_allclose(volume.grid.affine, affine_from(image), atol=1e-4)
    k, j, i = volume.shape
    corners = np.array([[0, 0, 0], [i - 1, 0, 0], [0, j - 1, 0], [0, 0, k - 1]], float)
    other = [image.TransformPhysicalPointToIndex(place) for place in volume.to_mm(corners).tolist()]
    for (i, j, k), index in zip(corners.astype(int), other, strict=True):
        np.testing.assert_allclose(volume.voxels[k, j, i], image.GetPixel(index), rtol=1e-6)


def read_series(files: list[Path]) -> Any:
    ordered = sorted(files, key=height)
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames([str(path) for path in ordered])
    return reader.Execute()


def height(path: Path) -> float:
    header = pydicom.dcmread(path, stop_before_pixels=True)
    across, down = np.array(header.ImageOrientationPatient, float).reshape(2, 3)
    return float(np.array(header.ImagePositionPatient, float) @ np.cross(across, down))


def series_of(path: Path) -> tuple[float, str]:
    header = pydicom.dcmread(path, stop_before_pixels=True)
    return float(header.SeriesNumber), str(header.SeriesInstanceUID)


@pytest.fixture(autouse=True)
def quiet() -> None:
    sitk.ProcessObject.SetGlobalWarningDisplay(False)


@pytest.mark.parametrize("name", FOLDERS)
def test_folders(name: str) -> None:
    folder = shared(name)
    assert_the_same(read_volume(folder), read_series(list(folder.iterdir())))


@pytest.mark.parametrize(("name", "series"), SERIES)
def test_series_of_mixed_folders(name: str, series: int) -> None:
    folder = shared(name)
    files = list(folder.iterdir())
    wanted = sorted({series_of(path) for path in files})[series - 1]
    chosen = [path for path in files if series_of(path) == wanted]
    assert_the_same(read_volume(folder, settings=ReadSettings(series=series)), read_series(chosen))


@pytest.mark.parametrize("name", FILES)
def test_enhanced_files(name: str) -> None:
    assert_the_same(read_volume(shared(name)), sitk.ReadImage(str(shared(name))))


def test_slices_under_gantry_tilt_one_by_one() -> None:
    """SimpleITK knows no shear: every slice is compared alone, at its own place."""
    volume = read_volume(shared("dicom2nifti/failing/gantrytilting/001"))
    files = sorted(shared("dicom2nifti/failing/gantrytilting/001").iterdir(), key=height)
    assert len(files) == volume.shape[0]
    for k, path in enumerate(files):
        image = sitk.ReadImage(str(path))
        np.testing.assert_array_equal(volume.voxels[k], sitk.GetArrayFromImage(image)[0])
        for i, j in ((0, 0), (511, 0), (0, 511)):
            [place] = volume.to_mm(np.array([[i, j, k]], float))
            np.testing.assert_allclose(place, image.TransformIndexToPhysicalPoint((i, j, 0)), atol=1e-4)
