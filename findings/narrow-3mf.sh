#!/usr/bin/env bash
# lib3mf keeps 32 bits of the coordinates of a 3MF file, whose text has more: a solid of 20 mm that lies some hundred
# kilometers from 0, as what was surveyed does, comes back as a line, without a warning.
#
# Versions: lib3mf 2.5.0, trimesh 5.2.0 (lxml 6.1.3, networkx 3.6.1, numpy 2.4.6), Python 3.11.
# Input: a 3MF file with a tetrahedron of 4 vertices, 20 mm along each axis, at 691,000,000, 533,499,900 and 520,000 mm.
# Behavior: lib3mf returns coordinates in steps of 64 and 32 mm, trimesh those of the file. Strict mode is silent.
# Output: the sides of its box: lib3mf 0, 0 and 20 mm, trimesh 20 mm each; no warning.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check \
    lib3mf==2.5.0 trimesh==5.2.0 lxml==6.1.3 networkx==3.6.1 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
import zipfile
from importlib.metadata import version

import lib3mf
import numpy as np
import trimesh

print({name: version(name) for name in ("lib3mf", "trimesh")})
places = np.array([691_000_000.0, 533_499_900.0, 520_000.0]) + 20 * np.eye(4, 3, -1)
core, package = "http://schemas.microsoft.com/3dmanufacturing", "http://schemas.openxmlformats.org/package/2006"
vertices = "".join(f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>' for x, y, z in places.tolist())
faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)))
parts = {
    "[Content_Types].xml": f'<Types xmlns="{package}/content-types"><Default Extension="rels" ContentType='
    '"application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model" ContentType='
    '"application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>',
    "_rels/.rels": f'<Relationships xmlns="{package}/relationships"><Relationship Target="/3D/3dmodel.model" Id="rel0" '
    f'Type="{core}/2013/01/3dmodel"/></Relationships>',
    "3D/3dmodel.model": f'<model unit="millimeter" xml:lang="en-US" xmlns="{core}/core/2015/02"><resources>'
    f'<object id="1" type="model"><mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh></object>'
    '</resources><build><item objectid="1"/></build></model>',
}
with zipfile.ZipFile("far.3mf", "w") as archive:
    for name, text in parts.items():
        archive.writestr(name, f'<?xml version="1.0" encoding="UTF-8"?>{text}')

model = lib3mf.Wrapper().CreateModel()
reader = model.QueryReader("3mf")
reader.SetStrictModeActive(True)
reader.ReadFromFile("far.3mf")
objects = model.GetMeshObjects()
objects.MoveNext()
read = np.array([list(one.Coordinates) for one in objects.GetCurrentMeshObject().GetVertices()], np.float64)
other = np.array(trimesh.load("far.3mf", process=False).to_geometry().vertices)
sides = {name: np.ptp(found, axis=0).round(3).tolist() for name, found in (("lib3mf", read), ("trimesh", other))}
print("the sides of the box, mm:", sides, "warnings:", reader.GetWarningCount())
changed = sides != {"lib3mf": [0.0, 0.0, 20.0], "trimesh": [20.0, 20.0, 20.0]} or reader.GetWarningCount()
raise SystemExit("changed" if changed else 0)
END
