"""What is wrong or odd of a result, in words, the worst first, with its places in space."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..measure.links import Links
from ..measure.shape import areas_and_volumes
from ..measure.topology import FAULTS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

    Floats = NDArray[np.float64]

PROBLEM, WARNING, NOTE = "problem", "warning", "note"
"""How much it matters, the most first."""
MOST = 100
"""Places that are told of one kind, the largest first; all are counted. Chosen: more nobody looks at one by one."""
AROUND = re.compile(r"(?:gap of (\S+) )?around \(([^()]*)\)")
"""A place in the words of a warning or an error, and how wide the gap is around it."""
WORDS = {
    "boundary_edges": "edge(s) with a face on one side alone: the surface is open there",
    "nonmanifold_edges": "edge(s) where more than two faces meet",
    "nonmanifold_vertices": "vertex(es) where several sheets touch",
    "misoriented_edges": "edge(s) between faces that do not agree which side is outside",
    "inward_components": "piece(s) inside out",
}
"""Faults of `measure.topology`, in words."""


class Spot(NamedTuple):
    """A place (3,) in the numbers of the mesh, and how far what is there reaches from it."""

    place: tuple[float, float, float]
    radius: float = 0.0

    @property
    def words(self) -> str:
        """All four numbers, as a script takes them."""
        return " ".join(map(repr, (*self.place, self.radius)))


@dataclass(frozen=True)
class Problem:
    """Something that a user should know.

    Attributes
    ----------
    matters : str
        `PROBLEM`, `WARNING` or `NOTE`.
    text : str
    places : tuple of Spot
        Where, the largest first: `MOST` at most, and none where none is known.
    """

    matters: str
    text: str
    places: tuple[Spot, ...] = ()


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
        kept.setdefault((one.text, one.places), one)
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
        yield Problem(matters, text, () if links is None else _faults(links, name))


def _of_crossing(
    quality: Mapping[str, Any], report: Mapping[str, Any], mesh: TriMesh | None, crossing: NDArray[np.bool_] | None
) -> Iterator[Problem]:
    count = quality.get("self_intersections") or report.get("print", {}).get("self_intersections")
    if count:
        known = mesh is not None and crossing is not None and crossing.any()
        where = _pieces(mesh.only(crossing)) if known and mesh is not None and crossing is not None else ()
        yield Problem(PROBLEM, f"{count} face(s) pass through others", where)


def _of_print(told: Mapping[str, Any]) -> Iterator[Problem]:
    """Tell what keeps a part from being printed; each width at its place."""
    for matters, key in ((PROBLEM, "reasons"), (NOTE, "notes")):
        for text in told.get(key, ()):
            name = "wall" if "wall" in text else "gap" if "gap" in text else ""
            place = told.get(f"thinnest_{name}_at_mm")
            where = () if place is None else (Spot(_place(place), told.get(f"thinnest_{name}_mm") or 0.0),)
            yield Problem(matters, text, where)


def _of_rest(report: Mapping[str, Any]) -> Iterator[Problem]:
    yield from (Problem(WARNING, text, named_places(text)) for text in report.get("warnings", ()))
    against = report.get("against", {})
    notes = [*report.get("study", {}).get("notes", ()), *report.get("points", {}).get("notes", ())]
    yield from (Problem(NOTE, text) for text in [*notes, *against.get("notes", ())])


def _of_cavities(quality: Mapping[str, Any]) -> Iterator[Problem]:
    places = quality.get("cavity_places_mm")
    if places:
        text = "a cavity inside" if len(places) == 1 else f"{len(places)} cavities inside"
        yield Problem(NOTE, text, tuple(Spot(_place(place)) for place in places[:MOST]))


def named_places(line: str) -> tuple[Spot, ...]:
    """Return the places that a warning or an error names, as ``around (1, 2, 3)``.

    Examples
    --------
    >>> named_places("the outside leaks in, by a gap of 4 around (1, -2.5, 3e-2)")
    (Spot(place=(1.0, -2.5, 0.03), radius=2.0),)
    """
    found = [(float(width or 0) / 2, numbers.split(",")) for width, numbers in AROUND.findall(line)]
    return tuple(Spot(_place(numbers), radius) for radius, numbers in found if len(numbers) == 3)


def _faults(links: Links, name: str) -> tuple[Spot, ...]:
    """Return where a fault of `measure.topology` is: the middle and the reach of what hangs together."""
    if name == "inward_components":
        return _inward(links)
    if name == "nonmanifold_vertices":
        return tuple(Spot(_place(links.vertices[n])) for n in links.touching[:MOST].tolist())
    corners, (order, first) = links.faces.reshape(-1), links.edges
    found = {
        "boundary_edges": links.borders, "nonmanifold_edges": order[first[:-1][links.uses > 2]],
        "misoriented_edges": order[first[:-1][_disagree(links)]],
    }[name]  # fmt: skip
    return _groups(links.vertices, np.stack([corners[found], corners[_next(found)]], axis=1))


def _disagree(links: Links) -> NDArray[np.bool_]:
    """Tell of each edge whether it has two faces that both run through it in the same direction, (e,)."""
    corners, (order, first) = links.faces.reshape(-1), links.edges
    two = links.uses == 2
    one, other = (corners[order[first[:-1][two] + n]] for n in (0, 1))
    found = np.zeros(len(two), np.bool_)
    found[two] = one == other
    return found


def _inward(links: Links) -> tuple[Spot, ...]:
    """Return where the pieces without a border are that look inward."""
    volumes = areas_and_volumes(links)[1]
    turned = np.bincount(links.face_pieces, volumes, links.pieces) < 0
    turned[links.face_pieces[links.borders // 3]] = False
    return _groups(links.vertices, links.faces[turned[links.face_pieces]])


def _pieces(mesh: TriMesh) -> tuple[Spot, ...]:
    """Return the places of the pieces of a mesh, the one with the most faces first."""
    return _groups(mesh.vertices, mesh.faces)


def _next(half_edges: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the corner at which a half edge ends."""
    return np.asarray(half_edges - half_edges % 3 + (half_edges + 1) % 3)


def _groups(vertices: Floats, simplices: NDArray[Any]) -> tuple[Spot, ...]:
    """Return the middle and the reach of what hangs together over vertices, the largest first."""
    if not len(simplices):
        return ()
    links = Links(_Simplices(vertices, simplices[:, [0, 1, -1]]))
    piece, used = links.vertex_pieces, links.used
    count = np.bincount(links.face_pieces)
    low, high = np.full((2, len(count), 3), np.inf) * np.array([1, -1])[:, None, None]
    np.minimum.at(low, piece[used], vertices[used])
    np.maximum.at(high, piece[used], vertices[used])
    middles, reach = (low + high) / 2, np.sqrt(((high - low) ** 2).sum(axis=1)) / 2
    return tuple(Spot(_place(middles[n]), float(reach[n])) for n in np.argsort(-count, kind="stable")[:MOST])


@dataclass(frozen=True)
class _Simplices:
    """Edges or faces as `Links` take them: of an edge the last corner stands twice."""

    vertices: Floats
    faces: NDArray[Any]


def _place(place: Any) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in place)
    return x, y, z
