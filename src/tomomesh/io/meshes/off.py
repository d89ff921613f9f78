"""OFF: vertices and faces as text, with colors as COFF.

Written by hand: trimesh's exporter rounds to ten digits and has neither comments nor colors.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..colors import named_colors
from ..files.atomic import replacing

if TYPE_CHECKING:
    from pathlib import Path

    from ...model.mesh import TriMesh
    from .attributes import MeshAttributes


def write_off(mesh: TriMesh, path: str | Path, beside: MeshAttributes) -> None:
    """Write 64-bit coordinates; colors, where there are any, behind them as red, green, blue and alpha, 0 to 255."""
    colors = named_colors(beside.vertex_fields)
    behind = [f" {r} {g} {b} 255" for r, g, b in colors[1].tolist()] if colors else [""] * len(mesh.vertices)
    vertices = (f"{x!r} {y!r} {z!r}{color}" for (x, y, z), color in zip(mesh.vertices.tolist(), behind, strict=True))
    faces = (f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist())
    head = ["COFF" if colors else "OFF", f"# {beside.head}", f"{len(mesh.vertices)} {len(mesh.faces)} 0"]
    with replacing(path) as file:
        file.write(("\n".join([*head, *vertices, *faces]) + "\n").encode("ascii"))
