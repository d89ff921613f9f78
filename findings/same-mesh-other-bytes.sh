#!/usr/bin/env bash
# lib3mf writes other bytes for the same mesh each time.
#
# Versions: lib3mf 2.5.0, Python 3.11.
# Input: one tetrahedron, written twice in one run.
# Behavior: the writer gives the object, the build and the item a new random identifier (p:UUID, of the production
#   extension) each time, although none was asked for. They are the only difference: dates are constant. Check sums of
#   results, caches and version control see two files. Who sets all three by hand (SetUUID, SetBuildUUID) gets equal
#   ones.
# Output: two files that differ, equal once p:UUID is cut out; two equal files with identifiers set.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check lib3mf==2.5.0 || exit 3

venv/bin/python - <<'END'
import re
import zipfile
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from uuid import UUID

import lib3mf

print({"lib3mf": version("lib3mf")})
CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
FACES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]


def write(name, fixed=False):
    """Write the tetrahedron, with fixed identifiers if asked."""
    positions, triangles = [lib3mf.Position() for _ in CORNERS], [lib3mf.Triangle() for _ in FACES]
    for position, corner in zip(positions, CORNERS, strict=True):
        position.Coordinates[:] = corner
    for triangle, face in zip(triangles, FACES, strict=True):
        triangle.Indices[:] = face
    wrapper = lib3mf.Wrapper()
    model = wrapper.CreateModel()
    mesh = model.AddMeshObject()
    mesh.SetGeometry(positions, triangles)
    item = model.AddBuildItem(mesh, wrapper.GetIdentityTransform())
    if fixed:
        mesh.SetUUID(str(UUID(int=1)))
        item.SetUUID(str(UUID(int=2)))
        model.SetBuildUUID(str(UUID(int=3)))
    model.QueryWriter("3mf").WriteToFile(name)


models = []
for name in ("first.3mf", "second.3mf"):
    write(name)
    text = zipfile.ZipFile(name).read("3D/3dmodel.model").decode()
    models.append(text)
    print(name, sha256(Path(name).read_bytes()).hexdigest()[:16], re.findall('p:UUID="([^"]*)"', text))
without = [re.sub('p:UUID="[^"]*"', "", text) for text in models]
differ = Path("first.3mf").read_bytes() != Path("second.3mf").read_bytes()
for name in ("third.3mf", "fourth.3mf"):
    write(name, fixed=True)
    print(name, sha256(Path(name).read_bytes()).hexdigest()[:16], "with identifiers set")
equal = Path("third.3mf").read_bytes() == Path("fourth.3mf").read_bytes()
raise SystemExit(0 if differ and equal and without[0] == without[1] else "changed: equal bytes, or another difference")
END
