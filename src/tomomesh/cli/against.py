"""What a mesh is compared with, each in its own unit and frame."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .. import io
from ..errors import GeometryError
from ..io.files.source import suffix_of

if TYPE_CHECKING:
    from argparse import Namespace

    from ..model.mesh import TriMesh
    from ..model.volume import Grid
    from ..settings import Settings


def is_mesh(path: str) -> bool:
    """Whether a file is a mesh and no study: by its suffix, and DICOM by what it says that it holds."""
    return suffix_of(path) in io.MESH_READERS and (suffix_of(path) not in io.ARCHIVED or io.is_archived(path))


def compared(chosen: Namespace, mesh: TriMesh, settings: Settings) -> dict[str, Any]:
    """Compare a mesh with another, or with a window or labels of a study, each in its own unit and frame.

    Raises
    ------
    GeometryError
        For voxel indices beside a mesh in another frame.
    """
    stated = io.frame_of_file(chosen.mesh)
    stated |= {"frame": chosen.mesh_frame.replace("lps", "LPS").replace("ras", "RAS")} if chosen.mesh_frame else {}
    if is_mesh(chosen.against):
        return _with_mesh(chosen.against, mesh, stated)
    from ..agreement.study import compare_with_study

    study = io.read_volume(chosen.against, settings=settings.read, select=settings.window.select)
    named = {"unit": "mm", "frame": "unknown"} | stated
    found = compare_with_study(_in_lps(mesh, named, study.grid), study, settings)
    notes = () if "frame" in stated else (f"{chosen.mesh} names no frame, and is taken for LPS (--mesh-frame)",)
    what = "labels" if settings.window.select else "window"
    return {"against": what, **found, "frame": named["frame"], "notes": [*notes, *found["notes"]]}


def _with_mesh(path: str, mesh: TriMesh, stated: dict[str, str]) -> dict[str, Any]:
    """Compare two meshes; where one does not state its unit or frame, it is taken for the other's."""
    from ..agreement.meshes import compare_with_mesh

    other, its = io.read_mesh(path), io.frame_of_file(path)
    own, its = {"unit": "mm", "frame": "unknown"} | its | stated, {"unit": "mm", "frame": "unknown"} | stated | its
    if own != its:
        if "voxel" in (own["frame"], its["frame"]):
            raise GeometryError(
                "voxel indices are no lengths", file=path, found=f"frame = {its['frame']}",
                expected=f"frame = {own['frame']}", hint="--frame lps where the mesh is made",
            )  # fmt: skip
        mesh, other = _in_lps(mesh, own), _in_lps(other, its)
    return {"against": "mesh", **compare_with_mesh(mesh, other), "frame": own["frame"], "notes": []}


def _in_lps(mesh: TriMesh, named: dict[str, str], grid: Grid | None = None) -> TriMesh:
    return io.in_lps(mesh, unit=named["unit"], frame=named["frame"], grid=grid)
