#!/usr/bin/env bash
# MiniSom's U-matrix of a hexagonal map takes wrong neighbors whenever the map has an even number of columns.
#
# Versions: MiniSom 2.3.6 (numpy 2.4.6), Python 3.11.
# Input: hexagonal maps of 5 x 4 and 5 x 5 neurons whose weights are the neurons' own places on the hexagonal grid, so
#   that all neighbors are at distance 1 and a U-matrix of mean distances is 1 everywhere.
# Behavior: distance_map shifts every other column counted from the first, the neurons' places every other one counted
#   from the last. The two agree on an odd number of columns alone; else a third of the neighbors are other neurons.
#   No warning.
# Output: 5 x 5: 1 everywhere; 5 x 4: .77 to 1.
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
found = {}
for rows, columns in ((5, 5), (5, 4)):
    som = MiniSom(rows, columns, 2, topology="hexagonal", random_seed=0)
    places = np.array([[som.convert_map_to_euclidean((i, j)) for j in range(columns)] for i in range(rows)])
    som._weights = places.astype(float)  # there is no public way to set them
    distances = np.linalg.norm(places[:, :, None, None] - places, axis=-1).reshape(rows * columns, -1)
    nearest = np.where(distances > 0, distances, np.inf).min(axis=1)
    found[columns] = som.distance_map(scaling="mean")
    print(f"{rows} x {columns}: nearest neuron at {nearest.min():.3f} to {nearest.max():.3f}; U-matrix")
    print(found[columns].round(2))
even, odd = found[4], found[5]
raise SystemExit(0 if np.allclose(odd, 1) and even.min() < 0.8 else "changed: the neighbors are the same ones")
END
