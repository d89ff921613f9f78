#!/usr/bin/env bash
# rt-utils draws a structure's contours through the centers of its outer pixels: a square of 25 pixels encloses 16.
#
# Versions: rt-utils 1.2.7, pydicom 3.0.2, opencv-python 5.0.0.93 (numpy 2.4.6), Python 3.11.
# Input: three CT slices with pixels of 1 mm, and three masks: a square of 5 x 5 pixels, a line of 8 pixels, one pixel.
# Behavior: every contour of the RT Structure Set lies half a pixel within the mask on all sides. rt-utils itself reads
#   the mask back whole, for it counts the pixels under the contour too; what takes the contours for polygons gets less
#   volume, and nothing at all for the line and the pixel. No warning.
# Output: pixels read back 25, 8, 1; area of the contours 16, 0, 0 mm2, of 4, 2 and 1 corners (CLOSED_PLANAR).
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check \
    rt-utils==1.2.7 pydicom==3.0.2 opencv-python==5.0.0.93 numpy==2.4.6 || exit 3

mkdir series
venv/bin/python -W ignore - <<'END'
from importlib.metadata import version

import numpy as np
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, generate_uid
from rt_utils import RTStructBuilder

print({name: version(name) for name in ("rt-utils", "pydicom", "opencv-python", "numpy")})
study, series, frame = generate_uid(), generate_uid(), generate_uid()
EMPTY = ("PatientName", "PatientID", "PatientBirthDate", "PatientSex", "StudyDate", "StudyTime", "AccessionNumber",
         "StudyID", "ReferringPhysicianName")
for number in range(3):
    data = Dataset()
    data.file_meta = FileMetaDataset()
    data.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    data.SOPClassUID = data.file_meta.MediaStorageSOPClassUID = CTImageStorage
    data.SOPInstanceUID = data.file_meta.MediaStorageSOPInstanceUID = generate_uid()
    data.StudyInstanceUID, data.SeriesInstanceUID, data.FrameOfReferenceUID = study, series, frame
    for name in EMPTY:
        setattr(data, name, "")
    data.Modality, data.SeriesNumber, data.InstanceNumber = "CT", 1, number + 1
    data.PixelSpacing, data.SliceThickness = [1, 1], 2
    data.ImageOrientationPatient, data.ImagePositionPatient = [1, 0, 0, 0, 1, 0], [0, 0, 2 * number]
    data.Rows = data.Columns = 16
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.BitsAllocated, data.BitsStored, data.HighBit, data.PixelRepresentation = 16, 16, 15, 1
    data.RescaleSlope, data.RescaleIntercept = 1, 0
    data.PixelData = np.zeros((16, 16), np.int16).tobytes()
    data.save_as(f"series/{number}.dcm", enforce_file_format=True)


def area(contour):
    """Return a contour's corners and the area that it encloses."""
    x, y = np.reshape(contour.ContourData, (-1, 3))[:, :2].T.astype(float)
    return len(x), float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)


builder = RTStructBuilder.create_new(dicom_series_path="series")
boxes = {"square": np.s_[6:11, 6:11, 1], "line": np.s_[8, 4:12, 1], "pixel": np.s_[8, 8, 1]}
found = {}
for name, box in boxes.items():
    mask = np.zeros((16, 16, 3), bool)
    mask[box] = True
    builder.add_roi(mask=mask, name=name)
    again = int(builder.get_roi_mask_by_name(name).sum())
    contours = builder.ds.ROIContourSequence[-1].ContourSequence
    found[name] = int(mask.sum()), again, [area(contour) for contour in contours]
    print(f"{name}: {mask.sum()} pixels, {again} read back; contours (corners, mm2) {found[name][2]}")
known = {"square": (25, 25, [(4, 16)]), "line": (8, 8, [(2, 0)]), "pixel": (1, 1, [(1, 0)])}
raise SystemExit(0 if found == known else "changed: the contours enclose other areas")
END
