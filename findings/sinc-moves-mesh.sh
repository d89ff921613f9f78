#!/usr/bin/env bash
# VTK's windowed sinc filter carries a mesh away from its place, the farther the farther it lies from the origin.
#
# Versions: vtk 9.7.2 (numpy 2.4.6), Python 3.11.
# Input: a closed ball of 20 mm radius, its center at the origin, and 100, 300 and 1000 mm along each axis from it:
#   places that patient coordinates have.
# Behavior: 20 iterations, which the manual calls all that is usually necessary, with a pass band of 0.001 of 0 to 2.
#   The filter is a polynomial that should leave a place where it is, but its value at frequency 0 is not 1, so that all
#   is scaled about the origin of the coordinates. NormalizeCoordinates, said to minimize this and off for legacy
#   reasons, undoes it: it carries the mesh to the origin first. 3D Slicer sets it. No warning.
# Output: the ball's center moves by 0, .06, .19 and .62 mm along each axis; with NormalizeCoordinates by less than
#   .001 mm.
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
from vtk.util.numpy_support import vtk_to_numpy

print({name: version(name) for name in ("vtk", "numpy")})


def moved(away, normalized):
    """Return how far the middle of a ball's vertices moves along the axis it moves most along."""
    ball = vtk.vtkSphereSource()
    ball.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION)
    ball.SetRadius(20)
    ball.SetCenter(away, away, away)
    ball.SetThetaResolution(60)
    ball.SetPhiResolution(60)
    smooth = vtk.vtkWindowedSincPolyDataFilter()
    smooth.SetInputConnection(ball.GetOutputPort())
    smooth.SetPassBand(0.001)
    smooth.SetNormalizeCoordinates(normalized)
    smooth.Update()
    before, after = (vtk_to_numpy(each.GetOutput().GetPoints().GetData()).mean(axis=0) for each in (ball, smooth))
    return float(np.abs(after - before).max())


print("default of NormalizeCoordinates:", vtk.vtkWindowedSincPolyDataFilter().GetNormalizeCoordinates())
places = (0, 100, 300, 1000)
plain, normalized = ([moved(place, on) for place in places] for on in (False, True))
for place, one, other in zip(places, plain, normalized, strict=True):
    print(f"center {place} mm along each axis: moved by {one:.4f} mm, normalized by {other:.4f} mm")
scaled = np.allclose(np.divide(plain[1:], places[1:]), plain[3] / 1000, rtol=0.05)
as_found = plain[0] < 1e-3 and plain[3] > 0.3 and scaled and max(normalized) < 1e-3
raise SystemExit(0 if as_found else "changed: the filter moves meshes otherwise")
END
