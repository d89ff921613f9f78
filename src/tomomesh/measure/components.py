"""What is measured of each connected piece of a mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .shape import MeshExtent, unfolded

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .links import Links

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]

LISTED = 100
"""Components that are listed at most, so that a report stays readable."""


class Components:
    """The table of the components of a mesh in the making, that of the largest area first; `LISTED` at most.

    See docs/report.md for the columns.
    """

    def __init__(self, links: Links, areas: Floats, volumes: Floats, lengths: Floats) -> None:
        """Start with what the adjacency, areas (m,), volumes (m,) and edge lengths (e,) tell."""
        self._piece, self._count = links.face_pieces, links.pieces
        extent = MeshExtent.of(links)
        total, enclosed = (
            unfolded(sums(values, self._piece, self._count))
            for sums, values in ((extent.areas, areas), (extent.volumes, volumes))
        )
        self._largest = np.argsort(-total, kind="stable")[:LISTED]
        self._columns: dict[str, list[Any]] = {
            "faces": self._faces()[self._largest].tolist(),
            "area_mm2": total[self._largest].tolist(),
        }
        self._add_topology(links, enclosed[self._largest].tolist())
        self._add_edges(self._grouped(lengths, links.edge_pieces))

    def add_crossing(self, crossing: NDArray[np.bool_]) -> None:
        """Count the faces of each component that pass through others, given those of all, (m,)."""
        count = np.bincount(self._piece[crossing], minlength=self._count)
        self._columns["self_intersections"] = count[self._largest].tolist()

    def add_distances(self, distances: Floats, nearest: Ints) -> None:
        """Sum up the distances of points (p,) at the component that holds the nearest face of each, (p,)."""
        near = self._grouped(distances, self._piece[nearest])
        self._columns["points"] = [len(own) for own in near]
        self._columns["points_to_surface_mean_mm"] = [float(own.mean()) if len(own) else None for own in near]
        p95 = [float(np.percentile(own, 95)) if len(own) else None for own in near]
        self._columns["points_to_surface_p95_mm"] = p95

    def rows(self) -> list[dict[str, Any]]:
        """Return one dictionary a component."""
        return [dict(zip(self._columns, row, strict=True)) for row in zip(*self._columns.values(), strict=True)]

    def _add_topology(self, links: Links, volumes: list[float]) -> None:
        """Add volume, genus and borders; a component with a border has no volume."""
        borders = np.bincount(self._piece[links.borders // 3], minlength=self._count)[self._largest]
        loops = np.bincount(self._piece[links.fans_and_loops[1] // 3], minlength=self._count)
        vertices = np.bincount(links.vertex_pieces[links.used], minlength=self._count)
        euler = vertices - np.bincount(links.edge_pieces, minlength=self._count) + self._faces()
        self._columns["volume_mm3"] = [None if b else v for b, v in zip(borders, volumes, strict=True)]
        self._columns["genus"] = (1 - (euler + loops) // 2)[self._largest].tolist()
        self._columns["boundary_edges"] = borders.tolist()
        self._columns["boundary_loops"] = loops[self._largest].tolist()

    def _add_edges(self, lengths: list[Floats]) -> None:
        self._columns["shortest_edge_mm"] = [float(own.min()) for own in lengths]
        self._columns["median_edge_mm"] = [float(np.median(own)) for own in lengths]
        self._columns["longest_edge_mm"] = [float(own.max()) for own in lengths]

    def _faces(self) -> NDArray[np.int64]:
        """Count the faces of each component."""
        return np.bincount(self._piece, minlength=self._count)

    def _grouped(self, values: Floats, piece: Ints) -> list[Floats]:
        """Return the values that belong to each of the largest components."""
        if self._count == 1:
            return [values]
        order = np.argsort(piece, kind="stable")
        begin, end = (np.searchsorted(piece[order], self._largest, side=side) for side in ("left", "right"))
        return [values[order[b:e]] for b, e in zip(begin, end, strict=True)]
