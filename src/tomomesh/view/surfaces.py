"""The surface: made as the command line makes it, and shown stage by stage, beside what was measured of it."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from starlette.responses import Response

from ..errors import UsageError
from ..html.places import problems_of
from ..html.scene import PLAIN, Scene, scene_of_cubes, scene_of_mesh, scene_of_points, scene_of_quads
from ..html.three import three_js
from ..html.verdict import verdict_of
from ..measure.intersections import self_intersections
from ..measure.report import assess
from ..measure.section import section
from ..measure.winding import linings
from ..model.mesh import TriMesh
from ..model.volume import AXES
from ..pipeline import reconstruct, reconstruct_points
from ..results import Surface
from ..settings import Settings
from . import coloring
from .routes import get, levels, post

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from ..progress import Progress
    from .opened import Opened
    from .session import Session

WORK = "reconstruct"
MOST = 2_500_000
"""Faces that are drawn at most; of a larger mesh fewer are, and the page says so. Two million are drawn at 3 frames a
second without a graphics card."""
STAGES: dict[str, Callable[[Surface], Any]] = {
    "points": lambda surface: scene_of_points(surface.points.positions, most=MOST),
    "cubes": lambda surface: _cubes(surface),
    "cuberille": lambda surface: scene_of_quads(surface.cuberille),
    "triangulated": lambda surface: surface.cuberille.triangulated(),
    "smoothed": lambda surface: surface.smoothed,
    "fitted": lambda surface: surface.mesh,
}
"""The steps from points to a mesh, in their order, each as a scene or as the mesh that is drawn."""


def _cubes(surface: Surface) -> Scene:
    if surface.cubes is None:
        raise UsageError("this surface was made without cubes")
    return scene_of_cubes(surface.cubes)


def _reconstruct(session: Session, body: Any) -> dict[str, Any]:
    """Make the surface of what is looked at, with all that was chosen."""
    if session.opened.kind not in ("study", "points") or not session.opened.ready:
        raise UsageError("there is nothing to make a surface of", expected="a study or points that have been read")
    session.jobs.start(WORK, partial(_made, session))
    return session.state


def _made(session: Session, progress: Progress) -> dict[str, Any]:
    opened, choices = session.opened, session.choices.values
    settings = Settings().replace(**choices)
    if opened.points is not None:
        made = reconstruct_points(opened.points, settings, progress=progress, **choices)
    else:
        assert opened.volume is not None
        made = reconstruct(opened.volume, settings, labels=opened.chosen_labels(settings), progress=progress, **choices)
    progress("measure", 0, 1)
    quality = made.report["quality"]
    progress("measure", 1, 1)
    session.keep(WORK, made, choices)
    return {"faces": len(made.mesh.faces), "closed": quality.get("closed")}


def surface_of(session: Session) -> Surface:
    """Return the surface that was made last.

    Raises
    ------
    UsageError
        Where there is none yet.
    """
    if WORK not in session.made:
        raise UsageError("there is no surface yet", hint="Make the surface")
    found = session.made[WORK].value
    assert isinstance(found, Surface)
    return found


def mesh_of(session: Session) -> TriMesh:
    """Return the mesh that was opened, or that of the surface that was made last."""
    return surface_of(session).mesh if session.opened.mesh is None else session.opened.mesh


def _report(session: Session) -> dict[str, Any]:
    """Tell what was measured, and what of it a user should know first, with its places."""
    if session.opened.mesh is not None:
        found: dict[str, Any] = session.surveys.of("report", partial(_checked, session.opened))
        return found
    surface = surface_of(session)
    crossing = surface.crossing
    known = crossing is not None and len(crossing) == len(surface.mesh.faces)
    return _told(surface.report, surface.mesh, crossing if known else None)


def _checked(opened: Opened) -> dict[str, Any]:
    """Tell of a mesh that was opened: what its run has measured, or what `tomomesh check` does."""
    assert opened.mesh is not None
    report = opened.report or {"quality": assess(opened.mesh, cavities=linings(opened.mesh))}
    crosses = report.get("quality", report).get("self_intersections")
    return _told(report, opened.mesh, self_intersections(opened.mesh) if crosses else None)


def _told(report: Mapping[str, Any], mesh: TriMesh, crossing: NDArray[np.bool_] | None) -> dict[str, Any]:
    problems, verdict = problems_of(report, mesh, crossing), verdict_of(report)
    return {
        "report": report, "problems": [asdict(one) for one in problems],
        "verdict": {"state": verdict.state, "words": verdict.words},
    }  # fmt: skip


def _stages(session: Session) -> dict[str, Any]:
    """List the steps that there are of this surface, and how much is in each: quick, however long measuring takes."""
    opened = session.opened
    if opened.mesh is not None:
        points = [] if opened.points is None else [{"name": "points", "faces": len(opened.points)}]
        return {"stages": [*points, {"name": "fitted", "faces": len(opened.mesh.faces)}]}
    if WORK not in session.made and opened.points is not None:
        return {"stages": [{"name": "points", "faces": len(opened.points)}]}
    surface = surface_of(session)
    counts = {
        "points": len(surface.points),
        "cubes": 0 if surface.cubes is None else len(surface.cubes.keys), "cuberille": len(surface.cuberille.quads),
        "triangulated": 2 * len(surface.cuberille.quads), "smoothed": len(surface.smoothed.faces),
        "fitted": len(surface.mesh.faces),
    }  # fmt: skip
    if surface.smoothed is surface.mesh:
        del counts["smoothed"]
    if 12 * counts["cubes"] > MOST:
        del counts["cubes"]  # which cannot be decimated, and would be seen as a surface anyway
    return {"stages": [{"name": name, "faces": count} for name, count in counts.items() if count]}


def _mesh(session: Session, stage: str, color: str = "") -> Response:
    """Send a stage as the viewer reads it, with the numbers that color it."""
    opened = session.opened
    if opened.mesh is not None or (WORK not in session.made and stage == "points"):
        points = opened.points if stage == "points" else None
        shown: Any = mesh_of(session) if points is None else scene_of_points(points.positions, most=MOST)
    elif stage in STAGES:
        shown = STAGES[stage](surface_of(session))
    else:
        raise UsageError("there is no such stage", found=stage, expected=" | ".join(STAGES))
    if isinstance(shown, TriMesh):
        values = coloring.values_of(session, shown, color) if color and stage == "fitted" else {}
        shown = scene_of_mesh(shown, most=MOST, values=values)
    assert isinstance(shown, Scene)
    return Response(_framed(session, shown).packed(), media_type="application/octet-stream")


def _framed(session: Session, scene: Scene) -> Scene:
    """Name the ends of the axes: the patient's for a study and for what a run has left, else x, y and z."""
    if session.opened.kind in ("study", "run"):
        return scene
    place = session.made[WORK].value.place if WORK in session.made else None
    return replace(scene, axes=PLAIN, unit=scene.unit if place is None else place.unit)


def _color(session: Session, body: Any) -> dict[str, Any]:
    """Begin to measure what is to color the mesh, and tell whether that is known already."""
    mesh, name = mesh_of(session), str(body["color"])
    if coloring.is_measured(session, mesh, name):
        return {"ready": True}
    return {"ready": False, "job": session.jobs.start("color", partial(_colored, session, mesh, name)).number}


def _colored(session: Session, mesh: TriMesh, name: str, progress: Progress) -> dict[str, Any]:
    coloring.values_of(session, mesh, name, progress)
    return {"color": name}


def _outline(session: Session, plane: str, k: str) -> Response:
    """Send where the mesh cuts a slice: ends (s, 2, 2) of segments, in the slice's own columns and rows."""
    volume = session.opened.volume
    if volume is None:
        raise UsageError("there are no slices")
    axis = AXES.index(plane)
    across = [n for n in range(3) if n != axis]
    mesh = mesh_of(session)
    places = volume.to_indices(mesh.vertices)[:, [*across, axis]]
    return levels(section(mesh.moved(places), float(int(k))).astype(np.float32))


def _place(session: Session, plane: str, k: str) -> dict[str, Any]:
    """Tell where a slice lies: the normal of its plane, the way its numbers rise, and how far along that it is."""
    volume = session.opened.volume
    if volume is None:
        raise UsageError("there are no slices")
    axis = AXES.index(plane)
    index = np.eye(3)[axis] * int(k)
    one, other = (volume.affine[:3, n] for n in range(3) if n != axis)
    normal = np.cross(one, other)
    normal *= np.sign(normal @ volume.affine[:3, axis]) / np.linalg.norm(normal)
    place = volume.affine[:3, :3] @ index + volume.affine[:3, 3]
    return {"normal": normal.tolist(), "offset": float(normal @ place)}


def _three(session: Session) -> Response:
    return Response(three_js(), media_type="text/javascript; charset=utf-8")


ROUTES = [
    post("/api/reconstruct", _reconstruct),
    get("/api/stages", _stages),
    get("/api/report", _report),
    post("/api/color", _color),
    get("/mesh/{stage}", _mesh),
    get("/outline/{plane}/{k:int}", _outline),
    get("/api/place/{plane}/{k:int}", _place),
    get("/three.js", _three),
]
