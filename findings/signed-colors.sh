#!/usr/bin/env bash
# meshio reads the colors of a binary PLY file as signed bytes: 200 comes back as -56.
#
# Versions: meshio 5.3.5, trimesh 5.2.0 (numpy 2.4.6), Python 3.11.
# Input: a binary PLY file of one triangle whose vertices have red, green and blue as uchar, as scanners write them.
# Behavior: levels from 128 on are negative, in an array of int8; trimesh reads them as they stand. The same file as text
#   is read right. No warning.
# Output: meshio int8 -56 100 -1, trimesh uint8 200 100 255; as text uint8 200 100 255.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check meshio==5.3.5 trimesh==5.2.0 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
from importlib.metadata import version

import meshio
import numpy as np
import trimesh

print({name: version(name) for name in ("meshio", "trimesh", "numpy")})
HEAD = """ply
format {} 1.0
element vertex 3
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 1
property list uchar int vertex_indices
end_header
"""
rows = np.zeros(3, [("place", "<f4", 3), ("color", "u1", 3)])
rows["place"], rows["color"] = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], (200, 100, 255)
face = b"\3" + np.arange(3, dtype="<i4").tobytes()
with open("binary.ply", "wb") as file:
    file.write(HEAD.format("binary_little_endian").encode() + rows.tobytes() + face)
with open("text.ply", "w") as file:
    file.write(HEAD.format("ascii") + "0 0 0 200 100 255\n1 0 0 200 100 255\n0 1 0 200 100 255\n3 0 1 2\n")


def colors(name):
    data = meshio.read(name).point_data
    return [data[key] for key in ("red", "green", "blue")]


read, text = colors("binary.ply"), colors("text.ply")
right = trimesh.load("binary.ply", process=False).visual.vertex_colors
print("meshio:", read[0].dtype, [int(one[0]) for one in read])
print("meshio, text:", text[0].dtype, [int(one[0]) for one in text])
print("trimesh:", right.dtype, right[0, :3].tolist())
known = [int(one[0]) for one in read] == [-56, 100, -1] and right[0, :3].tolist() == [200, 100, 255]
raise SystemExit(0 if known else "changed: the colors are read as they stand")
END
