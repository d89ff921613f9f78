#!/usr/bin/env bash
# VTK cuts off the colors of an OBJ file: of 256 levels, written with six digits as is usual, 125 come back darker.
#
# Versions: vtk 9.7.2 (numpy 2.4.6), Python 3.11.
# Input: an OBJ file with a vertex for each level n of 0 to 255, its color n / 255 with six digits behind the position.
# Behavior: the level is the fraction times 255 without what is behind the point, so 2 / 255 = 0.007843 is 1. No warning.
# Output: one darker: 125 of 256; the first: 2 as 1.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check vtk==9.7.2 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOGeometry import vtkOBJReader

print({name: version(name) for name in ("vtk", "numpy")})
levels = np.arange(256)
with open("levels.obj", "w") as file:
    file.writelines(f"v {n} {n % 2} 0 {n / 255:.6f} {n / 255:.6f} {n / 255:.6f}\n" for n in levels)
    file.writelines(f"f {n} {n + 1} {n + 2}\n" for n in range(1, 255))
reader = vtkOBJReader()
reader.SetFileName("levels.obj")
reader.Update()
data = reader.GetOutput().GetPointData()
read = vtk_to_numpy(data.GetScalars())[:, 0].astype(int)
darker = np.flatnonzero(read == levels - 1)
print("one darker:", len(darker), "of 256; the first:", darker[0], "as", read[darker[0]])
known = len(darker) > 64 and ((read == levels) | (read == levels - 1)).all()
raise SystemExit(0 if known else "changed: the colors are rounded")
END
