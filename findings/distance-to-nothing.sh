#!/usr/bin/env bash
# SciPy's Euclidean distance transform of an image without background measures to a pixel that is not there.
#
# Versions: scipy 1.17.1, SimpleITK 2.5.7 (numpy 2.4.6), Python 3.11.
# Input: an image of 4 x 6 pixels that all are foreground, as an empty slice is for distances from outside, when the
#   shape between slices is interpolated.
# Behavior: distance_transform_edt gives the distances to a pixel beside the first one, outside of the image; no
#   warning. distance_transform_bf, described as the same by brute force, gives 1e154, distance_transform_cdt -1;
#   SimpleITK's signed distances have one huge number everywhere.
# Output: 1, 1.41, 2.24 ... in the first row, 4 to 6.4 in the last.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check scipy==1.17.1 SimpleITK==2.5.7 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
import SimpleITK as sitk
from scipy import ndimage

print({name: version(name) for name in ("scipy", "SimpleITK", "numpy")})
full = np.ones((4, 6), np.uint8)
found = ndimage.distance_transform_edt(full)
print("distance_transform_edt:", found.round(2), sep="\n")
brute, blocks = ndimage.distance_transform_bf(full), ndimage.distance_transform_cdt(full)
other = sitk.GetArrayFromImage(sitk.SignedMaurerDistanceMap(sitk.GetImageFromArray(full), squaredDistance=False))
print(f"distance_transform_bf: {np.unique(brute)}, cdt: {np.unique(blocks)}, SimpleITK: {np.unique(other)}")
rows, columns = np.indices(full.shape)
phantom = np.hypot(rows + 1, columns)
as_found = np.allclose(found, phantom) and brute.min() > 1e100 and (blocks == -1).all() and np.ptp(other) == 0
raise SystemExit(0 if as_found else "changed: it measures to something else, or says so")
END
