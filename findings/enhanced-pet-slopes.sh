#!/usr/bin/env bash
# The slices of an enhanced PET file have a rescale slope each; SimpleITK takes one frame's for all, pydicom none.
#
# Versions: SimpleITK 2.5.7, pydicom 3.0.2, highdicom 0.28.2 (numpy 2.4.6), Python 3.11.
# Input: three PET slices of the stored value 100 with slopes 1, 2 and 4 (scanners scale every slice on its own),
#   turned into one enhanced file by highdicom's own converter, which keeps the slopes in the frames' functional groups.
# Behavior: SimpleITK multiplies all slices by the slope of the first frame in the file. pydicom's apply_rescale looks
#   for a slope beside the pixels alone and gives the stored values back. highdicom's get_frames is right. None warns.
# Output: in the order of the file (from the top slice down) 400, 400, 400 by SimpleITK; 100, 100, 100 by pydicom;
#   400, 200, 100 by highdicom.
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
from highdicom.legacy import LegacyConvertedEnhancedPETImage
from pydicom import dcmread
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.pixels import apply_rescale
from pydicom.uid import ExplicitVRLittleEndian, PositronEmissionTomographyImageStorage, generate_uid

print({name: version(name) for name in ("SimpleITK", "pydicom", "highdicom", "numpy")})
study, series, frame = generate_uid(), generate_uid(), generate_uid()
EMPTY = ("PatientName", "PatientID", "PatientBirthDate", "PatientSex", "StudyDate", "StudyTime", "AccessionNumber",
         "StudyID", "ReferringPhysicianName", "PositionReferenceIndicator")


def pet(number, slope):
    """Return one slice of a PET series."""
    slice_ = Dataset()
    slice_.SOPClassUID, slice_.SOPInstanceUID = PositronEmissionTomographyImageStorage, generate_uid()
    slice_.file_meta = FileMetaDataset()
    slice_.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    slice_.StudyInstanceUID, slice_.SeriesInstanceUID, slice_.FrameOfReferenceUID = study, series, frame
    for name in EMPTY:
        setattr(slice_, name, "")
    slice_.Modality, slice_.Units, slice_.DecayCorrection = "PT", "BQML", "NONE"
    slice_.ImageType, slice_.SeriesType = ["ORIGINAL", "PRIMARY"], ["STATIC", "IMAGE"]
    slice_.Manufacturer, slice_.PatientPosition, slice_.BurnedInAnnotation = "none", "HFS", "NO"
    slice_.SeriesNumber, slice_.InstanceNumber = 1, number + 1
    slice_.AcquisitionDate = slice_.ContentDate = "20200101"
    slice_.AcquisitionTime = slice_.ContentTime = "120000"
    slice_.PixelSpacing, slice_.SliceThickness = [1, 1], 2
    slice_.ImageOrientationPatient, slice_.ImagePositionPatient = [1, 0, 0, 0, 1, 0], [0, 0, 2 * number]
    slice_.Rows = slice_.Columns = 4
    slice_.SamplesPerPixel, slice_.PhotometricInterpretation = 1, "MONOCHROME2"
    slice_.BitsAllocated, slice_.BitsStored, slice_.HighBit, slice_.PixelRepresentation = 16, 16, 15, 0
    slice_.RescaleSlope, slice_.RescaleIntercept = slope, 0
    slice_.PixelData = np.full((4, 4), 100, np.uint16).tobytes()
    return slice_


LegacyConvertedEnhancedPETImage(
    [pet(number, slope) for number, slope in enumerate((1, 2, 4))],
    series_instance_uid=generate_uid(), series_number=2, sop_instance_uid=generate_uid(), instance_number=1,
).save_as("pet.dcm")

data = dcmread("pet.dcm")
frames = data.PerFrameFunctionalGroupsSequence
stated = [float(frame.PixelValueTransformationSequence[0].RescaleSlope) * 100 for frame in frames]
values = {
    "SimpleITK": sitk.GetArrayFromImage(sitk.ReadImage("pet.dcm"))[:, 0, 0],
    "pydicom": apply_rescale(data.pixel_array, data)[:, 0, 0],
    "highdicom": highdicom.imread("pet.dcm").get_frames()[:, 0, 0],
}
print("the file says:", stated)
for name, found in values.items():
    print(f"{name}: {found}")

known = {"SimpleITK": [stated[0]] * 3, "pydicom": [100] * 3, "highdicom": stated}
same = all(np.array_equal(values[name], known[name]) for name in known)
raise SystemExit(0 if same else "changed: other values than recorded")
END
