"""Gather what a result's HTML file tells, and write it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import io
from ...errors import printable
from ...html.document import MOST, Contents, document
from ...html.histogram import Histogram
from ...html.places import problems_of
from ...html.scene import PATIENT, PLAIN, Values, scene_of_mesh
from ...measure.intersections import self_intersections
from ...measure.tree import Tree
from ...segmentation.slabwise.levels import levels_of
from ...segmentation.survey import drawn_from
from .. import summary

if TYPE_CHECKING:
    from argparse import Namespace
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from ...model.mesh import TriMesh
    from ...results import Segmentation, Surface

BARS = 120
"""Bars of the histogram: six pixels each. Only the drawing depends on it."""


def command_of(chosen: Namespace) -> str:
    """Return the command as it was typed."""
    return printable(shlex.join(["tomomesh", *getattr(chosen, "words", ())]))


def write_surface_html(chosen: Namespace, surface: Surface, pictures: Mapping[str, bytes]) -> None:
    """Write a surface's file."""
    report, part, place = surface.report, surface.part, surface.place
    mesh = surface.mesh if part is None else part.mesh
    unit = "mm" if part is not None or place is None else place.unit
    values = _values(surface, unit) if part is None else {}
    _write(
        chosen, report, mesh, summary.of_surface(report, _name(chosen)), {**pictures, **_film(surface)},
        scene=scene_of_mesh(mesh, most=MOST, values=values, unit=unit, axes=PATIENT if place is None else PLAIN),
        crossing=surface.crossing if part is None else None, histogram=_histogram(surface.segmentation),
        frame=_frame(surface),
    )  # fmt: skip


def write_mesh_html(
    chosen: Namespace, report: Mapping[str, Any], mesh: TriMesh, said: Sequence[str], *, unit: str, frame: str
) -> None:
    """Write the file of a mesh by itself."""
    patient = PATIENT if frame.lower() == "lps" else PLAIN
    scene = scene_of_mesh(mesh, most=MOST, unit=unit, axes=patient)
    words = f"{'of an unknown unit' if unit == 'unknown' else unit}, as in the file"
    _write(chosen, report, mesh, said, _pictures_of(mesh, unit, patient), scene=scene, frame=words)


def _write(
    chosen: Namespace, report: Mapping[str, Any], mesh: TriMesh, said: Sequence[str], pictures: Mapping[str, bytes],
    *, crossing: NDArray[np.bool_] | None = None, **told: Any,
) -> None:  # fmt: skip
    count = report.get("quality", report).get("self_intersections") or report.get("print", {}).get("self_intersections")
    if count and crossing is None:
        crossing = self_intersections(mesh)
    contents = Contents(
        title=printable(_name(chosen)), report=report, summary=[printable(line) for line in said],
        command=command_of(chosen), problems=problems_of(report, mesh, crossing), pictures=pictures, **told,
    )  # fmt: skip
    write_page(document(contents), chosen.html)


def _name(chosen: Namespace) -> str:
    """Name the result, without its folder."""
    return getattr(chosen, "shown", None) or Path(getattr(chosen, "output", None) or chosen.mesh).name


def write_page(text: str, path: str | Path) -> None:
    """Write a page, whole or not at all."""
    with io.replacing(path) as file:
        file.write(text.encode())


def _values(surface: Surface, unit: str) -> dict[str, Values]:
    """Return what the mesh is colored by: how far its vertices are from what it was made from, what was filled."""
    rests_on = surface.points.positions if surface.rests_on is None else surface.rests_on
    found = {}
    if len(rests_on):
        distances, _ = Tree.of_points(rests_on).nearest(surface.mesh.vertices)
        found["distance"] = Values(distances, "distance to the nearest point", unit)
    filled = surface.cap_faces if surface.filled is None else surface.cap_faces | surface.filled
    if filled.any():
        at = np.zeros(len(surface.mesh.vertices))
        at[surface.mesh.faces[filled]] = 1.0
        found["filled"] = Values(at, "filled, not measured")
    return found


def _film(surface: Surface) -> dict[str, bytes]:
    """Draw key frames of the training of one slice's network, where slices have one."""
    from ...show.drawing.page import png
    from .pictures import key_frames

    page = key_frames(surface.segmentation) if surface.segmentation is not None else None
    return {} if page is None else {"02-film": png(page)}


def _histogram(found: Segmentation[Any] | None) -> Histogram | None:
    """Return the histogram of a gray study whose window is one of levels."""
    if found is None or found.volume.layers > 1 or not found.volume.voxels.size:
        return None
    window = found.report["window"]
    if window["chosen_by"] == "labels":
        return None
    measured = levels_of(found.volume.voxels)
    low, high = drawn_from(measured)
    if not high > low:
        return None
    unit = found.volume.unit if found.volume.unit != "stored" else ""
    return Histogram(measured.histogram(low, high, BARS).tolist(), low, high, window["lower"], window["upper"], unit)


def _frame(surface: Surface) -> str:
    if surface.part is not None:
        return "millimeters of the part to print"
    if surface.place is not None:
        return surface.place.words
    return "millimeters of the patient (LPS: to the left, to the back, up)"


def _pictures_of(mesh: TriMesh, unit: str, axes: tuple[tuple[str, str], ...]) -> dict[str, bytes]:
    """Draw a mesh that came without its history."""
    from ...show import draw_all
    from ...show.drawing.page import png
    from ...show.render import View

    view = View() if axes is PATIENT else View(unit=unit, axes=("x", "y", "z"))
    return {name: png(page) for name, page in draw_all(mesh=mesh, view=view)}
