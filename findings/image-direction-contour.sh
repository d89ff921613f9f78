#!/usr/bin/env bash
# Two of VTK's contour filters forget an image's direction: the surface is turned half around, 22 mm from its place.
#
# Versions: vtk 9.7.2 (numpy 2.4.6), Python 3.11.
# Input: a ball in a volume of 20 x 20 x 20 voxels whose direction matrix is diag(-1, -1, 1): a NIfTI or DICOM image
#   as most readers deliver it.
# Behavior: vtkFlyingEdges3D and vtkMarchingCubes put the surface where the image says. vtkSynchronizedTemplates3D and
#   vtkContourFilter, the general filter that chooses one of them by itself, ignore the direction. No warning.
# Output: center of the ball (94, -9, 12) by the first two and (106, 9, 12) by the others.
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
import vtk
from vtk.util.numpy_support import numpy_to_vtk

print({name: version(name) for name in ("vtk", "numpy")})
x, y, z = np.indices((20, 20, 20))
ball = 4 - np.sqrt((x - 6) ** 2 + (y - 9) ** 2 + (z - 12) ** 2)
image = vtk.vtkImageData()
image.SetDimensions(20, 20, 20)
image.SetOrigin(100, 0, 0)
image.SetDirectionMatrix(-1, 0, 0, 0, -1, 0, 0, 0, 1)
image.GetPointData().SetScalars(numpy_to_vtk(ball.ravel(order="F"), deep=True))
place = [0.0, 0.0, 0.0]
image.TransformContinuousIndexToPhysicalPoint(6, 9, 12, place)
print("center by the image:", place)

centers = {}
for name in ("vtkFlyingEdges3D", "vtkMarchingCubes", "vtkSynchronizedTemplates3D", "vtkContourFilter"):
    contour = getattr(vtk, name)()
    contour.SetInputData(image)
    contour.SetValue(0, 0)
    contour.Update()
    centers[name] = np.reshape(contour.GetOutput().GetBounds(), (3, 2)).mean(axis=1)
    print(f"{name}: {centers[name].round(2)}")
right = [np.allclose(center, place, atol=0.1) for center in centers.values()]
turned = [np.allclose(center, (106, 9, 12), atol=0.1) for center in centers.values()]
known = right == [True, True, False, False] and turned == [False, False, True, True]
raise SystemExit(0 if known else "changed: other filters follow the direction")
END
