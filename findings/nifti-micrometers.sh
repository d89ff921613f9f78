#!/usr/bin/env bash
# A NIfTI file in micrometers is 1000 times as large by nibabel as by SimpleITK.
#
# Versions: nibabel 5.4.2, SimpleITK 2.5.7 (numpy 2.4.6), Python 3.11.
# Input: 2 x 3 x 4 voxels of 50 x 50 x 80 micrometers, as of a micro-CT, with the unit in the header (xyzt_units 3)
#   and the sform in the same unit.
# Behavior: nibabel gives the affine in the file's unit, 50; the unit is in the header for who asks. SimpleITK brings
#   spacing and origin to millimeters, .05. A mesh made by the one and laid over an image read by the other is off by
#   1000, in silence.
# Output: spacing 50, 50, 80 by nibabel and .05, .05, .08 by SimpleITK.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check \
    nibabel==5.4.2 SimpleITK==2.5.7 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
from importlib.metadata import version

import nibabel
import numpy as np
import SimpleITK as sitk

print({name: version(name) for name in ("nibabel", "SimpleITK", "numpy")})
image = nibabel.Nifti1Image(np.zeros((2, 3, 4), np.int16), np.diag([50, 50, 80, 1.0]))
image.header.set_xyzt_units("micron")
nibabel.save(image, "micro.nii")

read = nibabel.load("micro.nii")
first = np.linalg.norm(read.affine[:3, :3], axis=0)
second = np.array(sitk.ReadImage("micro.nii").GetSpacing())
print("unit in the header:", read.header.get_xyzt_units()[0])
print("nibabel:", first, "SimpleITK:", second, "ratio:", first / second)
raise SystemExit(0 if np.allclose(first, 1000 * second, rtol=1e-5) else "changed: the two no longer differ by 1000")
END
