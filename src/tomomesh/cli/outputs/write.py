"""What a command writes at its end."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import io
from ...io.files.source import suffix_of
from ...progress import Progress, silent
from ...stage import Stage
from .checks import make_folder
from .parts import frame_of_part
from .slicer import write_scene

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...model.points import PointSet
    from ...results import Place, Segmentation, Surface
    from ...settings import Settings
    from ...show.drawing.page import Page
    from ...som.region import TrainedNetwork
    from ..bars import Bars


def write_surface(
    chosen: Namespace, surface: Surface, settings: Settings, progress: Bars, *, fits: bool | None = None
) -> Surface:
    """Write the mesh, and whatever else was asked for; return the surface, whose report tells of it.

    See `tomomesh.io.write_mesh` for `fits`.
    """
    stage_one = surface.segmentation
    frame = frame_asked(surface, chosen.output, settings)
    in_file = _write_mesh(chosen, surface, frame, settings, fits)
    if getattr(chosen, "slicer", None) and stage_one is not None:
        write_scene(chosen, frame, settings, color=stage_one.volume.layers > 1)
    told: dict[str, dict[str, Any]] = {}
    if getattr(chosen, "points", None):
        write_points(surface.points, stage_one, chosen.points, settings, surface.place)
    if stage_one is not None:
        write_stage_one(chosen, stage_one)
    if getattr(chosen, "mask_out", None):
        told["mask"] = _write_mask(surface, chosen.mask_out, settings)
    surface = _with_frames(surface, frame, in_file, told)
    write_documents(chosen, surface.report, settings)
    html = getattr(chosen, "html", None)
    drawn = draw(chosen.figures, stage_one, surface, settings, progress, kept=bool(html))
    if html:
        from .html import write_surface_html

        write_surface_html(chosen, surface, drawn)
    return surface


def _with_frames(surface: Surface, frame: io.Frame, in_file: io.Frame, told: dict[str, dict[str, Any]]) -> Surface:
    """Return the surface with a report that tells in which numbers its mesh was written, and what else was told."""
    written = {"written": {"unit": in_file.unit, "frame": in_file.name}}
    surface = replace(surface, stages=(*surface.stages, Stage(None, written | told)))
    if surface.part is None:
        _tell_cavities(surface.report, frame, in_file)
    return surface


def write_one(what: str, surface: Surface, settings: Settings, path: Path, words: Sequence[str]) -> None:
    """Write one file of a surface by itself: its mesh, points, labels, mask or report.

    The report is that of the command whose words are given.
    """
    if what == "mesh":
        chosen = Namespace(output=path, patient=False)
        _write_mesh(chosen, surface, frame_asked(surface, path, settings), settings, None)
    elif what == "points":
        write_points(surface.points, surface.segmentation, path, settings, surface.place)
    elif what == "mask":
        _write_mask(surface, path, settings)
    elif what == "report":
        _write_report(surface, settings, path, words)
    else:
        assert surface.segmentation is not None
        io.write_labels(surface.segmentation.labels, surface.segmentation.volume, path)


def _write_report(surface: Surface, settings: Settings, path: Path, words: Sequence[str]) -> None:
    """Write the report of a surface as a page or as JSON."""
    from .html import write_surface_html

    output = words[-1]
    frame = frame_asked(surface, output, settings)
    surface = _with_frames(surface, frame, io.frame_in_file(output, unit=frame.unit, frame=frame.name), {})
    if suffix_of(path) == ".html":
        chosen = Namespace(output=output, html=path, words=(*words, "--html", path.name))
        write_surface_html(chosen, surface, draw(None, surface.segmentation, surface, settings, silent, kept=True))
    else:
        io.write_document(surface.report, path)


def _write_mesh(
    chosen: Namespace, surface: Surface, frame: io.Frame, settings: Settings, fits: bool | None
) -> io.Frame:
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
            precision=settings.run.precision, fits=fits,
        )  # fmt: skip
    return io.frame_in_file(output, **named)


def _tell_cavities(report: dict[str, Any], frame: io.Frame, in_file: io.Frame) -> None:
    """Add a place in each cavity to what was written, in the file's own numbers: holes for finite elements."""
    places = report.get("quality", {}).get("cavity_places_mm")
    if places:
        report["written"]["cavity_places"] = in_file.place(frame.place(np.array(places))).tolist()


def frame_asked(surface: Surface, output: str | Path, settings: Settings) -> io.Frame:
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
    from ...measure.fill import fill_mesh, overlap

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
    from ...pointcloud.attributes import carry

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
    progress: Progress,
    *,
    kept: bool = False,
) -> dict[str, bytes]:
    """Draw the paper's figures of whatever stages there are, into a folder where one is named; return those kept."""
    if folder is None and not kept:
        return {}
    from ...show.drawing.page import png
    from .pictures import pictures

    if folder is not None:
        make_folder(Path(folder))
    done, expected = 0, 10 if surface else 6
    found: dict[str, bytes] = {}
    for done, (name, page) in enumerate(pictures(stage_one, surface, settings), 1):
        progress("pictures", done - 1, max(expected, done))
        drawn = png(page)
        if folder is not None:
            with io.replacing(Path(folder) / f"{name}.png") as file:
                file.write(drawn)
        found |= {name: drawn} if kept else {}
    progress("pictures", done, done)
    return found


def draw_network(
    folder: Path, chosen: Namespace, trained: TrainedNetwork, settings: Settings, pixel_area: float
) -> None:
    """Draw a network over its region, and its training as a film where that was asked for."""
    from ...som.shapes import SHAPES
    from .pictures import film_of_network, pictures_of_network

    given = chosen.region in SHAPES
    title = f"A network over a {chosen.region if given else 'picture'}"
    axes = slice(None if given else 2)  # a neuron's place in a picture is its column and row
    for name, page in pictures_of_network(trained, title, axes):
        write_picture(page, folder / f"{name}.png")
    if chosen.film:
        with io.replacing(folder / "02-film.gif") as file:
            file.write(film_of_network(trained, settings, pixel_area, title, axes))


def write_picture(page: Page, path: Path) -> None:
    """Write a picture, whole or not at all."""
    from ...show import save

    with io.replacing(path) as file:
        save(page, file)
