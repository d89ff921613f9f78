"""GLB, binary glTF 2.0, which browsers and 3D viewers show.

Written with the standard library: a file is one JSON text and one block of numbers, and the text must say here what no
general exporter knows, the frame. trimesh judges the files in the tests.

The numbers are those of the mesh; the node's matrix carries them to what glTF demands, meters with y up and z to the
front, and ``extras`` of the mesh name unit and frame.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .atomic import replacing
from .colors import named_colors
from .written import single

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..model.mesh import TriMesh
    from .fields import Fields
    from .written import Written

METERS = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0}
"""Meters in a unit; an unknown one stays as it is."""

TURNS = {"LPS": ((1, 0, 0), (0, 0, 1), (0, -1, 0)), "RAS": ((-1, 0, 0), (0, 0, 1), (0, 1, 0))}
"""Frame to the rows of its rotation to +x left, +y superior, +z anterior; others stay as they are."""

COMPONENTS = {"<f4": 5126, "<u4": 5125, "|u1": 5121}
"""NumPy's types of numbers to glTF's codes."""

SHAPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}

VERTEX_BUFFER, INDEX_BUFFER = 34962, 34963


@dataclass
class Block:
    """The file's block of numbers while it grows, and the JSON that says what is where."""

    data: bytearray = field(default_factory=bytearray)
    views: list[dict[str, Any]] = field(default_factory=list)
    accessors: list[dict[str, Any]] = field(default_factory=list)

    def add(self, values: NDArray[Any], target: int, **more: Any) -> int:
        """Append an array (n,), or (n, 3 or 4), and return the number of its accessor."""
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": values.nbytes, "target": target}
        self.data += np.ascontiguousarray(values).tobytes()
        self.views.append(view)
        width = values.shape[1] if values.ndim == 2 else 1
        kind = {"componentType": COMPONENTS[values.dtype.str], "type": SHAPES[width]}
        self.accessors.append({"bufferView": len(self.views) - 1, "count": len(values), **kind, **more})
        return len(self.accessors) - 1


def write_glb(mesh: TriMesh, path: str | Path, beside: Written) -> None:
    """Write 32-bit coordinates, colors, and other fields at vertices as 32-bit attributes ``_NAME``.

    Raises
    ------
    OutputError
        Where 32 bits cannot keep the vertices apart.
    """
    block = Block()
    places = single(mesh.vertices, path, kind="GLB").astype("<f4")
    box = {"min": places.min(axis=0).tolist(), "max": places.max(axis=0).tolist()}
    corners = block.add(mesh.faces.ravel().astype("<u4"), INDEX_BUFFER)
    attributes = {"POSITION": block.add(places, VERTEX_BUFFER, **box)} | _attributes(block, beside.vertex_fields)
    scene = _scene(beside, {"attributes": attributes, "indices": corners, "mode": 4})
    numbers = {"bufferViews": block.views, "accessors": block.accessors, "buffers": [{"byteLength": len(block.data)}]}
    text = json.dumps({**scene, **numbers}, separators=(",", ":")).encode("ascii")
    chunks = _chunk(b"JSON", text, b" ") + _chunk(b"BIN\0", bytes(block.data), b"\0")
    with replacing(path) as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def _attributes(block: Block, fields: Fields) -> dict[str, int]:
    colors = named_colors(fields)
    found = {}
    if colors:
        opaque = np.concatenate([colors[1], np.full((len(colors[1]), 1), 255, np.uint8)], axis=1)
        found["COLOR_0"] = block.add(opaque, VERTEX_BUFFER, normalized=True)
    for name, values in fields.items():
        if not colors or name not in colors[0]:
            found[f"_{name.upper()}"] = block.add(values.astype("<f4"), VERTEX_BUFFER)
    return found


def _scene(beside: Written, triangles: dict[str, Any]) -> dict[str, Any]:
    matrix = np.eye(4)
    matrix[:3, :3] = METERS.get(beside.unit, 1.0) * np.array(TURNS.get(beside.frame, np.eye(3)))
    return {
        "asset": {"version": "2.0", "generator": beside.head},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "matrix": (matrix.T + 0.0).ravel().tolist()}],
        "meshes": [{"primitives": [triangles], "extras": {"unit": beside.unit, "frame": beside.frame}}],
    }


def _chunk(kind: bytes, data: bytes, filler: bytes) -> bytes:
    data += filler * (-len(data) % 4)
    return struct.pack("<I4s", len(data), kind) + data
