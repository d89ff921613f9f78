"""The scene that opens study and mesh together in 3D Slicer: refused early, written last."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...errors import UsageError
from ...io.files.source import suffix_of
from ...io.slicer import MESHES, require_same_place, require_slicer_study, write_slicer_scene

if TYPE_CHECKING:
    from argparse import Namespace

    from ...io import Frame
    from ...model.volume import Volume
    from ...settings import Settings


def check_scene(chosen: Namespace, settings: Settings) -> None:
    """Refuse a scene of what 3D Slicer cannot open or would place otherwise, before any work.

    Raises
    ------
    UsageError
    """
    if not chosen.slicer:
        return
    typed: str = getattr(chosen, "typed", "")
    if "--input-format" in typed or hasattr(chosen, "shown"):
        raise UsageError("a scene names files", found="--slicer beside a stream", expected="named files")
    if suffix_of(chosen.output) not in MESHES:
        raise UsageError(
            "3D Slicer does not read such a mesh", file=str(chosen.output), found="--slicer",
            expected=" | ".join(MESHES),
        )  # fmt: skip
    if settings.printing.asked or settings.run.frame == "voxel":
        raise UsageError(
            "a scene places the mesh in the patient", found="--slicer beside --frame voxel or a part to print",
            expected="--frame lps or ras",
        )  # fmt: skip
    require_slicer_study(_study(chosen), settings.read)


def check_place(chosen: Namespace, settings: Settings, volume: Volume) -> None:
    """Refuse a study that 3D Slicer would place otherwise than it was read.

    Raises
    ------
    GeometryError
    """
    if chosen.slicer:
        files = require_slicer_study(_study(chosen), settings.read)
        require_same_place(volume, files, file=str(files[0].parent if len(files) > 1 else files[0]))


def write_scene(chosen: Namespace, frame: Frame, settings: Settings, *, color: bool) -> None:
    """Write the scene of a mesh that is there."""
    files = require_slicer_study(_study(chosen), settings.read)
    write_slicer_scene(chosen.slicer, study=files, mesh=chosen.output, frame=frame.name, color=color)


def _study(chosen: Namespace) -> str | tuple[str, ...]:
    study: str | tuple[str, ...] = chosen.study or chosen.labels_in
    return study
