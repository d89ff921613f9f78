#!/usr/bin/env bash
# A mesh that manifold3d calls manifold is none any more once it has been a file: STL has no vertices to keep apart.
#
# Versions: manifold3d 3.5.4, trimesh 5.2.0 (numpy 2.4.6), Python 3.11.
# Input: the union of two cubes that touch along one edge.
# Behavior: manifold3d keeps the edge twice, at the same place, and every edge has two faces. STL stores corners alone,
#   so that a reader has to weld equal ones: the edge then has four faces, and trimesh calls the mesh not closed. PLY
#   keeps the vertices apart, but trimesh's reader welds them all the same. No warning anywhere.
# Output: 16 vertices and closed in memory; 14 vertices and not closed after STL, and after PLY.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check \
    manifold3d==3.5.4 trimesh==5.2.0 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
from importlib.metadata import version

import trimesh
from manifold3d import Manifold

print({name: version(name) for name in ("manifold3d", "trimesh", "numpy")})
union = Manifold.cube((1, 1, 1)) + Manifold.cube((1, 1, 1)).translate((1, 1, 0))
arrays = union.to_mesh()
mesh = trimesh.Trimesh(arrays.vert_properties[:, :3], arrays.tri_verts, process=False)
print(f"in memory: {union.status()}, {len(mesh.vertices)} vertices, closed: {mesh.is_watertight}")

found = [(len(mesh.vertices), mesh.is_watertight)]
for suffix in ("stl", "ply"):
    mesh.export(f"union.{suffix}")
    read = trimesh.load_mesh(f"union.{suffix}")
    found.append((len(read.vertices), read.is_watertight))
    print(f"after {suffix}: {len(read.vertices)} vertices, closed: {read.is_watertight}")
raise SystemExit(0 if found == [(16, True), (14, False), (14, False)] else "changed: the edge is kept otherwise")
END
