#!/usr/bin/env bash
# pypcd4 names the padding of a PCD file at random, so a cloud cannot be joined with itself read again.
#
# Versions: pypcd4 1.5.1, Python 3.11.
# Input: a binary PCD file of two points, x y z and four bytes of padding, which the format names "_".
# Behavior: each byte of padding becomes a field, whose name is drawn anew each time the file is read. Two clouds read
#   from the same file have unequal fields, and adding them is refused. Written again, the padding is "_" as before.
# Output: two lists of fields that differ after z, equal coordinates, a ValueError, and 4 points once x, y and z alone
#   are added.
# Seen: 2026-11-30.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv || exit 3
venv/bin/python -m pip install --quiet --disable-pip-version-check pypcd4==1.5.1 || exit 3

venv/bin/python - <<'END'
import struct
from importlib.metadata import version
from pathlib import Path

from pypcd4 import PointCloud

print({"pypcd4": version("pypcd4")})
HEADER = """VERSION 0.7
FIELDS x y z _
SIZE 4 4 4 1
TYPE F F F U
COUNT 1 1 1 4
WIDTH 2
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS 2
DATA binary
"""
POINTS = [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]
PLACES = ("x", "y", "z")
Path("padded.pcd").write_bytes(HEADER.encode() + b"".join(struct.pack("<3f4x", *point) for point in POINTS))

one, two = (PointCloud.from_path("padded.pcd") for _ in range(2))
print(one.fields, two.fields, sep="\n")
same = one.numpy(PLACES).tolist() == two.numpy(PLACES).tolist() == [list(point) for point in POINTS]
try:
    joined = (one + two).points
except ValueError as fault:
    joined = f"ValueError: {fault}"
print(joined)
places = (one[PLACES] + two[PLACES]).points
print(places)
named = one.fields[:3] == two.fields[:3] == PLACES and len(one.fields) == 7 and one.fields[3:] != two.fields[3:]
raise SystemExit(not (same and named and isinstance(joined, str) and places == 4))
END
