"""What a command writes: refused before any work where it could not be, written at the end."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import io
from ..errors import OutputError

if TYPE_CHECKING:
    from argparse import Namespace

    from numpy.typing import NDArray

    from ..results import Segmentation, Surface
    from ..settings import Settings
    from .bars import Bars


def check_folder(path: str | Path) -> Path:
    """Refuse a folder that could not be made, before any work is done."""
    folder = Path(path)
    there = folder if folder.exists() else Path(os.path.realpath(folder)).parent
    if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
        raise OutputError("the folder cannot be made", file=str(path), expected="a place that can be written to")
    return folder


def make_folder(folder: Path) -> None:
    """Make a folder, if it is not there."""
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
    kinds = {"points": io.POINT_WRITERS, "labels": io.LABEL_WRITERS, "report": (".json",), "save_settings": (".toml",)}
    names = list(taken)
    for name, suffixes in kinds.items():
        if getattr(chosen, name, None):
            io.check_output(getattr(chosen, name), suffixes, inputs=names)
            names.append(getattr(chosen, name))
    if getattr(chosen, "figures", None):
        check_folder(chosen.figures)


def write_surface(chosen: Namespace, surface: Surface, settings: Settings, progress: Bars) -> None:
    """Write the mesh, and whatever else was asked for."""
    stage_one, part = surface.segmentation, surface.part
    frame = frame_of(surface.report, settings)
    at_vertices, on_faces = _fields(surface, chosen.output)
    if part is None:
        io.write_mesh(surface.mesh, chosen.output, **frame, vertex_fields=at_vertices, face_fields=on_faces)
    else:
        io.write_mesh(part.mesh, chosen.output, **frame_of_part(frame), vertex_fields=at_vertices, face_fields={})
    if getattr(chosen, "points", None):
        io.write_points(surface.points, chosen.points, **frame)
    if stage_one is not None:
        write_stage_one(chosen, stage_one)
    write_documents(chosen, surface.report, settings)
    draw(chosen.figures, stage_one, surface, settings, progress)


def frame_of(report: dict[str, Any], settings: Settings) -> dict[str, str]:
    """Name unit and frame: a study is written in patient millimeters, a cloud in whatever its numbers are in."""
    if "study" in report:
        return {"unit": "mm", "frame": "LPS"}
    corner = ",".join(repr(place).removesuffix(".0") for place in report["points"]["origin"])
    return {"unit": settings.run.units, "frame": f"local:{corner}" if settings.run.local_origin else "unknown"}


def frame_of_part(frame: dict[str, str]) -> dict[str, str]:
    """Name unit and frame of a part of what lies in some frame: a cloud's own is not that of its part."""
    unit = frame["unit"] if frame["unit"] == "unknown" else "mm"
    return {"unit": unit, "frame": frame["frame"] if frame["frame"] == "LPS" else "unknown"}


def _fields(surface: Surface, output: str | Path) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]]]:
    """Return what the format keeps beside the mesh: what is known of the points, and which faces were filled."""
    from ..surface.attributes import carry

    points = surface.points
    kept = {name: values for name, values in points.attributes.items() if io.keeps(output, name)}
    part = surface.part
    places = surface.mesh.vertices if part is None else part.mesh.vertices / part.per_unit
    at_vertices = carry(replace(points, attributes=kept), places)
    if part is not None or not io.keeps(output, "filled", on_faces=True):
        return at_vertices, {}
    filled = surface.filled
    if filled is None and surface.segmentation is not None:
        filled = surface.cap_faces
    return at_vertices, {} if filled is None else {"filled": filled}


def write_stage_one(chosen: Namespace, found: Segmentation) -> None:
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
    stage_one: Segmentation | None,
    surface: Surface | None,
    settings: Settings,
    progress: Bars,
) -> None:
    """Draw the paper's figures of whatever stages there are."""
    if folder is None:
        return
    from ..show import save
    from .pictures import pictures

    where = Path(folder)
    make_folder(where)
    done, expected = 0, 10 if surface else 6
    for done, (name, figure) in enumerate(pictures(stage_one, surface, settings), 1):
        progress("pictures", done - 1, max(expected, done))
        save(figure, where / f"{name}.png")
    progress("pictures", done, done)
