#!/usr/bin/env bash
# The frames of an enhanced CT file may come in any order; SimpleITK stacks them as they come, at half their distance.
#
# Versions: SimpleITK 2.5.7, pydicom 3.0.2, highdicom 0.28.2 (numpy 2.4.6), Python 3.11.
# Input: four CT slices 2 mm apart, turned into one enhanced file by highdicom's own converter; then the same file with
#   its two middle frames exchanged, pixels and functional groups together. Where a frame belongs is said by its
#   position, its number in the stack and its dimension index, not by its place in the file.
# Behavior: SimpleITK does not sort frames by position. For the exchanged file it gives the slices in the order of the
#   file and another spacing, though the file states 2 mm. highdicom's get_volume sorts. None warns.
# Output: SimpleITK gives slices 40, 30, 20, 10 at 2 mm, then 40, 20, 30, 10 at 1 mm. highdicom gives 40, 30, 20, 10 at
#   2 mm for both.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check \
    SimpleITK==2.5.7 pydicom==3.0.2 highdicom==0.28.2 numpy==2.4.6 || exit 3

venv/bin/python -W ignore - <<'END'
from importlib.metadata import version

import highdicom
import numpy as np
import SimpleITK as sitk
from highdicom.legacy import LegacyConvertedEnhancedCTImage
from pydicom import dcmread
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, generate_uid

print({name: version(name) for name in ("SimpleITK", "pydicom", "highdicom", "numpy")})
study, series, frame = generate_uid(), generate_uid(), generate_uid()
EMPTY = ("PatientName", "PatientID", "PatientBirthDate", "PatientSex", "StudyDate", "StudyTime", "AccessionNumber",
         "StudyID", "ReferringPhysicianName", "PositionReferenceIndicator", "KVP")


def ct(number):
    """Return one slice of a CT series, 10 times its number in every pixel."""
    slice_ = Dataset()
    slice_.SOPClassUID, slice_.SOPInstanceUID = CTImageStorage, generate_uid()
    slice_.file_meta = FileMetaDataset()
    slice_.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    slice_.StudyInstanceUID, slice_.SeriesInstanceUID, slice_.FrameOfReferenceUID = study, series, frame
    for name in EMPTY:
        setattr(slice_, name, None)
    slice_.Modality, slice_.ImageType = "CT", ["ORIGINAL", "PRIMARY", "AXIAL"]
    slice_.Manufacturer, slice_.PatientPosition, slice_.BurnedInAnnotation = "none", "HFS", "NO"
    slice_.SeriesNumber, slice_.InstanceNumber, slice_.AcquisitionNumber = 1, number, 1
    slice_.AcquisitionDate = slice_.ContentDate = "20200101"
    slice_.AcquisitionTime = slice_.ContentTime = "120000"
    slice_.PixelSpacing, slice_.SliceThickness = [1, 1], 2
    slice_.ImageOrientationPatient, slice_.ImagePositionPatient = [1, 0, 0, 0, 1, 0], [0, 0, 2 * number]
    slice_.Rows = slice_.Columns = 4
    slice_.SamplesPerPixel, slice_.PhotometricInterpretation = 1, "MONOCHROME2"
    slice_.BitsAllocated, slice_.BitsStored, slice_.HighBit, slice_.PixelRepresentation = 16, 16, 15, 1
    slice_.RescaleSlope, slice_.RescaleIntercept = 1, 0
    slice_.PixelData = np.full((4, 4), 10 * number, np.int16).tobytes()
    return slice_


LegacyConvertedEnhancedCTImage(
    [ct(number) for number in (1, 2, 3, 4)],
    series_instance_uid=generate_uid(), series_number=2, sop_instance_uid=generate_uid(), instance_number=1,
).save_as("sorted.dcm")

data = dcmread("sorted.dcm")
order = [0, 2, 1, 3]
groups = data.PerFrameFunctionalGroupsSequence
data.PerFrameFunctionalGroupsSequence = [groups[n] for n in order]
data.PixelData = data.pixel_array[order].tobytes()
data.save_as("exchanged.dcm")

found = {}
for name in ("sorted", "exchanged"):
    itk, judge = sitk.ReadImage(f"{name}.dcm"), highdicom.imread(f"{name}.dcm").get_volume()
    itk_values, judge_values = sitk.GetArrayFromImage(itk)[:, 0, 0].tolist(), judge.array[:, 0, 0].tolist()
    found[name] = itk_values, itk.GetSpacing()[2], judge_values, judge.spacing[0]
    measures = dcmread(f"{name}.dcm").SharedFunctionalGroupsSequence[0].PixelMeasuresSequence[0]
    print(f"{name}: stated {measures.SpacingBetweenSlices} mm; SimpleITK {itk_values} at {itk.GetSpacing()[2]} mm; "
          f"highdicom {judge_values} at {judge.spacing[0]} mm")

right = [40, 30, 20, 10]
known = {"sorted": (right, 2, right, 2), "exchanged": ([40, 20, 30, 10], 1, right, 2)}
raise SystemExit(0 if found == known else "changed: other slices or distances than recorded")
END
