"""GLB, binary glTF 2.0, which browsers and 3D viewers show, through trimesh.

The numbers are those of the mesh; the node's matrix carries them to what glTF demands, meters with y up and z to the
front, and ``extras`` of the mesh name unit and frame.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from ...model.units import MM
from ..colors import linear, named_colors
from ..files.atomic import replacing
from ..files.source import third_party
from .attributes import single_precision
from .cells import together, weld

if TYPE_CHECKING:
    from pathlib import Path

    from ...model.mesh import TriMesh
    from ..fields import Fields
    from .attributes import MeshAttributes
    from .cells import Arrays

UPRIGHT = ((1, 0, 0), (0, 0, 1), (0, -1, 0))
"""Rows of the rotation that brings z to y."""

TURNS = {"LPS": UPRIGHT, "RAS": ((-1, 0, 0), (0, 0, 1), (0, 1, 0))}
"""Frame to the rows of its rotation to +x left, +y superior, +z anterior; others stay as they are."""

WHITE = [1.0, 1.0, 1.0, 1.0]
PLAIN = {
    "pbrMetallicRoughness": {"baseColorFactor": WHITE, "metallicFactor": 0.0, "roughnessFactor": 1.0}, "name": "plain",
}  # fmt: skip
"""A dull material, which colors at vertices are multiplied by; without one a mesh is metal. White is what it is anyway,
but trimesh shows no mesh whose material does not say so."""

OF_VERTICES, OF_FACES = 34962, 34963
"""What a block of numbers is for (glTF 2.0, 5.11.5): OpenGL's ARRAY_BUFFER and ELEMENT_ARRAY_BUFFER."""

COLOR = "_COLOR_0"
"""The colors on their way through trimesh, which has bytes alone for those of its own."""


def write_glb(mesh: TriMesh, path: str | Path, beside: MeshAttributes) -> None:
    """Write 32-bit coordinates, colors, and other finite fields at vertices as 32-bit attributes ``_NAME``.

    Raises
    ------
    OutputError
        Where 32 bits cannot keep the vertices apart.
    """
    import trimesh
    from trimesh.exchange.gltf import export_glb

    body = trimesh.Trimesh(
        single_precision(mesh.vertices, path, kind="GLB"),
        mesh.faces,
        vertex_attributes=_at_vertices(beside.vertex_fields),
        metadata={"unit": beside.unit, "frame": beside.frame},
        process=False,
    )
    scene = trimesh.Scene()
    scene.add_geometry(body, node_name="mesh", geom_name="mesh", transform=_to_gltf(beside))
    data = export_glb(scene, include_normals=False, tree_postprocessor=lambda tree: _finish(tree, beside))
    with replacing(path) as file:
        file.write(data)


def _at_vertices(fields: Fields) -> Fields:
    """Return the colors, where there are any, as light (glTF 2.0, 3.7.2.1), and the other fields, in 32 bits.

    Fields with numbers that are not finite have no place in glTF (3.6.2.1).
    """
    names, colors = named_colors(fields) or ([], None)
    with np.errstate(over="ignore"):
        others = {f"_{name.upper()}": values.astype("<f4") for name, values in fields.items() if name not in names}
    light = {} if colors is None else {COLOR: linear(colors)}
    return light | {name: values for name, values in others.items() if np.isfinite(values).all()}


def _to_gltf(beside: MeshAttributes) -> Any:
    matrix = np.eye(4)
    usual = UPRIGHT if beside.z_up else np.eye(3)
    meters = MM[beside.unit] / 1000 if beside.unit in MM else 1.0  # an unknown unit stays as it is
    matrix[:3, :3] = meters * np.array(TURNS.get(beside.frame, usual))
    return matrix


def _finish(tree: dict[str, Any], beside: MeshAttributes) -> None:
    """Name the program, the material and what the numbers are for."""
    tree["asset"]["generator"] = beside.head
    tree["materials"] = [PLAIN]
    body = tree["meshes"][0]["primitives"][0]
    body["material"] = 0
    accessors, attributes = tree["accessors"], body["attributes"]
    for name, number in (("", body["indices"]), *attributes.items()):
        tree["bufferViews"][accessors[number]["bufferView"]]["target"] = OF_VERTICES if name else OF_FACES
    if COLOR in attributes:
        attributes["COLOR_0"] = attributes.pop(COLOR)


def read_glb(data: bytes, file: str) -> Arrays:
    """Read vertices and faces: the numbers of the mesh where tomomesh wrote it, else placed by its nodes, in meters.

    Equal positions become one vertex: exporters part them where normals or textures differ.
    """
    scene, named = _scene(data, file)
    meshes = [*scene.geometry.values()] if named else scene.dump()
    parts = [(np.asarray(mesh.vertices), np.asarray(mesh.faces)) for mesh in meshes if hasattr(mesh, "faces")]
    vertices, faces = together(parts)
    unique, numbers = weld(vertices)
    return unique, numbers[faces]


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
