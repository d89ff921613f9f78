#!/usr/bin/env bash
# laspy comes to other points where it is told to seek in a COPC file.
#
# Versions: laspy 2.7.0, lazrs 0.8.2, copclib 2.6.1 (numpy 2.4.6), Python 3.11.
# Input: a COPC file by copclib of 1,000 points, numbered by their intensity: 100 at the octree's root, 900 in its eight
#   children, so that its chunks differ in length, as those of COPC files do.
# Behavior: read from the start the points are those that were written. After reader.seek(n) the next point is another
#   one than the n-th, for most n over 0; no error and no warning.
# Output: of 19 places 0, 50, 100, ... 900 that are sought, 2 lead to the point that reading from the start finds there,
#   both in the first chunk; place 100 leads to point 859 in place of 103.
# Seen: 2026-12-01.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check laspy==2.7.0 lazrs==0.8.2 copclib==2.6.1 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
from importlib.metadata import version

import copclib
import laspy
import numpy as np

print({name: version(name) for name in ("laspy", "lazrs", "copclib", "numpy")})
rng = np.random.default_rng(0)
cloud = rng.uniform(-0.9, 0.9, (1000, 3))
config = copclib.CopcConfigWriter(7, (1e-4,) * 3, (0, 0, 0))
config.las_header.min, config.las_header.max = (copclib.Vector3(*side) for side in (cloud.min(0), cloud.max(0)))
config.copc_info.halfsize, config.copc_info.spacing = 1.0, 1 / 64
writer = copclib.FileWriter("cloud.copc.laz", config)
octants = (cloud > 0).astype(int)
nodes = [((0, 0, 0, 0), np.arange(100))]
for key in np.unique(octants, axis=0):
    nodes.append(((1, *key), 100 + np.flatnonzero(np.all(octants[100:] == key, axis=1))))
for key, numbers in nodes:
    points = copclib.Points(config.las_header)
    for number in numbers:
        point = points.CreatePoint()
        point.x, point.y, point.z = cloud[number]
        point.intensity = int(number)
        points.AddPoint(point)
    writer.AddNode(copclib.VoxelKey(*map(int, key)), points)
writer.Close()

with laspy.open("cloud.copc.laz") as reader:
    whole = np.array(reader.read().intensity)
print("all points once:", sorted(whole.tolist()) == list(range(1000)), "- in a node:", [len(numbers) for _, numbers in nodes])
places, right = list(range(0, 901, 50)), 0
for place in places:
    with laspy.open("cloud.copc.laz", laz_backend=laspy.LazBackend.Lazrs) as reader:
        reader.seek(place)
        found = int(reader.read_points(1).intensity[0])
    right += found == whole[place]
    print(place, "read from the start:", int(whole[place]), "sought:", found)
print("right after seek:", right, "of", len(places))
raise SystemExit(0 if right == 2 else "changed: other places that are sought are right")
END
