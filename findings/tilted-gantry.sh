#!/usr/bin/env bash
# A CT series with a tilted gantry loses its shear in SimpleITK: slices end centimeters from where the file puts them.
#
# Versions: SimpleITK 2.5.7, pydicom 3.0.2 (numpy 2.4.6), Python 3.11.
# Input: 21 CT slices, tilted by 20 degrees, 2 mm apart along the table, as head scans often are. Every file says
#   where its first pixel lies.
# Behavior: SimpleITK's series reader keeps 2 mm as the slices' distance and the normal of the slices as their
#   direction, though they follow each other along the table. No warning, no exception; the same sheared grid in one
#   NIfTI file is refused by the same library.
# Output: the last slice's first pixel is stated at (0, 0, 40) and placed at (0, 13.7, 37.6): 13.9 mm off.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check \
    SimpleITK==2.5.7 pydicom==3.0.2 numpy==2.4.6 || exit 3

mkdir series
venv/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
import SimpleITK as sitk
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, generate_uid

print({name: version(name) for name in ("SimpleITK", "pydicom", "numpy")})
tilt = np.radians(20)
study, series, frame = generate_uid(), generate_uid(), generate_uid()
for number in range(21):
    data = Dataset()
    data.file_meta = FileMetaDataset()
    data.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    data.SOPClassUID = data.file_meta.MediaStorageSOPClassUID = CTImageStorage
    data.SOPInstanceUID = data.file_meta.MediaStorageSOPInstanceUID = generate_uid()
    data.StudyInstanceUID, data.SeriesInstanceUID, data.FrameOfReferenceUID = study, series, frame
    data.Modality, data.SeriesNumber, data.InstanceNumber = "CT", 1, number + 1
    data.PixelSpacing, data.SliceThickness, data.GantryDetectorTilt = [1, 1], 2, 20
    data.ImageOrientationPatient = [1, 0, 0, 0, round(float(np.cos(tilt)), 10), round(float(-np.sin(tilt)), 10)]
    data.ImagePositionPatient = [0, 0, 2 * number]
    data.Rows = data.Columns = 4
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.BitsAllocated, data.BitsStored, data.HighBit, data.PixelRepresentation = 16, 16, 15, 1
    data.RescaleSlope, data.RescaleIntercept = 1, 0
    data.PixelData = np.zeros((4, 4), np.int16).tobytes()
    data.save_as(f"series/{number:02}.dcm", enforce_file_format=True)

reader = sitk.ImageSeriesReader()
reader.SetFileNames(reader.GetGDCMSeriesFileNames("series"))
image = reader.Execute()
first, last = (np.array(image.TransformIndexToPhysicalPoint((0, 0, k))) for k in (0, 20))
off = np.linalg.norm(last - (0, 0, 40))
print("spacing", image.GetSpacing(), "direction", np.round(image.GetDirection(), 3).tolist())
print(f"first slice {first}, last slice {np.round(last, 1)}, stated (0, 0, 40): {off:.1f} mm off")
raise SystemExit(0 if np.allclose(first, 0) and 13.8 < off < 14 else "changed: the slices are placed otherwise")
END
