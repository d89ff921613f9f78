"""Solids that are cut and joined exactly, by the package manifold3d."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import GeometryError, UsageError
from ..model.mesh import TriMesh

if TYPE_CHECKING:
    from ..settings import PrintSettings

PACKAGE = "manifold3d"
APART = 4 * float(np.finfo(np.float32).eps)
"""Distance over the largest coordinate up to which a cut joins vertices: what 32 bits would not keep apart."""


def require_solids(settings: PrintSettings) -> None:
    """Refuse cuts where the package for them is not installed.

    Raises
    ------
    UsageError
        Naming it.
    """
    if settings.cuts and find_spec(PACKAGE) is None:
        raise UsageError(
            "a part is cut and hollowed by a package that is not installed",
            found="--flat-base, --thicken, --hollow or --drain",
            expected=PACKAGE,
            hint='pip install "tomomesh[print]"',
        )


def solid_of(mesh: TriMesh) -> Any:
    """Return a mesh as a solid of manifold3d.

    Raises
    ------
    GeometryError
        Where it is not closed and manifold.
    """
    from manifold3d import Error, Manifold, Mesh64

    solid = Manifold(Mesh64(np.ascontiguousarray(mesh.vertices, np.float64), mesh.faces.astype(np.uint64)))
    if solid.status() != Error.NoError:
        raise GeometryError(
            "the mesh encloses no solid",
            found=f"manifold3d = {solid.status().name}",
            expected="a closed 2-manifold",
            hint="`tomomesh check`",
        )
    return solid


def mesh_of(solid: Any) -> TriMesh:
    """Return a solid of manifold3d as a mesh, vertices joined that 32 bits would not keep apart."""
    low, high = np.reshape(solid.bounding_box(), (2, 3))
    found = solid.simplify(APART * float(np.abs([low, high]).max())).to_mesh64()
    return TriMesh(np.array(found.vert_properties[:, :3], np.float64), np.array(found.tri_verts, np.int64))
