"""What is wrong or odd of a result, in words, the worst first, with its places in space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..measure.links import Links
from ..measure.topology import FAULTS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

    Floats = NDArray[np.float64]

PROBLEM, WARNING, NOTE = "problem", "warning", "note"
"""How much it matters, the most first."""
MOST = 8
"""Places that are told of one kind, the largest first; all are counted. Chosen: a list that is read at one sight."""
WORDS = {
    "boundary_edges": "edge(s) with a face on one side alone: the surface is open there",
    "nonmanifold_edges": "edge(s) where more than two faces meet",
    "nonmanifold_vertices": "vertex(es) where several sheets touch",
    "misoriented_edges": "edge(s) between faces that do not agree which side is outside",
    "inward_components": "piece(s) inside out",
}
"""Faults of `measure.topology`, in words."""


@dataclass(frozen=True)
class Problem:
    """Something that a user should know.

    Attributes
    ----------
    matters : str
        `PROBLEM`, `WARNING` or `NOTE`.
    text : str
    place : three floats, or None
        Where, in the numbers of the mesh.
    radius : float
        How far it reaches from there.
    """

    matters: str
    text: str
    place: tuple[float, float, float] | None = None
    radius: float = 0.0


def problems_of(
    report: Mapping[str, Any], mesh: TriMesh | None = None, crossing: NDArray[np.bool_] | None = None
) -> list[Problem]:
    """Find what a report tells of, and where it is.

    Parameters
    ----------
    report : mapping
        Of `Surface.report`, or what ``check --report`` or ``print --report`` write.
    mesh : TriMesh, optional
        Of which it tells: without it fewer places are known.
    crossing : (m,) bool array, optional
        Its faces that pass through others (`measure.intersections.self_intersections`).

    Returns
    -------
    list of Problem
        Problems first, then warnings, then notes; each in the order in which it was found.
    """
    quality = report.get("quality", report)
    sheet = report.get("way", {}).get("name") == "sheet"
    found = [*_of_data(report), *_of_topology(quality, mesh, sheet), *_of_crossing(quality, report, mesh, crossing)]
    found += [*_of_print(report.get("print", {})), *_of_rest(report), *_of_cavities(quality)]
    ranks = {matters: rank for rank, matters in enumerate((PROBLEM, WARNING, NOTE))}
    return sorted(_once(found), key=lambda one: ranks[one.matters])


def _once(found: list[Problem]) -> list[Problem]:
    """Leave out what was said already, at the same place."""
    kept = dict[object, Problem]()
    for one in found:
        kept.setdefault((one.text, one.place), one)
    return [*kept.values()]


def _of_data(report: Mapping[str, Any]) -> Iterator[Problem]:
    far = report.get("quality", {}).get("follows", {}).get("far")
    if far:
        yield Problem(PROBLEM, far)
    if report.get("fit", {}).get("converged") is False:
        yield Problem(WARNING, "the mesh is not at rest: more --iterations would move it on")


def _of_topology(quality: Mapping[str, Any], mesh: TriMesh | None, sheet: bool) -> Iterator[Problem]:
    links = None if mesh is None else Links(mesh)
    for name in FAULTS:
        if not quality.get(name):
            continue
        border = name == "boundary_edges"
        text, matters = f"{quality[name]} {WORDS[name]}", NOTE if border and sheet else PROBLEM
        where = [] if links is None else _borders(links) if border else _edges(links, name)
        yield from _at(matters, text, where)


def _of_crossing(
    quality: Mapping[str, Any], report: Mapping[str, Any], mesh: TriMesh | None, crossing: NDArray[np.bool_] | None
) -> Iterator[Problem]:
    count = quality.get("self_intersections") or report.get("print", {}).get("self_intersections")
    if count:
        known = mesh is not None and crossing is not None and crossing.any()
        where = _pieces(mesh.only(crossing)) if known and mesh is not None and crossing is not None else []
        yield from _at(PROBLEM, f"{count} face(s) pass through others", where)


def _of_print(told: Mapping[str, Any]) -> Iterator[Problem]:
    """Tell what keeps a part from being printed; each width at its place."""
    for matters, key in ((PROBLEM, "reasons"), (NOTE, "notes")):
        for text in told.get(key, ()):
            name = "wall" if "wall" in text else "gap" if "gap" in text else ""
            place = told.get(f"thinnest_{name}_at_mm")
            yield Problem(matters, text, _place(place), told.get(f"thinnest_{name}_mm") or 0.0)


def _of_rest(report: Mapping[str, Any]) -> Iterator[Problem]:
    yield from (Problem(WARNING, text) for text in report.get("warnings", ()))
    against = report.get("against", {})
    notes = [*report.get("study", {}).get("notes", ()), *report.get("points", {}).get("notes", ())]
    yield from (Problem(NOTE, text) for text in [*notes, *against.get("notes", ())])


def _of_cavities(quality: Mapping[str, Any]) -> Iterator[Problem]:
    places = quality.get("cavity_places_mm")
    if places:
        yield from _at(NOTE, "a cavity inside", [(_place(place), 0.0) for place in places])


def _at(matters: str, text: str, where: list[Any]) -> Iterator[Problem]:
    """Tell of one thing at several places."""
    if not where:
        yield Problem(matters, text)
    for number, (place, radius) in enumerate(where[:MOST], 1):
        each = f" ({number} of {len(where)} places)" if len(where) > 1 else ""
        yield Problem(matters, text + each, place, radius)


def _borders(links: Links) -> list[Any]:
    """Return the middle and the reach of each line of borders, the longest first."""
    corners = links.faces.reshape(-1)
    ends = np.stack([corners[links.borders], corners[_next(links.borders)]], axis=1)
    return _groups(links.vertices, ends)


def _edges(links: Links, name: str) -> list[Any]:
    """Return the places of edges that more than two faces share; of other faults none is known."""
    if name != "nonmanifold_edges":
        return []
    order, first = links.edges
    shared = order[first[:-1][links.uses > 2]]
    corners = links.faces.reshape(-1)
    return _groups(links.vertices, np.stack([corners[shared], corners[_next(shared)]], axis=1))


def _pieces(mesh: TriMesh) -> list[Any]:
    """Return the places of the pieces of a mesh, the one with the most faces first."""
    return _groups(mesh.vertices, mesh.faces)


def _next(half_edges: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the corner at which a half edge ends."""
    return np.asarray(half_edges - half_edges % 3 + (half_edges + 1) % 3)


def _groups(vertices: Floats, simplices: NDArray[Any]) -> list[Any]:
    """Return the middle and the reach of what hangs together over vertices, the largest first."""
    if not len(simplices):
        return []
    links = Links(_Simplices(vertices, simplices[:, [0, 1, -1]]))
    piece, used = links.vertex_pieces, links.used
    count = np.bincount(links.face_pieces)
    low, high = np.full((2, len(count), 3), np.inf) * np.array([1, -1])[:, None, None]
    np.minimum.at(low, piece[used], vertices[used])
    np.maximum.at(high, piece[used], vertices[used])
    middles, reach = (low + high) / 2, np.sqrt(((high - low) ** 2).sum(axis=1)) / 2
    return [(_place(middles[n]), float(reach[n])) for n in np.argsort(-count, kind="stable")]


@dataclass(frozen=True)
class _Simplices:
    """Edges or faces as `Links` take them: of an edge the last corner stands twice."""

    vertices: Floats
    faces: NDArray[Any]


def _place(place: Any) -> tuple[float, float, float] | None:
    if place is None:
        return None
    x, y, z = (float(value) for value in place)
    return x, y, z
