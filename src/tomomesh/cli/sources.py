"""What a command reads, and what a mesh is compared with."""

from __future__ import annotations

import shlex
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import io
from ..errors import GeometryError, UsageError
from ..io.files.source import suffix_of

if TYPE_CHECKING:
    from ..model.mesh import TriMesh
    from ..model.volume import Grid, Volume
    from ..settings import Settings
    from .bars import Bars


def gathered(chosen: Namespace) -> Namespace:
    """Make one study of the files that were named one by one: None, a path, or a tuple of paths.

    Raises
    ------
    UsageError
        For standard input among others.
    """
    named = getattr(chosen, "study", None)
    if not isinstance(named, list):
        return chosen
    if len(named) < 2:
        return Namespace(**vars(chosen) | {"study": named[0] if named else None})
    if "-" in named:
        raise UsageError("standard input is one study by itself", found=f"- and {len(named) - 1} files")
    return Namespace(**vars(chosen) | {"study": tuple(named), "typed": _in_short(named)})


def _in_short(named: list[str]) -> str:
    """Return words of a command line that a shell expands to these files: a pattern where there is one."""
    first = Path(named[0])
    for pattern in (f"*{first.suffix}", "*"):
        found = {path for path in first.parent.glob(pattern) if not path.name.startswith(".")}
        if found == set(map(Path, named)):
            return f"{shlex.quote(str(first.parent))}/{pattern}"
    return " ".join(map(shlex.quote, named))


def sources_of(chosen: Namespace, settings: Settings) -> list[str]:
    """Return the files that are read; refuse a label map without labels, and a command without any."""
    study = chosen.study if isinstance(chosen.study, tuple) else (chosen.study,)
    sources = [path for path in (*study, chosen.labels_in) if path]
    if not sources:
        raise UsageError("there is no study", expected="STUDY, or --labels-in with --select")
    if chosen.labels_in and settings.window.select is None:
        raise UsageError(
            "no label was chosen", found=f"--labels-in {chosen.labels_in}", expected="--select with its labels"
        )
    return sources


def read_study(chosen: Namespace, settings: Settings, progress: Bars) -> tuple[Volume, Volume | None]:
    """Read the study, and the label map where there is one beside it."""
    total = 2 if chosen.study and chosen.labels_in else 1
    progress("read", 0, total)
    select = settings.window.select
    volume = io.read_volume(chosen.study or chosen.labels_in, settings=settings.read, select=select)
    labels = io.read_volume(chosen.labels_in, settings=settings.read, select=select) if total == 2 else None
    progress("read", total, total)
    return volume, labels


def compared(chosen: Namespace, mesh: TriMesh, settings: Settings) -> dict[str, Any]:
    """Compare a mesh with another, or with a window or labels of a study, each in its own unit and frame.

    Raises
    ------
    GeometryError
        For voxel indices beside a mesh in another frame.
    """
    stated = io.frame_of_file(chosen.mesh)
    stated |= {"frame": chosen.mesh_frame.replace("lps", "LPS").replace("ras", "RAS")} if chosen.mesh_frame else {}
    if suffix_of(chosen.against) in io.MESH_READERS:
        return _with_mesh(chosen.against, mesh, stated)
    from ..agreement.study import compare_with_study

    study = io.read_volume(chosen.against, settings=settings.read, select=settings.window.select)
    named = {"unit": "mm", "frame": "unknown"} | stated
    found = compare_with_study(_in_lps(mesh, named, study.grid), study, settings)
    notes = () if "frame" in stated else (f"{chosen.mesh} names no frame, and is taken for LPS (--mesh-frame)",)
    what = "labels" if settings.window.select else "window"
    return {"against": what, **found, "frame": named["frame"], "notes": [*notes, *study.notes]}


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
