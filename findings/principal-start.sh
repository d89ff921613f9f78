#!/usr/bin/env bash
# MiniSom's start along the principal components is two units long, whatever the size of the data.
#
# Versions: MiniSom 2.3.6 (numpy 2.4.6), Python 3.11.
# Input: 5000 points in millimeters, standard deviations 60, 40 and 20: about a head. Then the same points in meters.
# Behavior: the linear start of the literature (Kohonen) spreads the map by the square roots of the eigenvalues;
#   pca_weights_init goes one unit vector to each side of the mean. No warning. Its documentation advises to normalize
#   first, which takes positions in space their shape where each axis is scaled by itself.
# Output: the map is 2 mm long and 2 mm wide, then 2 m long and 2 m wide.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check MiniSom==2.3.6 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
from minisom import MiniSom

print({name: version(name) for name in ("MiniSom", "numpy")})
points = np.random.default_rng(0).normal(0, (60, 40, 20), (5000, 3))
sides = []
for unit, data in (("mm", points), ("m", points / 1000)):
    som = MiniSom(10, 10, 3, random_seed=0)
    som.pca_weights_init(data)
    weights = som.get_weights()
    sides += [np.linalg.norm(weights[-1, 0] - weights[0, 0]), np.linalg.norm(weights[0, -1] - weights[0, 0])]
    print(f"standard deviations {data.std(axis=0).round(3)} {unit}; sides of the map {np.round(sides[-2:], 3)} {unit}")
raise SystemExit(0 if np.allclose(sides, 2) else "changed: the map has the size of the data")
END
