"""The quality of a mesh, and how far it is from points or from another mesh."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from ..model.points import PointSet
from ..progress import Progress, silent
from .components import Components
from .distance import distance_to_surface, spread_of
from .intersections import marked_in
from .links import Links
from .shape import MeshExtent, areas_and_volumes, lengths_and_turns, shapes_of_edges, shapes_of_faces, unfolded
from .topology import Topology, distinct_positions, topology, topology_of, welded
from .tree import Tree
from .winding import places_in_cavities, winding_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

    Floats = NDArray[np.float64]

SAMPLES = 20_000
"""Samples a surface for its distance to another. The standard error of their mean is 0.7 % of the spread."""
HUNDRED = 100
"""Parts of the progress that is told."""


def assess(
    mesh: TriMesh,
    *,
    points: PointSet | Floats | None = None,
    against: TriMesh | None = None,
    cavities: int = 0,
    crossing: NDArray[np.bool_] | None = None,
    threads: int = 0,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Measure a mesh.

    Parameters
    ----------
    mesh : TriMesh
        One face at least, and finite vertices; it may have borders.
    points : PointSet or (p, 3) float array, optional
        The points that the surface should pass through.
    against : TriMesh, optional
        A surface that it should equal.
    cavities : int
        Components that may face inward.
    crossing : (m,) bool array, optional
        The faces that pass through others, where they are known already.
    threads : int
        0 is one a core. The result does not depend on it.
    progress : callable
        Told how far the stage ``measure`` is, in percent; what it raises ends the work.

    Returns
    -------
    dict
        Counts, areas, volumes, triangle shapes and distances; each key names its unit (see docs/report.md).

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh import TriMesh, assess
    >>> corner = TriMesh(np.eye(4, 3, -1), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    >>> found = assess(corner)
    >>> found["closed"], found["genus"], round(6 * found["volume_mm3"], 9)
    (True, 0, 1.0)
    >>> assess(TriMesh(corner.vertices, corner.faces[:3]))["boundary_edges"]
    3
    """
    found, table = _of_surface(mesh, cavities, threads, progress)
    tree = Tree.of_faces(mesh, threads=threads)
    if crossing is None:
        crossing = marked_in(tree, threads=threads, progress=_part(progress, 15, 50))
    found["self_intersections"] = int(crossing.sum())
    table.add_crossing(crossing)
    if points is not None:
        points = points.positions if isinstance(points, PointSet) else points
        distances, nearest, back = _distances(mesh, tree, points, threads, progress)
        found |= spread_of(distances, "points_to_surface_") | spread_of(back, "vertices_to_points_")
        table.add_distances(distances, nearest)
    found["cavity_places_mm"] = _in_cavities(mesh, tree, cavities, threads).tolist() if found["closed"] else []
    found["per_component"] = table.rows()
    found["components_not_listed"] = found["components"] - len(found["per_component"])
    if against is not None:
        found |= compare(mesh, against, threads=threads)
    progress("measure", HUNDRED, HUNDRED)
    return found


def _of_surface(mesh: TriMesh, cavities: int, threads: int, progress: Progress) -> tuple[dict[str, Any], Components]:
    """Return what can be told of the faces and edges alone, and the table of components so far."""
    links = Links(mesh)
    areas, volumes = areas_and_volumes(links, threads=threads)
    found = _counted(mesh, topology_of(links, volumes, cavities=cavities), cavities)
    progress("measure", 5, HUNDRED)
    extent = MeshExtent.of(links)
    found["area_mm2"] = float(unfolded(extent.areas(areas))[0])
    found["volume_mm3"] = float(unfolded(extent.volumes(volumes))[0]) if found["closed"] else None
    lengths, turns = lengths_and_turns(links, threads=threads)
    found |= shapes_of_edges(lengths, turns, int((links.uses == 2).sum()))
    progress("measure", 10, HUNDRED)
    found |= shapes_of_faces(links, threads=threads)
    progress("measure", 15, HUNDRED)
    return found, Components(links, areas, volumes, lengths)


def _counted(mesh: TriMesh, counts: Topology, cavities: int) -> dict[str, Any]:
    """Return what was counted on a mesh, and whether it is sound, also after welding."""
    apart = distinct_positions(mesh, np.float32) == len(mesh.vertices)
    again = counts if apart else topology(welded(mesh), cavities=cavities)
    found: dict[str, Any] = {"vertices": len(mesh.vertices), "faces": len(mesh.faces), **asdict(counts)}
    return found | {
        "pieces": counts.components - cavities,
        "cavities": cavities,
        "closed": counts.boundary_edges == 0,
        "sound": counts.sound,
        "sound_after_welding": again.sound,
    }


def _in_cavities(mesh: TriMesh, tree: Tree, cavities: int, threads: int) -> Floats:
    """Return a place in each of so many cavities, (c, 3); pieces that face inward around nothing are none."""
    places = places_in_cavities(mesh, tree=tree, threads=threads) if cavities else np.empty((0, 3))
    if len(places) == cavities:
        return places
    return places[[abs(winding_number(mesh, place)) < 0.5 for place in places]]


def _distances(
    mesh: TriMesh, tree: Tree, points: Floats, threads: int, progress: Progress
) -> tuple[Floats, NDArray[np.int32], Floats]:
    """Return the distances of points to a mesh, the faces nearest to them, and the vertices' distances to points."""
    if len(points) == 0:
        return np.empty(0), np.empty(0, np.int32), np.empty(0)
    dots = Tree.of_points(points, threads=threads)
    there, face = tree.nearest(points, order=dots.order, threads=threads, progress=_part(progress, 50, 80))
    back, _ = dots.nearest(mesh.vertices, threads=threads, progress=_part(progress, 80, HUNDRED))
    return there, face, back


def _part(progress: Progress, start: int, stop: int) -> Progress:
    """Tell a part of the work as a part of the stage ``measure``, in percent."""
    return lambda _stage, done, total: progress("measure", start + (stop - start) * done // total, HUNDRED)


def compare(
    mesh: TriMesh, other: TriMesh, *, leave_out: NDArray[np.bool_] | None = None, threads: int = 0
) -> dict[str, float]:
    """Measure the distances between two surfaces, both ways.

    Parameters
    ----------
    mesh, other : TriMesh
    leave_out : (m,) bool array, optional
        Faces of `mesh` that are not sampled.
    threads : int
        0 is one a core.

    Returns
    -------
    dict
        Mean, percentiles and maximum from `mesh` to `other`, and, prefixed with ``back_``, from `other`.
    """
    there = distance_to_surface(area_samples(mesh, SAMPLES, leave_out=leave_out), other, threads=threads)
    back = distance_to_surface(area_samples(other, SAMPLES), mesh, threads=threads)
    return spread_of(there, "") | spread_of(back, "back_")


def area_samples(mesh: TriMesh, count: int = SAMPLES, *, leave_out: NDArray[np.bool_] | None = None) -> Floats:
    """Draw points uniformly by area from a mesh, (count, 3); the same points every time."""
    areas = areas_and_volumes(Links(mesh))[0]
    areas = areas if leave_out is None else np.where(leave_out, 0.0, areas)
    reached = np.cumsum(areas)
    if len(areas) == 0 or reached[-1] == 0:
        return np.empty((0, 3))
    shares, sides = drawn(count)
    face = np.searchsorted(reached, shares * reached[-1], side="right").clip(0, len(areas) - 1)
    return placed_on(mesh.vertices[mesh.faces[face]], sides)


def drawn(count: int) -> tuple[Floats, Floats]:
    """Draw at which shares of an area samples lie, (count,), and how far along two sides of their faces, (2, count, 1).

    The same ones every time.
    """
    rng = np.random.default_rng(0)
    shares, (u, v) = rng.random(count), rng.random((2, count, 1))
    over = u + v > 1
    return shares, np.stack([np.where(over, 1 - u, u), np.where(over, 1 - v, v)])


def placed_on(corners: Floats, sides: Floats) -> Floats:
    """Return the places (n, 3) that lie so far along two sides (2, n, 1) of faces with corners (n, 3, 3)."""
    a, b, c = (corners[:, n] for n in range(3))
    return np.asarray(a + sides[0] * (b - a) + sides[1] * (c - a))
