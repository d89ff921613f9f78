"""OBJ: vertices and faces as text, with colors behind the positions where there are any."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ..colors import named_colors
from ..files.atomic import replacing

if TYPE_CHECKING:
    from pathlib import Path

    from ...model.mesh import TriMesh
    from .attributes import MeshAttributes


def write_obj(mesh: TriMesh, path: str | Path, beside: MeshAttributes) -> None:
    """Write 64-bit coordinates, and colors as fractions behind them."""
    colors = named_colors(beside.vertex_fields)
    behind = [""] * len(mesh.vertices)
    if colors:
        # rounded up: VTK cuts off what it makes of them
        fractions = [f" {math.ceil(value / 255 * 1e6) / 1e6:.6g}" for value in range(256)]
        behind = ["".join(fractions[value] for value in color) for color in colors[1].tolist()]
    vertices = (f"v {x!r} {y!r} {z!r}{color}" for (x, y, z), color in zip(mesh.vertices.tolist(), behind, strict=True))
    faces = (f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist())
    with replacing(path) as file:
        file.write(("\n".join([f"# {beside.head}", *vertices, *faces]) + "\n").encode("ascii"))
