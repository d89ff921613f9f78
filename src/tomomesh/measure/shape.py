"""Sizes and shapes of triangles, and the turns between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.measure.shapes import edge_shapes, face_shapes, face_sizes
from ..kernels.measure.sums import add_folds
from ..kernels.threads import in_blocks
from ..model.columns import box
from .links import Links

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

    Ints = NDArray[np.int32]
    Floats = NDArray[np.float64]

BLOCK = 20_000
"""Faces or edges handled at once: some milliseconds."""


FOLDS = 4
"""Numbers that a sum is kept in. Derived: of 2^31 faces, in a box 2^15 times as wide as one of them, they keep 53 bits
of what a face adds, and of fewer faces more."""
MOST_TURN, MOST_ANGLE, MOST_ASPECT = 4.0, 2.0, 2.0
"""What a turn, the smallest angle of a triangle, and an aspect stay below: pi, pi / 3 and 1, and room for rounding."""

EDGE_PARTS, ANGLE_PARTS = (0, 5, 50, 95, 100), (0, 1, 5, 50)
"""Percentiles of the lengths of edges and of the smallest angles of faces that are told."""


@dataclass(frozen=True)
class MeshExtent:
    """The box around a mesh and the number of its faces: what bounds the sums over these.

    Attributes
    ----------
    low, high : (3,) float array
    faces : int
    """

    low: Floats
    high: Floats
    faces: int

    @classmethod
    def of(cls, links: Links) -> MeshExtent:
        """Return that of a whole mesh; without vertices it is a point."""
        low, high = box(links.vertices) if len(links.vertices) else (np.zeros(3), np.zeros(3))
        return cls(low, high, len(links.faces))

    @property
    def middle(self) -> Floats:
        """The middle of the box, (3,)."""
        return 0.5 * (self.low + self.high)

    def areas(self, areas: Floats, groups: Ints | None = None, count: int = 1) -> Floats:
        """Return the sums of areas (m,) of some of the faces, `folded`."""
        return folded(areas, 0.5 * self._diagonal**2, self.faces, groups, count)

    def volumes(self, volumes: Floats, groups: Ints | None = None, count: int = 1) -> Floats:
        """Return the sums of volumes (m,) between some of the faces and the middle, `folded`."""
        return folded(volumes, self._diagonal**3 / 12, self.faces, groups, count)

    @property
    def _diagonal(self) -> float:
        return float(np.sqrt(((self.high - self.low) ** 2).sum()))


def folded(values: Floats, bound: float, total: int, groups: Ints | None = None, count: int = 1) -> Floats:
    """Return sums that no order and no parting changes, as several numbers each: those of parts are just added.

    Every value is cut, the same way in every part, into pieces so few bits long that adding them never rounds
    (Demmel & Nguyen 2015, Parallel reproducible summation).

    Parameters
    ----------
    values : (m,) float array
        Those of a part.
    bound : float
        What none of all values exceeds, either way.
    total : int
        At least as many as there are values in all parts.
    groups : (m,) int32 array, optional
        The sum to which each belongs, of `count`.

    Returns
    -------
    (count, FOLDS) float array
    """
    many = max(int(total), 2)
    with np.errstate(over="ignore"):
        top = np.ceil(np.log2(max(bound, 1e-300))) + np.ceil(np.log2(many))
        tops = 1.5 * 2.0 ** (top - np.arange(FOLDS) * (53 - np.ceil(np.log2(many))))
    sums = np.zeros((count, FOLDS))
    if len(values):
        add_folds(np.ascontiguousarray(values), np.zeros(1, np.int32) if groups is None else groups, tops, sums)
    return sums


def unfolded(sums: Floats) -> Floats:
    """Return the numbers (count,) that sums (count, FOLDS) are, the smallest parts added first."""
    total = np.zeros(len(sums))
    for column in sums.T[::-1]:
        total = total + column
    return total


def mean_of(values: Floats, bound: float) -> float:
    """Return the mean of values (m,), which no order of them changes; 0 of none."""
    return float(unfolded(folded(values, bound, len(values)))[0] / max(len(values), 1))


def areas_and_volumes(links: Links, extent: MeshExtent | None = None, *, threads: int = 0) -> tuple[Floats, Floats]:
    """Return the area of each face, and the signed volume between it and the middle of the box, both (m,).

    The sum of the volumes is the volume of a closed mesh. The box is that of the whole where this is a part of it.
    """
    vertices, faces = links.vertices, links.faces
    center = (extent or MeshExtent.of(links)).middle
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
    turned = unfolded(folded(turns, MOST_TURN, len(turns)))[0]
    return told_of_edges(np.percentile(lengths, EDGE_PARTS), turned / max(pairs, 1), turns.max())


def told_of_edges(lengths: Floats, mean_turn: float, largest_turn: float) -> dict[str, float]:
    """Name the percentiles (5,) of edge lengths at `EDGE_PARTS`, and the turns, which are in radians."""
    names = ("shortest_edge_mm", "p5_edge_mm", "median_edge_mm", "p95_edge_mm", "longest_edge_mm")
    return {
        **dict(zip(names, lengths.tolist(), strict=True)),
        "mean_turn_deg": float(np.degrees(mean_turn)),
        "largest_turn_deg": float(np.degrees(largest_turn)),
    }


def shapes_of_faces(links: Links, *, threads: int = 0) -> dict[str, float]:
    """Sum up the angles of the faces and their aspect."""
    smallest, largest, aspect = angles_and_aspects(links, threads=threads)
    means = [mean_of(smallest, MOST_ANGLE), mean_of(aspect, MOST_ASPECT)]
    return told_of_faces(np.percentile(smallest, ANGLE_PARTS), largest.max(), *means)


def angles_and_aspects(links: Links, *, threads: int = 0) -> tuple[Floats, Floats, Floats]:
    """Return the smallest and the largest angle of each face in radians, and its aspect, all (m,).

    The aspect of a triangle is 4 sqrt(3) area over the sum of its squared sides: 1 where it is equilateral, 0
    where it is flat (Bank & Smith 1997).
    """
    smallest, largest, aspect = np.empty((3, len(links.faces)))

    def work(start: int, stop: int) -> None:
        face_shapes(links.vertices, links.faces, smallest, largest, aspect, start, stop)

    in_blocks(work, len(smallest), block=BLOCK, threads=threads)
    return smallest, largest, aspect


def told_of_faces(smallest: Floats, largest: float, mean_smallest: float, mean_aspect: float) -> dict[str, float]:
    """Name the percentiles (4,) of the smallest angles at `ANGLE_PARTS`, and the other measures; all in radians."""
    names = ("smallest_angle_deg", "p1_smallest_angle_deg", "p5_smallest_angle_deg", "median_smallest_angle_deg")
    return {
        **dict(zip(names, np.degrees(smallest).tolist(), strict=True)),
        "mean_smallest_angle_deg": float(np.degrees(mean_smallest)),
        "largest_angle_deg": float(np.degrees(largest)),
        "mean_aspect": float(mean_aspect),
    }
