"""Sizes and shapes of triangles, and the turns between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels.measure.shapes import edge_shapes, face_shapes, face_sizes
from ..kernels.threads import in_blocks
from .links import Links

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

    Floats = NDArray[np.float64]

BLOCK = 20_000
"""Faces or edges handled at once: some milliseconds."""


def areas_and_volumes(links: Links, *, threads: int = 0) -> tuple[Floats, Floats]:
    """Return the area of each face, and the signed volume between it and the mean vertex, both (m,).

    The sum of the volumes is the volume of a closed mesh.
    """
    vertices, faces = links.vertices, links.faces
    center = np.array([column.mean() for column in vertices.T]) if len(vertices) else np.zeros(3)
    areas, volumes = np.empty((2, len(faces)))

    def work(start: int, stop: int) -> None:
        face_sizes(vertices, faces, center, areas, volumes, start, stop)

    in_blocks(work, len(faces), block=BLOCK, threads=threads)
    return areas, volumes


def lengths_and_turns(links: Links, *, threads: int = 0) -> tuple[Floats, Floats]:
    """Return the length of each edge, and the angle between the normals beside it in radians, both (e,).

    The angle is 0 where there are not two faces.
    """
    order, first = links.edges
    lengths, turns = np.empty((2, len(first) - 1))

    def work(start: int, stop: int) -> None:
        edge_shapes(links.vertices, links.faces, order, first, lengths, turns, start, stop)

    in_blocks(work, len(lengths), block=BLOCK, threads=threads)
    return lengths, turns


def triangle_shapes(mesh: TriMesh, *, threads: int = 0) -> dict[str, float]:
    """Return edge lengths, angles and aspect of the faces of a mesh, and how it turns between them.

    See `shapes_of_edges` and `shapes_of_faces`.
    """
    links = Links(mesh)
    lengths, turns = lengths_and_turns(links, threads=threads)
    pairs = int((links.uses == 2).sum())
    return shapes_of_edges(lengths, turns, pairs) | shapes_of_faces(links, threads=threads)


def shapes_of_edges(lengths: Floats, turns: Floats, pairs: int) -> dict[str, float]:
    """Sum up edge lengths, each edge once, and the turns at the pairs of faces; these are 0 where there is none."""
    p5, median, p95 = np.percentile(lengths, [5, 50, 95])
    return {
        "shortest_edge_mm": float(lengths.min()),
        "p5_edge_mm": float(p5),
        "median_edge_mm": float(median),
        "p95_edge_mm": float(p95),
        "longest_edge_mm": float(lengths.max()),
        "mean_turn_deg": float(np.degrees(turns.sum() / max(pairs, 1))),
        "largest_turn_deg": float(np.degrees(turns.max())),
    }


def shapes_of_faces(links: Links, *, threads: int = 0) -> dict[str, float]:
    """Sum up the angles of the faces and their aspect.

    The aspect of a triangle is 4 sqrt(3) area over the sum of its squared sides: 1 where it is equilateral, 0
    where it is flat (Bank & Smith 1997).
    """
    smallest, largest, aspect = np.empty((3, len(links.faces)))

    def work(start: int, stop: int) -> None:
        face_shapes(links.vertices, links.faces, smallest, largest, aspect, start, stop)

    in_blocks(work, len(smallest), block=BLOCK, threads=threads)
    p1, p5, median = np.percentile(smallest, [1, 5, 50])
    return {
        "smallest_angle_deg": float(np.degrees(smallest.min())),
        "p1_smallest_angle_deg": float(np.degrees(p1)),
        "p5_smallest_angle_deg": float(np.degrees(p5)),
        "median_smallest_angle_deg": float(np.degrees(median)),
        "mean_smallest_angle_deg": float(np.degrees(smallest.mean())),
        "largest_angle_deg": float(np.degrees(largest.max())),
        "mean_aspect": float(aspect.mean()),
    }
