#!/usr/bin/env bash
# A CT that says nothing of its unit, which means Hounsfield units, says that it is unspecified once ITK has copied it.
#
# Versions: SimpleITK 2.5.7 (ITK 5.4 with GDCM 3.2), pydicom 3.0.2 (numpy 2.4.6), Python 3.11.
# Input: a CT slice in Hounsfield units without a RescaleType, made by pydicom; the standard asks for one only where the
#   numbers are something else (PS3.3, C.8.2.1).
# Behavior: SimpleITK reads it and writes it back with all fields that it has read. GDCM, which writes for ITK, adds the
#   RescaleType US, unspecified. No warning. Programs that go by the field take it for no CT numbers any more.
# Output: no type before, US after; the gray levels are the same.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check \
    SimpleITK==2.5.7 pydicom==3.0.2 numpy==2.4.6 || exit 3

venv/bin/python -W ignore - <<'END'
from importlib.metadata import version

import numpy as np
import SimpleITK as sitk
from pydicom import dcmread
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, generate_uid

print({name: version(name) for name in ("SimpleITK", "pydicom", "numpy")})
slice_ = Dataset()
slice_.file_meta = FileMetaDataset()
slice_.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
slice_.SOPClassUID, slice_.SOPInstanceUID, slice_.Modality = CTImageStorage, generate_uid(), "CT"
slice_.StudyInstanceUID, slice_.SeriesInstanceUID = generate_uid(), generate_uid()
slice_.PixelSpacing, slice_.ImagePositionPatient, slice_.ImageOrientationPatient = [1, 1], [0, 0, 0], [1, 0, 0, 0, 1, 0]
slice_.Rows = slice_.Columns = 4
slice_.SamplesPerPixel, slice_.PhotometricInterpretation = 1, "MONOCHROME2"
slice_.BitsAllocated, slice_.BitsStored, slice_.HighBit, slice_.PixelRepresentation = 16, 16, 15, 0
slice_.RescaleIntercept, slice_.RescaleSlope = -1024, 1
slice_.PixelData = np.full((4, 4), 1064, np.uint16).tobytes()
slice_.save_as("ct.dcm", enforce_file_format=True)

reader, writer = sitk.ImageFileReader(), sitk.ImageFileWriter()
reader.SetFileName("ct.dcm")
reader.LoadPrivateTagsOn()
image = reader.Execute()
for key in reader.GetMetaDataKeys():
    image.SetMetaData(key, reader.GetMetaData(key))
writer.KeepOriginalImageUIDOn()
writer.SetFileName("again.dcm")
writer.Execute(image)

before, after = dcmread("ct.dcm"), dcmread("again.dcm")
levels = [int(sitk.GetArrayFromImage(sitk.ReadImage(name)).max()) for name in ("ct.dcm", "again.dcm")]
print("RescaleType:", before.get("RescaleType"), "then", after.get("RescaleType"), "- gray levels:", levels)
same = "RescaleType" not in before and after.get("RescaleType") == "US" and levels == [40, 40]
raise SystemExit(0 if same else "changed: another type, or other levels, than recorded")
END
