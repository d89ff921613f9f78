#!/usr/bin/env bash
# fast-simplification turns a closed, manifold box into a mesh with an edge of four faces.
#
# Versions: fast-simplification 0.2.0, trimesh 5.2.0 (numpy 2.4.6), Python 3.11.
# Input: a box of 12 triangles, each cut into four twice (192) and three times (768): closed and manifold.
# Behavior: asked for half of the triangles, it collapses edges without looking whether the two ends have more common
#   neighbors than the edge's own triangles (the link condition; Dey et al. 1999). No warning. At other shares of the
#   same box it stays manifold.
# Output: 96 of 192 triangles: not closed as trimesh counts, edges of four faces; the same for 384 of 768.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check \
    fast-simplification==0.2.0 trimesh==5.2.0 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
from importlib.metadata import version

import fast_simplification
import numpy as np
import trimesh

print({name: version(name) for name in ("fast-simplification", "trimesh", "numpy")})


def faces_an_edge(faces):
    """Return how many edges have how many faces."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2))
    counts, many = np.unique(np.unique(edges, axis=0, return_counts=True)[1], return_counts=True)
    return dict(zip(counts.tolist(), many.tolist(), strict=True))


broken = []
box = trimesh.creation.box().subdivide()
for _ in range(2):
    box = box.subdivide()
    vertices, faces = fast_simplification.simplify(box.vertices, box.faces.astype(np.int32), target_reduction=0.5)
    closed = trimesh.Trimesh(vertices, faces, process=False).is_watertight
    before, after = faces_an_edge(box.faces), faces_an_edge(faces)
    print(f"{len(box.faces)} triangles, edges by faces {before} -> {len(faces)} triangles, {after}, closed: {closed}")
    broken.append(set(before) == {2} and 4 in after and not closed)
raise SystemExit(0 if all(broken) else "changed: the box stays manifold")
END
