"""Studies and labels as other programs write them: rows of docs/writers.md, made by the writer itself."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest

from segmentations import by_highdicom, palette, sources
from studies import AFFINES, LPS_TO_RAS, assert_in_place, sampled, save, set_pixels, write_series
from tomomesh.io import read_volume
from tomomesh.model.volume import Volume
from writers import as_image, needed

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Writer = Callable[[Path, NDArray[Any], Floats], Path]

sitk: Any = needed("SimpleITK")

PAGE = Path(__file__).parents[1] / "docs" / "writers.md"
PLACES = ["axial", "oblique", "oblique sagittal"]
SHAPE = (9, 12, 14)


def tool(name: str) -> str:
    """Return the path of a program that a package of PyPI brings; skip the test where it is not installed."""
    found = shutil.which(name) or shutil.which(name, path=str(Path(sys.executable).parent))
    if found is None:
        pytest.skip(f"the program {name} is not here: pip install {WHEELS[name]}")
    return found


WHEELS = {"dcm2niix": "dcm2niix", "itkimage2segimage": "dcmqi"}


def by_nibabel(folder: Path, stored: NDArray[Any], affine: Floats) -> Path:
    nibabel.save(nibabel.Nifti1Image(stored.T, LPS_TO_RAS @ affine), folder / "s.nii.gz")
    return folder / "s.nii.gz"


def by_nibabel_2(folder: Path, stored: NDArray[Any], affine: Floats) -> Path:
    nibabel.save(nibabel.Nifti2Image(stored.T, LPS_TO_RAS @ affine), folder / "s.nii")
    return folder / "s.nii"


def scaled_by_nibabel(folder: Path, stored: NDArray[Any], affine: Floats) -> Path:
    """Real numbers in 16 bits: nibabel finds a slope and an intercept."""
    image = nibabel.Nifti1Image(stored.T.astype(np.float64), LPS_TO_RAS @ affine)
    image.set_data_dtype(np.int16)
    nibabel.save(image, folder / "s.nii")
    return folder / "s.nii"


def by_simpleitk(suffix: str) -> Writer:
    def write(folder: Path, stored: NDArray[Any], affine: Floats) -> Path:
        sitk.WriteImage(as_image(stored, affine), str(folder / f"s{suffix}"))
        return folder / f"s{suffix}"

    return write


def slices_by_simpleitk(folder: Path, stored: NDArray[Any], affine: Floats) -> Path:
    """Slices as SimpleITK's own example writes them."""
    writer: Any = sitk.ImageFileWriter()
    writer.KeepOriginalImageUIDOn()
    for k, plane in enumerate(stored):
        image = sitk.GetImageFromArray(plane[None])
        spacing = np.linalg.norm(affine[:3, :3], axis=0)
        image.SetSpacing(spacing.tolist())
        fields = {
            "0008|0060": "MR", "0020|000e": "1.2.826.0.1.3680043.2.1125.9", "0020|0013": str(k),
            "0020|0032": "\\".join(f"{v:.6f}" for v in affine[:3, 3] + k * affine[:3, 2]),
            "0020|0037": "\\".join(f"{v:.8f}" for v in (affine[:3, :2] / spacing[:2]).T.ravel()),
        }  # fmt: skip
        for key, value in fields.items():
            image.SetMetaData(key, value)
        writer.SetFileName(str(folder / "series" / f"{k}.dcm"))
        (folder / "series").mkdir(exist_ok=True)
        writer.Execute(image)
    return folder / "series"


def by_dcm2niix(folder: Path, stored: NDArray[Any], affine: Floats) -> Path:
    series = write_series(folder / "series", stored, affine)
    command = [tool("dcm2niix"), "-z", "y", "-f", "s", "-o", str(folder), str(series)]
    subprocess.run(command, check=True, capture_output=True)
    return folder / "s.nii.gz"


def nrrd_by_dcm2niix(folder: Path, stored: NDArray[Any], affine: Floats) -> Path:
    series = write_series(folder / "series", stored, affine)
    command = [tool("dcm2niix"), "-e", "y", "-z", "y", "-f", "s", "-o", str(folder), str(series)]
    subprocess.run(command, check=True, capture_output=True)
    return folder / "s.nhdr"


def by_vtk(folder: Path, stored: NDArray[Any], affine: Floats) -> Path:
    """An sform from a matrix of directions and origin, and a qform of the image, which stands upright, beside it."""
    vtk = needed("vtk")
    from vtkmodules.util.numpy_support import numpy_to_vtk

    image, matrix = vtk.vtkImageData(), vtk.vtkMatrix4x4()
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    image.SetDimensions(*stored.shape[::-1])
    image.SetSpacing(*spacing)
    image.GetPointData().SetScalars(numpy_to_vtk(stored.ravel(), deep=True))
    placed = LPS_TO_RAS @ affine
    placed[:3, :3] /= spacing
    for row, column in np.ndindex(4, 4):
        matrix.SetElement(row, column, placed[row, column])
    writer = vtk.vtkNIFTIImageWriter()
    writer.SetFileName(str(folder / "s.nii"))
    writer.SetInputData(image)
    writer.SetSFormMatrix(matrix)
    writer.Write()
    return folder / "s.nii"


def converted_by_highdicom(folder: Path, stored: NDArray[Any], affine: Floats) -> Path:
    """Slices of a CT in one file, with the functional groups that their headers give."""
    hd = needed("highdicom")
    from pydicom.uid import generate_uid

    slices = sources(SHAPE, affine)
    for k, data in enumerate(slices):
        set_pixels(data, stored[k])
        data.RescaleSlope, data.RescaleIntercept, data.RescaleType = 1, 0, "HU"
        data.ImageType, data.KVP, data.Manufacturer = ["ORIGINAL", "PRIMARY", "AXIAL"], 120, "maker"
        data.PatientPosition, data.AcquisitionDate, data.AcquisitionTime = "HFS", "20260101", "120000"
        data.ContentDate, data.ContentTime = data.AcquisitionDate, data.AcquisitionTime
    made = hd.legacy.LegacyConvertedEnhancedCTImage(slices, generate_uid(), 1, generate_uid(), 1)
    return save(made, folder / "ct.dcm")


def map_by_highdicom(folder: Path, stored: NDArray[Any], affine: Floats) -> Path:
    """Real numbers in a parametric map: floating-point pixels behind functional groups."""
    hd = needed("highdicom")
    from pydicom.sr.codedict import codes
    from pydicom.uid import generate_uid

    mapping = hd.pm.RealWorldValueMapping(
        lut_label="1", lut_explanation="levels", unit=codes.UCUM.NoUnits, value_range=[-1e6, 1e6], intercept=0, slope=1
    )
    made = hd.pm.ParametricMap(
        sources(SHAPE, affine), stored.astype(np.float32), generate_uid(), 1, generate_uid(), 1, "maker", "model", "1",
        "1", contains_recognizable_visual_features=False, real_world_value_mappings=[mapping],
        voi_lut_transformations=[hd.VOILUTTransformation(window_center=0, window_width=100)],
    )  # fmt: skip
    return save(made, folder / "map.dcm")


STUDIES: dict[str, Writer] = {
    "nibabel, NIfTI-1": by_nibabel,
    "nibabel, NIfTI-2": by_nibabel_2,
    "nibabel, real numbers in 16 bits": scaled_by_nibabel,
    "SimpleITK, `.nii.gz`": by_simpleitk(".nii.gz"),
    "SimpleITK, `.nrrd`": by_simpleitk(".nrrd"),
    "SimpleITK, `.mha`": by_simpleitk(".mha"),
    "SimpleITK, DICOM slices": slices_by_simpleitk,
    "dcm2niix": by_dcm2niix,
    "dcm2niix, NRRD": nrrd_by_dcm2niix,
    "VTK, NIfTI": by_vtk,
    "highdicom, converted enhanced CT": converted_by_highdicom,
    "highdicom, parametric map": map_by_highdicom,
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("writer", STUDIES)
def test_a_study_is_where_its_writer_put_it(tmp_path: Path, writer: str, place: str) -> None:
    affine = AFFINES[place]
    volume = read_volume(STUDIES[writer](tmp_path, sampled(affine, SHAPE), affine))
    assert sorted(volume.shape) == sorted(SHAPE)
    assert_in_place(volume)


def two_labels() -> NDArray[np.uint8]:
    """Two blocks beside one another, neither on the first or last slice."""
    labels = np.zeros(SHAPE, np.uint8)
    labels[2:7, 2:6, 3:8] = 1
    labels[3:6, 6:10, 3:11] = 2
    return labels


def seg_by_highdicom(kind: str, **options: Any) -> Writer:
    def write(folder: Path, labels: NDArray[Any], affine: Floats) -> Path:
        needed("highdicom")
        masks = {n: (labels == n).astype(np.float64 if kind == "FRACTIONAL" else np.uint8) for n in (1, 2)}
        chosen = {key: value() for key, value in options.items()}
        by_highdicom(masks, affine, folder / "seg.dcm", kind, **chosen)
        return folder / "seg.dcm"

    return write


def seg_by_dcmqi(kind: str) -> Writer:
    def write(folder: Path, labels: NDArray[Any], affine: Floats) -> Path:
        return _by_dcmqi(folder, labels, affine, kind)

    return write


def _by_dcmqi(folder: Path, labels: NDArray[Any], affine: Floats, kind: str) -> Path:
    program = tool("itkimage2segimage")
    for k, data in enumerate(sources(SHAPE, affine)):
        save(data, folder / "ct" / f"{k}.dcm")
    sitk.WriteImage(as_image(labels, affine), str(folder / "labels.nrrd"))
    code = {"CodeValue": "85756007", "CodingSchemeDesignator": "SCT", "CodeMeaning": "Tissue"}
    described = [
        {
            "labelID": n, "SegmentDescription": f"block {n}", "SegmentAlgorithmType": "MANUAL",
            "SegmentedPropertyCategoryCodeSequence": code, "SegmentedPropertyTypeCodeSequence": code,
        }
        for n in (1, 2)
    ]  # fmt: skip
    head = {"ContentCreatorName": "Nobody", "SeriesDescription": "s", "SeriesNumber": "300", "InstanceNumber": "1"}
    (folder / "meta.json").write_text(json.dumps(head | {"segmentAttributes": [described]}), encoding="utf-8")
    subprocess.run(
        [
            program, "--inputImageList", str(folder / "labels.nrrd"), "--inputDICOMDirectory", str(folder / "ct"),
            "--inputMetadata", str(folder / "meta.json"), "--outputDICOM", str(folder / "seg.dcm"), "--skip", "1",
            "--segmentationType", kind,
        ],
        check=True, capture_output=True,
    )  # fmt: skip
    return folder / "seg.dcm"


LABELS: dict[str, Writer] = {
    "highdicom, SEG `BINARY`": seg_by_highdicom("BINARY"),
    "highdicom, SEG `FRACTIONAL`": seg_by_highdicom("FRACTIONAL"),
    "highdicom, SEG `LABELMAP`": seg_by_highdicom("LABELMAP"),
    "highdicom, SEG `LABELMAP` with colors": seg_by_highdicom("LABELMAP", palette_color_lut_transformation=palette),
    "dcmqi, SEG": seg_by_dcmqi("binary"),
    "dcmqi, SEG as a label map": seg_by_dcmqi("labelmap"),
    "SimpleITK, labels in `.nii.gz`": by_simpleitk(".nii.gz"),
    "nibabel, labels": by_nibabel,
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("writer", LABELS)
def test_labels_are_where_their_writer_put_them(tmp_path: Path, writer: str, place: str) -> None:
    affine, labels = AFFINES[place], two_labels()
    volume = read_volume(LABELS[writer](tmp_path, labels, affine))
    truth = Volume.from_stored(labels, affine)
    for number in (1, 2):
        found, expected = (
            one.to_mm(np.argwhere(one.voxels == number)[:, ::-1].astype(float)) for one in (volume, truth)
        )
        assert len(found) == len(expected)
        np.testing.assert_allclose(found.mean(axis=0), expected.mean(axis=0), atol=1e-3)
        np.testing.assert_allclose(np.cov(found.T), np.cov(expected.T), atol=1e-3)


def test_the_page_has_a_row_for_each() -> None:
    rows = [
        line.split(" | ")[0].removeprefix("| ")
        for line in PAGE.read_text(encoding="utf-8").partition("## Arrays")[0].splitlines()
        if line.startswith("| ")
    ]
    assert [row for row in rows if row != "writer"] == [*STUDIES, *LABELS]
