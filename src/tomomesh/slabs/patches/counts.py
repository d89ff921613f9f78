"""What is counted on one patch by itself, and what of it must be seen beside the others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...kernels.measure.edges import join_borders, join_corners
from ...measure.links import Links
from ...measure.shape import areas_and_volumes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...measure.shape import MeshExtent
    from .patch import MeshPatch

    Floats = NDArray[np.float64]
    Counts = NDArray[np.int64]


@dataclass(frozen=True)
class Tally:
    """What is known of connected pieces, a row each.

    Attributes
    ----------
    lowest : (k,) int64 array
        The lowest number of their vertices.
    faces, vertices, edges, borders, loops : (k,) int64 array
        How many of each they have.
    areas, volumes : (k, FOLDS) float64 array
        Sums, folded.
    """

    lowest: Counts
    faces: Counts
    vertices: Counts
    edges: Counts
    borders: Counts
    loops: Counts
    areas: Floats
    volumes: Floats


@dataclass(frozen=True)
class Rim:
    """The faces of a patch that have a shared vertex.

    Attributes
    ----------
    faces : (d, 3) int64 array
        Numbers in the whole mesh.
    corners : (d, 3, 3) float64 array
        Positions.
    pieces : (d,) int32 array
        The connected piece of the patch that each belongs to.
    lines : (d, 3) int32 array
        Corners of the patch that stand for the line of borders at each corner, where there is one.
    bordered : (d, 3) bool array
        Whether there is.
    """

    faces: Counts
    corners: Floats
    pieces: NDArray[np.int32]
    lines: NDArray[np.int32]
    bordered: NDArray[np.bool_]


@dataclass(frozen=True)
class PatchCounts:
    """What a patch has away from shared vertices, whose neighborhoods are left to the whole.

    Attributes
    ----------
    table : Tally
        Of its pieces.
    fans, overused, misoriented : int
        Fans around vertices, edges with three faces or more, and edges that two faces run through in one direction.
    finite : bool
        Whether all its own vertices are.
    rim : Rim
    """

    table: Tally
    fans: int
    overused: int
    misoriented: int
    finite: bool
    rim: Rim


def counted(patch: MeshPatch, extent: MeshExtent) -> PatchCounts:
    """Count what no other patch has a part in."""
    links = Links(patch)
    corner = links.faces.reshape(-1)
    order, first = links.edges
    start, last = order[first[:-1]], order[first[1:] - 1]
    inner = inner_edges(patch, links)
    alone = start[inner & (links.uses == 1)]
    twice = inner & (links.uses == 2)
    fans = np.arange(len(corner), dtype=np.int32)
    join_corners(links.faces, order, first, fans)
    roots = np.flatnonzero(fans == np.arange(len(fans)))
    rim = np.flatnonzero(patch.beside)
    lines, loops = _borders(fans, alone, rim)
    return PatchCounts(
        _table(patch, links, extent, inner, alone, loops),
        int((~patch.shared[corner[roots]]).sum()),
        int((links.uses[inner] > 2).sum()),
        int((corner[start[twice]] == corner[last[twice]]).sum()),
        bool(np.isfinite(patch.kept).all()),
        Rim(
            patch.numbers[links.faces[rim]], links.vertices[links.faces[rim]], links.face_pieces[rim],
            lines[rim], np.isin(lines[rim], lines.reshape(-1)[alone]),
        ),
    )  # fmt: skip


def inner_edges(patch: MeshPatch, links: Links) -> NDArray[np.bool_]:
    """Tell which edges (e,) of a patch no other has a part in."""
    return ~at_marked(links, patch.shared)


def at_marked(links: Links, marked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which edges (e,) end at a vertex of those that are marked (v,)."""
    order, first = links.edges
    corner, start = links.faces.reshape(-1), order[first[:-1]]
    found: NDArray[np.bool_] = marked[corner[start]] | marked[corner[np.where(start % 3 == 2, start - 2, start + 1)]]
    return found


def _borders(
    fans: NDArray[np.int32], alone: NDArray[np.int32], rim: NDArray[np.intp]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Name the line of borders at each corner, (f, 3); return also the names of those that do not touch the rim."""
    lines = fans.copy()
    join_borders(alone, lines)
    return lines.reshape(-1, 3), np.setdiff1d(lines[alone], lines.reshape(-1, 3)[rim])


def _table(
    patch: MeshPatch, links: Links, extent: MeshExtent, inner: NDArray[np.bool_], alone: NDArray[np.int32],
    loops: NDArray[np.int32],
) -> Tally:  # fmt: skip
    count, piece = links.pieces, links.face_pieces

    def number(pieces: NDArray[np.int32]) -> Counts:
        return np.bincount(pieces, minlength=count).astype(np.int64)

    used, lowest = links.used, np.full(count, np.iinfo(np.int64).max)
    np.minimum.at(lowest, links.vertex_pieces[used], patch.numbers[used])
    areas, volumes = areas_and_volumes(links, extent)
    return Tally(
        lowest, number(piece), number(links.vertex_pieces[used & ~patch.shared]), number(links.edge_pieces[inner]),
        number(piece[alone // 3]), number(piece[loops // 3]),
        extent.areas(areas, piece, count), extent.volumes(volumes, piece, count),
    )  # fmt: skip
