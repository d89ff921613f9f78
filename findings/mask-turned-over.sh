#!/usr/bin/env bash
# A boolean mask that tifffile writes comes back turned over in Pillow and SimpleITK, and in SimpleITK with four channels.
#
# Versions: tifffile 2026.3.3, Pillow 13.0.0, SimpleITK 2.5.7 (numpy 2.4.6), Python 3.11.
# Input: a mask of 3 slices of 8 x 8 pixels, 12 of each set, as tifffile writes it without further options.
# Behavior: tifffile names bits WhiteIsZero, and hands them back as they stand, so that its own mask is the one that went
#   in. Pillow and SimpleITK follow the name: what was set is unset. SimpleITK makes red, green, blue and alpha of a bit.
# Output: photometric MINISWHITE; pixels set in a slice: tifffile 12, Pillow 52, SimpleITK 52; SimpleITK's shape (3, 8, 8, 4).
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check \
    tifffile==2026.3.3 Pillow==13.0.0 SimpleITK==2.5.7 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
import SimpleITK
import tifffile
from PIL import Image

print({name: version(name) for name in ("tifffile", "Pillow", "SimpleITK", "numpy")})
mask = np.zeros((3, 8, 8), bool)
mask[:, 2:6, 2:5] = True
tifffile.imwrite("mask.tif", mask)

with tifffile.TiffFile("mask.tif") as file:
    named = file.pages[0].photometric.name
own = int(tifffile.imread("mask.tif")[0].sum())
pillow = int(np.asarray(Image.open("mask.tif")).sum())
colors = SimpleITK.GetArrayFromImage(SimpleITK.ReadImage("mask.tif"))
itk = int((colors[0, ..., 0] > 0).sum())
print("photometric:", named)
print("pixels set in a slice: written", int(mask[0].sum()), "tifffile", own, "Pillow", pillow, "SimpleITK", itk)
print("SimpleITK's shape:", colors.shape)
known = (named, own, pillow, itk, colors.shape) == ("MINISWHITE", 12, 52, 52, (3, 8, 8, 4))
raise SystemExit(0 if known else "changed: the mask comes back otherwise")
END
