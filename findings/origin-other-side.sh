#!/usr/bin/env bash
# ngff-zarr gives the axis of an OME-Zarr image its direction, and the origin of ITK's axis, which runs the other way.
#
# Versions: ngff-zarr 0.50.0, itk 5.4.7, zarr 3.1.6 (numpy 2.4.6), Python 3.11.
# Input: an ITK image (LPS: x is millimeters to the left) whose rows run from left to right, its first voxel at x = 20.
# Behavior: the store says that x runs left-to-right (RFC 4), so that x is millimeters to the right, with a translation of
#   20: the first voxel lies 20 mm to the right of the origin, 40 mm from where ITK has it. ngff-zarr's own way back
#   takes the number for LPS again, so that a round trip shows nothing.
# Output: ITK 20.0 mm to the left; store orientation left-to-right, translation 20.0, which is -20.0 mm to the left.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check \
    ngff-zarr==0.50.0 itk==5.4.7 zarr==3.1.6 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
import json
from importlib.metadata import version
from pathlib import Path

import itk
import ngff_zarr
import numpy as np

print({name: version(name) for name in ("ngff-zarr", "itk", "zarr", "numpy")})
image = itk.image_from_array(np.zeros((4, 5, 6), np.uint8))
image.SetOrigin([20.0, 0.0, 0.0])
image.SetDirection(itk.matrix_from_array(np.diag([-1.0, 1.0, 1.0])))
left = image.TransformIndexToPhysicalPoint([0, 0, 0])[0]

made = ngff_zarr.to_multiscales(ngff_zarr.itk_image_to_ngff_image(image), scale_factors=[], chunks=4)
ngff_zarr.to_ngff_zarr("image.ome.zarr", made, version="0.4")
store = json.loads(Path("image.ome.zarr", ".zattrs").read_text())["multiscales"][0]
axis = next(n for n, one in enumerate(store["axes"]) if one["name"] == "x")
runs = store["axes"][axis]["orientation"]["value"]
steps = store["datasets"][0]["coordinateTransformations"]
moved = next(step["translation"][axis] for step in steps if step["type"] == "translation")
print("ITK: first voxel", left, "mm to the left")
print("store:", runs, "translation", moved, "which is", -moved, "mm to the left")
known = (left, runs, moved) == (20.0, "left-to-right", 20.0)
raise SystemExit(0 if known else "changed: the translation follows the direction")
END
