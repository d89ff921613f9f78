#!/usr/bin/env bash
# One NIfTI file, two places in the patient: nibabel goes by the sform, SimpleITK by the qform, or by the sform, as
# the codes say.
#
# Versions: nibabel 5.4.2, SimpleITK 2.5.7 (numpy 2.4.6), Python 3.11.
# Input: 2 x 3 x 4 voxels whose qform and sform are both set and differ, as after a registration: the qform is that
#   of the scanner (turned by 30 degrees), the sform that of a template (not turned).
# Behavior: nibabel takes the sform wherever its code is above 0. SimpleITK takes the sform where its code is 1, and
#   the qform where the sform's code is 2: the code of one form decides which of the two is read. Neither warns.
# Output: voxel (0, 0, 0) lies at RAS (-10, -20, -30) by both with codes 1 and 1; with codes 1 and 2 it lies at
#   (5, 6, 7) by SimpleITK, 48 mm from nibabel's place.
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
cos, sin = np.cos(np.pi / 6), np.sin(np.pi / 6)
scanner = np.array([[cos, -sin, 0, 5], [sin, cos, 0, 6], [0, 0, 2, 7], [0, 0, 0, 1]])
template = np.array([[1, 0, 0, -10], [0, 1, 0, -20], [0, 0, 2, -30], [0, 0, 0, 1.0]])

places = {}
for qform, sform in ((1, 1), (1, 2)):
    image = nibabel.Nifti1Image(np.zeros((2, 3, 4), np.int16), None)
    image.header.set_zooms((1, 1, 2))
    image.header.set_qform(scanner, qform)
    image.header.set_sform(template, sform)
    nibabel.save(image, "both.nii")
    first = nibabel.load("both.nii").affine[:3, 3]
    second = np.array(sitk.ReadImage("both.nii").GetOrigin()) * (-1, -1, 1)  # LPS to RAS
    places[sform] = first, second
    print(f"qform code {qform}, sform code {sform}: nibabel {first}, SimpleITK {second}, "
          f"{np.linalg.norm(first - second):.1f} mm apart")

same = np.allclose(*places[1], atol=1e-4) and np.allclose(places[1][0], template[:3, 3], atol=1e-4)
apart = np.allclose(places[2][0], template[:3, 3], atol=1e-4) and np.allclose(places[2][1], scanner[:3, 3], atol=1e-4)
raise SystemExit(0 if same and apart else "changed: the two agree, or another form is taken")
END
