#!/usr/bin/env bash
# SimpleITK reads a NRRD file's voxel size from its axis mins and maxs for the origin, and forgets it for the spacing.
#
# Versions: SimpleITK 2.5.7 (numpy 2.4.6), Python 3.11.
# Input: 10 x 10 x 10 voxels from 0 to 25 mm on each axis (axis mins, axis maxs, centers: cell), which makes 2.5 mm a
#   voxel; and the same with "spacings: 2.5 2.5 2.5" in place of the maxs.
# Behavior: the origin, half a voxel from the min, is right for both; the spacing of the first is 1. No warning.
# Output: origin 1.25 for both; spacing 1 for the first and 2.5 for the second: 10 mm of 25.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check SimpleITK==2.5.7 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
from importlib.metadata import version
from pathlib import Path

import SimpleITK as sitk

print({name: version(name) for name in ("SimpleITK", "numpy")})
HEADER = """NRRD0004
type: uint8
dimension: 3
sizes: 10 10 10
encoding: raw
centers: cell cell cell
axis mins: 0 0 0
{}

"""
found = {}
for line in ("axis maxs: 25 25 25", "spacings: 2.5 2.5 2.5"):
    Path("volume.nrrd").write_bytes(HEADER.format(line).encode() + bytes(1000))
    image = sitk.ReadImage("volume.nrrd")
    found[line[0]] = image.GetOrigin(), image.GetSpacing()
    print(f"{line}: origin {image.GetOrigin()}, spacing {image.GetSpacing()}")
known = {"a": ((1.25,) * 3, (1,) * 3), "s": ((1.25,) * 3, (2.5,) * 3)}
raise SystemExit(0 if found == known else "changed: other numbers than recorded")
END
