#!/usr/bin/env bash
# trimesh reads that a 3MF file is in inches, and writes the same numbers back as millimeters: 25.4 times too small.
#
# Versions: trimesh 5.2.0, lxml 6.1.3, networkx 3.6.1 (numpy 2.4.6), Python 3.11.
# Input: a 3MF file of one tetrahedron, 1 inch long, with unit="inch" as the core specification has it.
# Behavior: the mesh's units are inches after reading; export writes unit="millimeter" whatever the units are, and
#   leaves the numbers as they are. No warning. A slicer prints the part in 1/25 of its size.
# Output: units "inch", extents 1, 1, 1 read; unit="millimeter", extents 1, 1, 1 written.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check \
    trimesh==5.2.0 lxml==6.1.3 networkx==3.6.1 numpy==2.4.6 || exit 3

venv/bin/python - <<'END'
import re
import zipfile
from importlib.metadata import version

import trimesh

print({name: version(name) for name in ("trimesh", "lxml", "networkx", "numpy")})
OPEN = "http://schemas.openxmlformats.org/package/2006"
CORE = "http://schemas.microsoft.com/3dmanufacturing"
parts = {
    "[Content_Types].xml": f'<Types xmlns="{OPEN}/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>',
    "_rels/.rels": f'<Relationships xmlns="{OPEN}/relationships">'
    f'<Relationship Id="r" Type="{CORE}/2013/01/3dmodel" Target="/3D/3dmodel.model"/></Relationships>',
    "3D/3dmodel.model": f'<model unit="inch" xml:lang="en-US" xmlns="{CORE}/core/2015/02"><resources>'
    '<object id="1" type="model"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>'
    '<vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles>'
    '<triangle v1="0" v2="2" v3="1"/><triangle v1="0" v2="1" v3="3"/><triangle v1="1" v2="2" v3="3"/>'
    '<triangle v1="0" v2="3" v3="2"/></triangles></mesh></object></resources>'
    '<build><item objectid="1"/></build></model>',
}
with zipfile.ZipFile("inch.3mf", "w") as archive:
    for name, text in parts.items():
        archive.writestr(name, text)

mesh = trimesh.load_mesh("inch.3mf")
print("read:", mesh.units, mesh.extents)
mesh.export("again.3mf")
unit = re.findall(r'<model[^>]* unit="(\w+)"', zipfile.ZipFile("again.3mf").read("3D/3dmodel.model").decode())
again = trimesh.load_mesh("again.3mf")
print("written:", unit, again.extents)
same = (mesh.extents == again.extents).all() and (mesh.extents == 1).all()
known = mesh.units.startswith("inch") and unit == ["millimeter"] and same
raise SystemExit(0 if known else "changed: the unit is kept")
END
