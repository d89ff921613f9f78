#!/usr/bin/env bash
# A NIfTI file without a frame is read by nibabel as the mirror image of what SimpleITK reads.
#
# Versions: nibabel 5.4.2, SimpleITK 2.5.7 (numpy 2.4.6), Python 3.11.
# Input: 2 x 3 x 4 voxels of 1 x 1 x 2 mm, qform and sform code both 0. The standard's method 1 then scales the
#   indices by the pixel sizes, in axes that run to the right, to the front and up.
# Behavior: nibabel lets the columns run to the left, with 0 in the middle of the volume. SimpleITK lets columns run to
#   the left and rows to the back, from 0. The first is a mirror image of the standard's reading, the second the same
#   shape turned half around. Neither warns.
# Output: determinants of the affines in RAS: -2 by nibabel, +2 by SimpleITK.
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
image = nibabel.Nifti1Image(np.zeros((2, 3, 4), np.int16), None)
image.header.set_zooms((1, 1, 2))
image.header.set_qform(None, 0)
image.header.set_sform(None, 0)
nibabel.save(image, "bare.nii")

first = nibabel.load("bare.nii").affine
read = sitk.ReadImage("bare.nii")
lps = np.eye(4)
lps[:3, :3] = np.reshape(read.GetDirection(), (3, 3)) * read.GetSpacing()
lps[:3, 3] = read.GetOrigin()
second = np.diag([-1, -1, 1, 1]) @ lps  # to RAS
for name, affine in (("nibabel", first), ("SimpleITK", second)):
    print(f"{name}: determinant {np.linalg.det(affine):+.0f}\n{affine}")

mirrored = np.allclose(np.diag(first), [-1, 1, 2, 1]) and np.allclose(np.diag(second), [-1, -1, 2, 1])
raise SystemExit(0 if mirrored else "changed: other axes than those recorded")
END
