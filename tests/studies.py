"""Synthetic studies in every format: the gray level of a voxel is a known function of its place."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import CTImageStorage, EnhancedMRImageStorage, ExplicitVRLittleEndian, MRImageStorage

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tomomesh.model.volume import Volume

DATA = Path(__file__).parents[2] / "shared" / "data"
LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
SHAPE = (5, 7, 9)


def shared(name: str) -> Path:
    """Return a path of the public data beside the project; skip the test where they are not there."""
    if not DATA.is_dir():
        pytest.skip("the public data (../shared/data) are not here")
    return DATA / name


def rotation(x: float, y: float, z: float) -> NDArray[np.float64]:
    """Return the rotation by angles about the three axes, one after the other."""
    turned = np.eye(3)
    for axis, angle in enumerate((x, y, z)):
        a, b = [n for n in range(3) if n != axis]
        step = np.eye(3)
        step[a, a] = step[b, b] = np.cos(angle)
        step[a, b], step[b, a] = -np.sin(angle), np.sin(angle)
        turned = step @ turned
    return turned


def affine_of(
    directions: NDArray[np.float64],
    spacing: tuple[float, float, float] = (0.5, 0.7, 2.0),
    origin: tuple[float, float, float] = (-3.0, 11.0, 40.0),
) -> NDArray[np.float64]:
    """Return index (i, j, k) to millimeters."""
    affine = np.eye(4)
    affine[:3, :3] = directions * spacing
    affine[:3, 3] = origin
    return affine


AFFINES = {
    "axial": affine_of(np.eye(3)),
    "oblique": affine_of(rotation(0.2, -0.3, 0.4)),
    "sagittal": affine_of(np.array([[0.0, 0, 1], [1, 0, 0], [0, -1, 0]])),
    "coronal": affine_of(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])),
    "oblique sagittal": affine_of(rotation(0.1, 0.2, -0.2) @ np.array([[0.0, 0, 1], [1, 0, 0], [0, -1, 0]])),
}


TURNED = {
    **AFFINES,
    "left-handed": affine_of(rotation(0.2, -0.3, 0.4) @ np.diag([1.0, -1.0, 1.0])),
    "upside down": affine_of(np.diag([-1.0, 1.0, -1.0])),
}
SHEARED = affine_of(rotation(0.1, 0.2, -0.2) @ np.array([[1.0, 0.1, 0], [0, 1, 0.3], [0, 0, 1]]))


def gray_at(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the gray level at (n, 3) millimeters: no turn, flip or shift leaves it as it is."""
    x, y, z = places.T
    return np.asarray(2000 + 30 * x - 50 * y + 7 * z + 0.5 * (x - 2) * (y + 5))


def indices_of(shape: tuple[int, int, int]) -> NDArray[np.float64]:
    """Return the (i, j, k) of all voxels of an array (K, J, I)."""
    k, j, i = np.indices(shape).reshape(3, -1)
    return np.stack([i, j, k], axis=1).astype(np.float64)


def sampled(affine: NDArray[np.float64], shape: tuple[int, int, int] = SHAPE) -> NDArray[np.int16]:
    """Return the gray levels on a grid, (K, J, I)."""
    places = indices_of(shape) @ affine[:3, :3].T + affine[:3, 3]
    return np.rint(gray_at(places)).reshape(shape).astype(np.int16)


def assert_in_place(volume: Volume, tolerance: float = 0.51) -> None:
    """Check that every voxel is where its gray level says."""
    expected = gray_at(volume.to_mm(indices_of(volume.shape))).reshape(volume.shape)
    assert np.abs(volume.voxels - expected).max() <= tolerance


def write_nifti(
    path: Path, stored: NDArray[Any], affine: NDArray[np.float64], edit: Callable[[Any], None] | None = None
) -> Path:
    """Write an array (K, J, I) with its LPS affine; `edit` changes raw fields of the header."""
    image = nibabel.Nifti1Image(stored.T, LPS_TO_RAS @ affine)
    image.header.set_xyzt_units("mm")
    raw = bytearray(image.to_bytes())
    if edit:
        header = nibabel.Nifti1Header(bytes(raw[:348]), check=False)
        edit(header)
        raw[:348] = header.binaryblock
    path.write_bytes(bytes(raw))
    return path


def slice_dataset(pixels: NDArray[Any], affine: NDArray[np.float64], k: int) -> Dataset:
    """Return slice k of a plain DICOM series."""
    data = Dataset()
    data.file_meta = FileMetaDataset()
    data.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    data.SOPClassUID = data.file_meta.MediaStorageSOPClassUID = MRImageStorage
    data.SOPInstanceUID = data.file_meta.MediaStorageSOPInstanceUID = f"1.2.3.{k + 1}"
    data.SeriesInstanceUID, data.SeriesNumber, data.InstanceNumber = "1.2.3", 4, k + 1
    data.Modality, data.PatientName, data.PatientID = "MR", "Secret^Name", "SECRET-ID"
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    data.ImageOrientationPatient = [float(f"{v:.10f}") for v in (affine[:3, :2] / spacing[:2]).T.ravel()]
    data.ImagePositionPatient = [float(f"{v:.9f}") for v in affine[:3, 3] + k * affine[:3, 2]]
    data.PixelSpacing = [float(f"{spacing[1]:.10f}"), float(f"{spacing[0]:.10f}")]
    set_pixels(data, pixels)
    return data


def set_pixels(data: Dataset, pixels: NDArray[Any]) -> None:
    """Put pixels (J, I), (J, I, 3) or frames of gray pixels (F, J, I) into a dataset."""
    color = pixels.ndim == 3 and pixels.shape[2] == 3
    data.Rows, data.Columns = pixels.shape[:2] if color or pixels.ndim == 2 else pixels.shape[1:]
    data.SamplesPerPixel = 3 if color else 1
    data.PhotometricInterpretation = "RGB" if color else "MONOCHROME2"
    if color:
        data.PlanarConfiguration = 0
    data.BitsAllocated = data.BitsStored = 8 * pixels.itemsize
    data.HighBit, data.PixelRepresentation = data.BitsStored - 1, int(pixels.dtype.kind == "i")
    data["PixelData"] = _pixel_element(pixels)


def _pixel_element(pixels: NDArray[Any]) -> Any:
    from pydicom.dataelem import DataElement

    raw = pixels.astype(pixels.dtype.newbyteorder("<")).tobytes()
    return DataElement(0x7FE00010, "OB" if pixels.itemsize == 1 else "OW", raw + b"\0" * (len(raw) % 2))


def save(data: Dataset, path: Path) -> Path:
    """Write a dataset as a DICOM file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    data.save_as(path, enforce_file_format=True)
    return path


def write_series(
    folder: Path,
    stored: NDArray[Any],
    affine: NDArray[np.float64],
    edit: Callable[[Dataset, int], None] | None = None,
    slices: list[int] | None = None,
) -> Path:
    """Write an array (K, J, I) as a series; `edit` changes each slice, `slices` leaves some out."""
    for k in range(len(stored)) if slices is None else slices:
        data = slice_dataset(stored[k], affine, k)
        if edit:
            edit(data, k)
        save(data, folder / f"{(k * 7) % 11:02d}-{k}.dcm")
    return folder


def as_ct(data: Dataset, k: int) -> None:
    """Make a slice one of a CT."""
    data.SOPClassUID = data.file_meta.MediaStorageSOPClassUID = CTImageStorage
    data.Modality = "CT"


def enhanced(stored: NDArray[Any], affine: NDArray[np.float64], order: list[int]) -> Dataset:
    """Return an enhanced multi-frame file whose frames are in some order."""
    data = slice_dataset(stored[0], affine, 0)
    data.SOPClassUID = data.file_meta.MediaStorageSOPClassUID = EnhancedMRImageStorage
    plain = [slice_dataset(stored[k], affine, k) for k in order]
    set_pixels(data, stored[order])
    data.NumberOfFrames = len(order)
    for keyword in ("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing"):
        delattr(data, keyword)
    data.PerFrameFunctionalGroupsSequence = Sequence([_frame_groups(one) for one in plain])
    data.SharedFunctionalGroupsSequence = Sequence(
        [_group("PixelMeasuresSequence", PixelSpacing=plain[0].PixelSpacing)]
    )
    return data


def _frame_groups(plain: Dataset) -> Dataset:
    groups = _group("PlanePositionSequence", ImagePositionPatient=plain.ImagePositionPatient)
    groups.update(_group("PlaneOrientationSequence", ImageOrientationPatient=plain.ImageOrientationPatient))
    groups.update(_group("PixelValueTransformationSequence", RescaleSlope=1, RescaleIntercept=0))
    return groups


def _group(sequence: str, **fields: Any) -> Dataset:
    item, groups = Dataset(), Dataset()
    for keyword, value in fields.items():
        setattr(item, keyword, value)
    setattr(groups, sequence, Sequence([item]))
    return groups


def setting(**fields: Any) -> Callable[[Dataset, int], None]:
    """Return an edit that sets fields of every slice; a list holds one value a slice."""

    def edit(data: Dataset, k: int) -> None:
        for keyword, value in fields.items():
            setattr(data, keyword, value[k] if isinstance(value, tuple) else value)

    return edit


def without(*keywords: str) -> Callable[[Dataset, int], None]:
    """Return an edit that takes fields out of every slice."""

    def edit(data: Dataset, k: int) -> None:
        for keyword in keywords:
            delattr(data, keyword)

    return edit
