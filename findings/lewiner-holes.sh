#!/usr/bin/env bash
# scikit-image's default marching cubes leaves holes where voxels equal the level, and edges of four faces on masks.
#
# Versions: scikit-image 0.26.0 (numpy 2.4.6), Python 3.11.
# Input: (1) 2 x 2 x 2 whole numbers from 0 to 2 in a border of zeros, at level 1; (2) a noisy ball of whole numbers,
#   as CT has them, at the level of one of them; (3) a mask of 3 x 3 x 2 voxels in a border of zeros, at level .5.
#   Everything lies inside of the border, so that every edge should have two faces.
# Behavior: the method "lewiner", documented as one whose results are topologically correct, gives edges of one face
#   for (1) and (2), and of four faces for (3). The method "lorensen", the older one, gives two faces an edge in all
#   three, and so does "lewiner" for (2) half a number higher. Welding equal positions does not close the holes: 3 and 9
#   edges of one face remain.
# Output: edges of one face: 4 for (1) and 12 for (2); edges of four faces: 3 for (3).
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check scikit-image==0.26.0 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
from skimage.measure import marching_cubes

print({name: version(name) for name in ("scikit-image", "numpy")})


def faces_an_edge(volume, level, method):
    """Return how many edges of the surface have how many faces, before and after equal positions are welded."""
    vertices, faces = marching_cubes(volume, level, method=method)[:2]
    welded = np.unique(vertices.round(5), axis=0, return_inverse=True)[1].ravel()[faces]
    degenerate = (welded == np.roll(welded, 1, axis=1)).any(axis=1)
    return counted(faces), counted(welded[~degenerate])


def counted(faces):
    """Return how many edges have how many faces."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2))
    counts, many = np.unique(np.unique(edges, axis=0, return_counts=True)[1], return_counts=True)
    return dict(zip(counts.tolist(), many.tolist(), strict=True))


small = np.pad([[[2, 2], [1, 2]], [[0, 2], [2, 0]]], 1).astype(float)
radius = np.sqrt(((np.indices((32, 32, 32)) - 15.3) ** 2).sum(axis=0))
noise = np.random.default_rng(1).normal(0, 4, radius.shape)
ball = np.round(20 * (10 - radius) + noise).clip(-60)
mask = np.pad([[[1, 1], [0, 0], [1, 0]], [[1, 1], [1, 0], [0, 1]], [[0, 0], [0, 1], [0, 0]]], 1).astype(float)

found = {}
cases = (("whole numbers", small, 1), ("ball", ball, 0), ("ball, half higher", ball, 0.5), ("mask", mask, 0.5))
for name, volume, level in cases:
    found[name] = {method: faces_an_edge(volume, level, method) for method in ("lewiner", "lorensen")}
    print(f"{name} at {level}: edges by faces, as found and welded {found[name]}")

clean = all(set(each["lorensen"][0]) == {2} for each in found.values())
clean = clean and set(found["ball, half higher"]["lewiner"][0]) == {2}
holes = all(1 in edges for name in ("whole numbers", "ball") for edges in found[name]["lewiner"])
raise SystemExit(0 if clean and holes and 4 in found["mask"]["lewiner"][0] else "changed: other edges than recorded")
END
