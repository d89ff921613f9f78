"""OFF: vertices and faces as text.

Written by hand: trimesh's exporter rounds to ten digits. Neither comments nor colors (COFF): niivue shows nothing of
files that have one, meshio and CloudCompare refuse some.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..files.atomic import replacing

if TYPE_CHECKING:
    from pathlib import Path

    from ...model.mesh import TriMesh
    from .attributes import MeshAttributes


def write_off(mesh: TriMesh, path: str | Path, _beside: MeshAttributes) -> None:
    """Write 64-bit coordinates; neither unit nor frame has a place."""
    vertices = (f"{x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist())
    faces = (f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist())
    head = ["OFF", f"{len(mesh.vertices)} {len(mesh.faces)} 0"]
    with replacing(path) as file:
        file.write(("\n".join([*head, *vertices, *faces]) + "\n").encode("ascii"))
