"""What is measured of each connected piece of a mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .links import Links

    Floats = NDArray[np.float64]

LISTED = 100
"""Components that are listed at most."""


@dataclass(frozen=True)
class Measures:
    """What was measured of the faces and edges of a mesh, and of points near it.

    Attributes
    ----------
    areas, volumes : (m,) float arrays
    crossing : (m,) bool array
        Faces that pass through others.
    lengths : (e,) float array
        Edges, in the order of the adjacency.
    distances : (p,) float array, optional
        Of points to the mesh.
    nearest : (p,) int array, optional
        The faces nearest to them.
    """

    areas: Floats
    volumes: Floats
    crossing: NDArray[np.bool_]
    lengths: Floats
    distances: Floats | None = None
    nearest: NDArray[np.int32] | None = None


def per_component(links: Links, measures: Measures) -> list[dict[str, Any]]:
    """Return what was measured of each component, that of the largest area first, `LISTED` at most.

    See docs/report.md for the keys.
    """
    piece = links.face_pieces
    areas = _sums(piece, links, measures.areas)
    largest = np.argsort(-areas, kind="stable")[:LISTED]
    columns: dict[str, list[Any]] = {
        "faces": _sums(piece, links)[largest].tolist(),
        "area_mm2": areas[largest].tolist(),
        **_borders(links, _sums(piece, links, measures.volumes), largest),
        "self_intersections": _sums(piece[measures.crossing], links)[largest].tolist(),
    }
    lengths = _grouped(measures.lengths, piece[links.edge_faces], largest)
    columns["shortest_edge_mm"] = [float(own.min()) for own in lengths]
    columns["median_edge_mm"] = [float(np.median(own)) for own in lengths]
    columns["longest_edge_mm"] = [float(own.max()) for own in lengths]
    if measures.distances is not None and measures.nearest is not None:
        near = _grouped(measures.distances, piece[measures.nearest], largest)
        columns["points"] = [len(own) for own in near]
        columns["points_to_surface_mean_mm"] = [float(own.mean()) if len(own) else None for own in near]
        columns["points_to_surface_p95_mm"] = [float(np.percentile(own, 95)) if len(own) else None for own in near]
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _borders(links: Links, volumes: Floats, largest: NDArray[np.intp]) -> dict[str, list[Any]]:
    """Return volume, genus and borders of the largest components; one with a border has no volume."""
    edges = _sums(links.face_pieces[links.borders // 3], links)
    loops = _sums(links.face_pieces[links.loops // 3], links)
    euler = (
        _sums(links.vertex_pieces[links.used], links)
        - _sums(links.face_pieces[links.edge_faces], links)
        + _sums(links.face_pieces, links)
    )
    genus = 1 - (euler + loops) // 2
    return {
        "volume_mm3": [None if edges[c] else float(volumes[c]) for c in largest],
        "genus": genus[largest].astype(int).tolist(),
        "boundary_edges": edges[largest].tolist(),
        "boundary_loops": loops[largest].tolist(),
    }


def _sums(piece: NDArray[np.int32], links: Links, weights: Floats | None = None) -> NDArray[Any]:
    """Count, or add up, what belongs to each component."""
    return np.bincount(piece, weights, links.pieces)


def _grouped(values: Floats, piece: NDArray[np.int32], chosen: NDArray[np.intp]) -> list[Floats]:
    """Return the values that belong to each of some components."""
    if len(chosen) == 1 and not piece.any():
        return [values]
    order = np.argsort(piece, kind="stable")
    begin = np.searchsorted(piece[order], chosen, side="left")
    end = np.searchsorted(piece[order], chosen, side="right")
    return [values[order[b:e]] for b, e in zip(begin, end, strict=True)]
