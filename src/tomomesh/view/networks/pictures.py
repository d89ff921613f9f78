"""What the page shows or saves of networks as pictures: the film, the maps of a sheet, the relief of a slice."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from starlette.responses import Response

from ...errors import UsageError
from ...progress import silent
from ...show.drawing.page import png
from ...show.film import film, film_slice
from ...show.maps import SHEETS, laid_flat, u_matrix
from ...show.relief import draw_relief
from ...som.fit import match
from ..routes import get
from .asked import course_of
from .selected import selected_of
from .trainers import head, plane_of, slice_of

if TYPE_CHECKING:
    from ..session import Session
    from .course import TrainingCourse


def _trained(session: Session) -> TrainingCourse:
    course = course_of(session)
    if course is None or not course.frames:
        raise UsageError("nothing has been trained yet", expected="Train first")
    return course


def save_film(session: Session) -> Response:
    """Hand out the training as an animated GIF."""
    course = _trained(session)
    frames = [one for one in course.frames if len(one.codebook) == len(course.frames[0].codebook)]
    graph, codebooks = course.network_of(frames[0]), [one.codebook for one in frames]
    stops = [0, *course.stops]
    unit = "epochs" if course.settings.network.training == "batch" else "presentations"
    said = [f"{stops[n]:,} {unit}" if n < len(stops) else "without strays" for n in range(len(frames))]
    notes = [f"{graph.name} of {len(graph)} neurons, {step if one.kind != 'spaced' else 'as handed on'}"
             for one, step in zip(frames, said, strict=True)]  # fmt: skip
    back = course.backdrop
    if back is None:
        gif = film(course.places, codebooks, graph, notes=notes, title=course.title)
    else:
        gif = film_slice(back.kept > 0, codebooks, graph, back.plane, notes=notes, title=course.title)
    return _download(gif, "image/gif", "training.gif")


def save_settings(session: Session) -> Response:
    """Hand out the settings of the last training, as ``--settings`` takes them."""
    import tomli_w

    text = tomli_w.dumps(_trained(session).settings.to_dict())
    return _download(text.encode(), "application/toml", "settings.toml")


def _download(data: bytes, kind: str, name: str) -> Response:
    return Response(data, media_type=kind, headers={"content-disposition": f'attachment; filename="{name}"'})


def maps(session: Session, n: int) -> dict[str, Any]:
    """Tell the U-matrix and the hits of a sheet of neurons at some frame."""
    course = _trained(session)
    frame = course.frames[n]
    graph = course.network_of(frame)
    if graph.name not in SHEETS:
        raise UsageError("the network has no U-matrix", found=f"topology = {graph.name}", expected=" | ".join(SHEETS))
    scale = np.asarray(course.scale)
    codebook = frame.codebook * scale
    centers, far = u_matrix(codebook, graph)
    winners, _ = match(codebook, course.inputs[:, : course.dimensions])
    return {
        "hexagonal": graph.name == "hexagonal", "unit": course.unit,
        "centers": centers.ravel().tolist(), "far": far.tolist(),
        "places": laid_flat(graph).ravel().tolist(), "hits": np.bincount(winners, minlength=len(graph)).tolist(),
    }  # fmt: skip


def relief(session: Session, k: str = "") -> Response:
    """Hand out a slice as a landscape (Fig. 3): of the study, or of the built-in head."""
    if k:
        kept = selected_of(session, silent)
        levels, plane = slice_of(kept.study, int(k)), plane_of(kept.study, kept.plane)
    else:
        back = head().backdrop
        levels, plane = back.gray, back.plane
    return Response(png(draw_relief(levels, plane)), media_type="image/png")


ROUTES = [
    get("/training.gif", save_film),
    get("/training.toml", save_settings),
    get("/api/training/maps/{n:int}", maps),
    get("/picture/relief", relief),
]
