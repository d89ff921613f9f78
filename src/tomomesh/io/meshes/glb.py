"""GLB, binary glTF 2.0, which browsers and 3D viewers show, through trimesh.

The numbers are those of the mesh; the node's matrix carries them to what glTF demands, meters with y up and z to the
front, and ``extras`` of the mesh name unit and frame.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from ..colors import named_colors
from ..files.atomic import replacing
from ..files.source import third_party
from .attributes import single_precision
from .weld import weld

if TYPE_CHECKING:
    from pathlib import Path

    from ...model.mesh import TriMesh
    from ..fields import Fields
    from .attributes import MeshAttributes
    from .through_trimesh import Arrays

METERS = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0}
"""Meters in a unit; an unknown one stays as it is."""

TURNS = {"LPS": ((1, 0, 0), (0, 0, 1), (0, -1, 0)), "RAS": ((-1, 0, 0), (0, 0, 1), (0, 1, 0))}
"""Frame to the rows of its rotation to +x left, +y superior, +z anterior; others stay as they are."""


def write_glb(mesh: TriMesh, path: str | Path, beside: MeshAttributes) -> None:
    """Write 32-bit coordinates, colors, and other fields at vertices as 32-bit attributes ``_NAME``.

    Raises
    ------
    OutputError
        Where 32 bits cannot keep the vertices apart.
    """
    import trimesh
    from trimesh.exchange.gltf import export_glb

    colors, attributes = _at_vertices(beside.vertex_fields)
    body = trimesh.Trimesh(
        single_precision(mesh.vertices, path, kind="GLB"),
        mesh.faces,
        vertex_colors=colors,
        vertex_attributes=attributes,
        metadata={"unit": beside.unit, "frame": beside.frame},
        process=False,
    )
    scene = trimesh.Scene()
    scene.add_geometry(body, node_name="mesh", geom_name="mesh", transform=_to_gltf(beside))
    data = export_glb(scene, include_normals=False, tree_postprocessor=lambda tree: _finish(tree, beside))
    with replacing(path) as file:
        file.write(data)


def _at_vertices(fields: Fields) -> tuple[Any, Fields]:
    """Part the colors, None where there are none, from the other fields."""
    names, colors = named_colors(fields) or ([], None)
    return colors, {f"_{name.upper()}": values.astype("<f4") for name, values in fields.items() if name not in names}


def _to_gltf(beside: MeshAttributes) -> Any:
    matrix = np.eye(4)
    matrix[:3, :3] = METERS.get(beside.unit, 1.0) * np.array(TURNS.get(beside.frame, np.eye(3)))
    return matrix


def _finish(tree: dict[str, Any], beside: MeshAttributes) -> None:
    """Name the program, and drop the bounds of attributes, which glTF does not need: JSON has no word for NaN."""
    tree["asset"]["generator"] = beside.head
    attributes = tree["meshes"][0]["primitives"][0]["attributes"]
    for number in (number for name, number in attributes.items() if name.startswith("_")):
        for bound in ("min", "max"):
            tree["accessors"][number].pop(bound, None)


def read_glb(data: bytes, file: str) -> Arrays:
    """Read vertices and faces: the numbers of the mesh where tomomesh wrote it, else placed by its nodes, in meters.

    Equal positions become one vertex: exporters part them where normals or textures differ.
    """
    scene, named = _scene(data, file)
    meshes = [*scene.geometry.values()] if named else scene.dump()
    parts = [mesh for mesh in meshes if hasattr(mesh, "faces")]
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in parts)])
    vertices = np.concatenate([np.empty((0, 3)), *(mesh.vertices for mesh in parts)])
    faces = [np.empty((0, 3), np.int64), *(mesh.faces + n for mesh, n in zip(parts, first, strict=False))]
    unique, numbers = weld(np.array(vertices, np.float64))
    return unique, numbers[np.concatenate(faces)]


def glb_frame(data: bytes, file: str) -> dict[str, str]:
    """Return the unit and the frame of a file: its own where tomomesh wrote it, else meters, as glTF has it."""
    return _scene(data, file)[1] or {"unit": "m"}


def _scene(data: bytes, file: str) -> tuple[Any, dict[str, str]]:
    """Return the scene, and unit and frame where its one mesh names them."""
    import trimesh

    with third_party("trimesh", file):
        scene: Any = trimesh.load(io.BytesIO(data), file_type="glb", force="scene", process=False, skip_materials=True)
        known = [mesh.metadata for mesh in scene.geometry.values()]
    named = known[0] if len(known) == 1 and {"unit", "frame"} <= set(known[0]) else {}
    return scene, {name: str(named[name]) for name in ("unit", "frame") if name in named}
