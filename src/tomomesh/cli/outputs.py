"""What a command writes: refused before any work where it could not be, written at the end."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import io
from ..errors import OutputError, UsageError
from ..io.files.source import suffix_of
from ..stage import Stage
from .parts import frame_of_part

if TYPE_CHECKING:
    from argparse import Namespace

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ..model.points import PointSet
    from ..model.volume import Volume
    from ..results import Place, Segmentation, Surface
    from ..settings import Settings
    from .bars import Bars

OF_STUDIES = (*io.MESH_WRITERS, *io.ARCHIVED)
"""Suffixes of meshes of a study."""


def check_folder(path: str | Path) -> Path:
    """Refuse a folder that could not be made, before any work is done.

    Raises
    ------
    OutputError
    """
    folder = Path(path)
    there = folder if folder.exists() else Path(os.path.realpath(folder)).parent
    if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
        raise OutputError("the folder cannot be made", file=str(path), expected="a place that can be written to")
    return folder


def make_folder(folder: Path) -> None:
    """Make a folder, if it is not there.

    Raises
    ------
    OutputError
    """
    try:
        folder.mkdir(exist_ok=True)
    except OSError as fault:
        raise OutputError("the folder cannot be made", file=str(folder), found=fault.strerror or "") from fault


def check_outputs(chosen: Namespace, writers: Any, *sources: str) -> None:
    """Refuse outputs that could not be written, or that would overwrite what is read."""
    io.check_output(chosen.output, writers, inputs=list(sources))
    check_files(chosen, *sources, chosen.output)


def check_files(chosen: Namespace, *taken: str) -> None:
    """Refuse further outputs that could not be written, or that would overwrite another file of this run."""
    kinds = {
        "points": io.POINT_WRITERS,
        "labels": io.LABEL_WRITERS,
        "mask_out": io.LABEL_WRITERS,
        "report": (".json",),
        "save_settings": (".toml",),
    }
    names = list(taken)
    for name, suffixes in kinds.items():
        if getattr(chosen, name, None):
            io.check_output(getattr(chosen, name), suffixes, inputs=names)
            names.append(getattr(chosen, name))
    if getattr(chosen, "figures", None):
        check_folder(chosen.figures)


def check_frame(output: str | Path, settings: Settings) -> None:
    """Refuse voxel indices of a part to print and in a format of lengths, before any work is done.

    Raises
    ------
    UsageError
    """
    if settings.run.frame == "voxel" and settings.printing.asked:
        raise UsageError("a part to print has no voxels", found="--frame = voxel", expected="--frame lps or ras")
    if settings.printing.asked and suffix_of(output) in io.ARCHIVED:
        raise UsageError("a part to print lies in no patient", file=str(output), expected="a mesh, or another format")
    if settings.run.frame == "voxel" and suffix_of(output) in (*io.LENGTHS, *io.ARCHIVED):
        raise UsageError(
            "3MF, GIFTI and DICOM hold lengths, not voxel indices", found=f"--frame = voxel, --output = {output}",
            expected="--frame lps or ras, or another format",
        )  # fmt: skip


def check_archive(chosen: Namespace, volume: Volume) -> None:
    """Refuse a mesh for the archive of what is no DICOM study, and personal fields in any other file.

    Raises
    ------
    UsageError
    """
    archived = suffix_of(chosen.output) in io.ARCHIVED
    if chosen.patient and not archived:
        raise UsageError("only a mesh for the archive names its patient", found="--patient", expected="-o MESH.dcm")
    if archived:
        io.check_archived(volume.dicom, file=str(chosen.output))


def write_surface(chosen: Namespace, surface: Surface, settings: Settings, progress: Bars) -> Surface:
    """Write the mesh, and whatever else was asked for; return the surface, whose report tells of it."""
    stage_one, part = surface.segmentation, surface.part
    frame = _frame_asked(surface, chosen.output, settings)
    in_file = _write_mesh(chosen, surface, frame, settings)
    told: dict[str, dict[str, Any]] = {"written": {"unit": in_file.unit, "frame": in_file.name}}
    if getattr(chosen, "points", None):
        write_points(surface.points, stage_one, chosen.points, settings, surface.place)
    if stage_one is not None:
        write_stage_one(chosen, stage_one)
    if getattr(chosen, "mask_out", None):
        told["mask"] = _write_mask(surface, chosen.mask_out, settings)
    surface = replace(surface, stages=(*surface.stages, Stage(None, told)))
    if part is None:
        _tell_cavities(surface.report, frame, in_file)
    write_documents(chosen, surface.report, settings)
    draw(chosen.figures, stage_one, surface, settings, progress)
    return surface


def _write_mesh(chosen: Namespace, surface: Surface, frame: io.Frame, settings: Settings) -> io.Frame:
    """Write the mesh in a frame, or its part to print; return that of the numbers in the file."""
    stage_one, part, output = surface.segmentation, surface.part, chosen.output
    at_vertices, on_faces = _fields(surface, output)
    mesh = frame.mesh(surface.mesh if part is None else part.mesh)
    named = {"unit": frame.unit, "frame": frame.name}
    named = named if part is None else frame_of_part(named, settings.printing.scale)
    if stage_one is not None and suffix_of(output) in io.ARCHIVED:
        io.write_encapsulated(mesh, output, stage_one.volume.dicom, patient=chosen.patient)
    else:
        io.write_mesh(
            mesh, output, **named, vertex_fields=at_vertices, face_fields=on_faces, z_up=part is not None,
            precision=settings.run.precision,
        )  # fmt: skip
    return io.frame_in_file(output, **named)


def _tell_cavities(report: dict[str, Any], frame: io.Frame, in_file: io.Frame) -> None:
    """Add a place in each cavity to what was written, in the file's own numbers: holes for finite elements."""
    places = report.get("quality", {}).get("cavity_places_mm")
    if places:
        report["written"]["cavity_places"] = in_file.place(frame.place(np.array(places))).tolist()


def _frame_asked(surface: Surface, output: str | Path, settings: Settings) -> io.Frame:
    """Return the frame of the mesh that is written: a cloud's own, or that which was asked for, or the format has."""
    stage_one = surface.segmentation
    if stage_one is None:
        named = _frame_of_cloud(surface.place)
        return io.Frame(named["unit"], named["frame"], np.eye(4))
    own = "ras" if suffix_of(output) in io.RAS_ALONE else "lps" if suffix_of(output) in io.ARCHIVED else ""
    return io.frame_of_study(own or settings.run.frame, stage_one.volume.grid)


def write_points(
    points: PointSet, stage_one: Segmentation[Any] | None, path: str | Path, settings: Settings,
    place: Place | None = None,
) -> dict[str, str]:  # fmt: skip
    """Write the points in the frame that was asked for, or a cloud's own, and return its unit and name."""
    if stage_one is None:
        named = _frame_of_cloud(place)
    else:
        frame = io.frame_of_study(settings.run.frame, stage_one.volume.grid)
        points, named = frame.points(points), {"unit": frame.unit, "frame": frame.name}
    io.write_points(points, path, **named, precision=settings.run.precision)
    return named


def _frame_of_cloud(place: Place | None) -> dict[str, str]:
    """Name unit and frame of a cloud: whatever its numbers are in."""
    assert place is not None
    return {"unit": place.unit, "frame": place.name}


def _write_mask(surface: Surface, path: str | Path, settings: Settings) -> dict[str, Any]:
    """Write the voxels inside the mesh on the study's own grid; return how well they agree with those of the window."""
    from ..measure.fill import fill_mesh, overlap

    stage_one = surface.segmentation
    assert stage_one is not None
    whole = stage_one.volume.grid.blank()
    inside = fill_mesh(surface.mesh, whole)
    io.write_labels(inside.view(np.uint8), whole, path)
    wanted, filled = stage_one.volume.grid.restore(stage_one.mask), whole.grid.restore(inside)
    against = "window" if settings.window.select is None else "labels"
    return overlap(filled, wanted, stage_one.volume.voxel_mm3) | {"against": against}


def _fields(surface: Surface, output: str | Path) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]]]:
    """Return what the format keeps beside the mesh: what is known of the points, and which faces were filled."""
    from ..pointcloud.attributes import carry

    points = surface.points
    kept = {name: values for name, values in points.attributes.items() if io.keeps(output, name)}
    part = surface.part
    places = surface.mesh.vertices if part is None else part.mesh.vertices / part.per_unit
    at_vertices = carry(replace(points, attributes=kept), places)
    if part is not None or not io.keeps(output, "filled", on_faces=True):
        return at_vertices, {}
    filled = surface.filled
    if surface.segmentation is not None:
        filled = surface.cap_faces if filled is None else surface.cap_faces | filled
    return at_vertices, {} if filled is None or not filled.any() else {"filled": filled}


def write_stage_one(chosen: Namespace, found: Segmentation[Any]) -> None:
    """Write the regions, where they were asked for."""
    if getattr(chosen, "labels", None):
        io.write_labels(found.labels, found.volume, chosen.labels)


def write_documents(chosen: Namespace, report: dict[str, Any], settings: Settings) -> None:
    """Write the report and the settings, where they were asked for."""
    if chosen.report:
        io.write_document(report, chosen.report)
    if chosen.save_settings:
        io.write_settings(settings, chosen.save_settings)


def draw(
    folder: str | Path | None,
    stage_one: Segmentation[Any] | None,
    surface: Surface | None,
    settings: Settings,
    progress: Bars,
) -> None:
    """Draw the paper's figures of whatever stages there are."""
    if folder is None:
        return
    from .pictures import pictures

    where = Path(folder)
    make_folder(where)
    done, expected = 0, 10 if surface else 6
    for done, (name, figure) in enumerate(pictures(stage_one, surface, settings), 1):
        progress("pictures", done - 1, max(expected, done))
        write_picture(figure, where / f"{name}.png")
    progress("pictures", done, done)


def write_picture(figure: Figure, path: Path) -> None:
    """Write a picture, whole or not at all."""
    from ..show import save

    with io.replacing(path) as file:
        save(figure, file)
