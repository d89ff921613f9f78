"""One side of the two-walled shell of an open surface, and its cut along the borders of the samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..errors import GeometryError
from .drape import Ring
from .search import Index

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .borders import Borders
    from .samples import Samples

    Floats = NDArray[np.float64]

APRON = 0.7
"""How far a sheet is carried on beyond its borders, in the radius of the disks there."""
TIP = 0.8
"""Share of the apron from which what lies there is cut away, so that the two walls come apart."""
DENSE = 0.5
"""Distance of the places on the apron, cube edges."""
CRUMB = 0.01
"""Share of the squares under which a piece of the walls is left out."""
WIDE = 1.5
"""Edge of the plots of samples that tell whether two pieces of the walls are sides of the same sheet, cube edges."""
SAME = 0.5
"""Share of its plots that a piece has in common with its other side."""
BOTH = 0.25
"""Share of the plots that a piece sees from both sides where the sides are not apart."""
HOLLOW = 0.01
"""Volume under a sheet, over the power 3/2 of its area, from which it has an outside."""


class SheetRing(Ring):
    """The neighbors of each vertex of a sheet: those on a border have neighbors along it alone."""

    def __init__(self, quads: NDArray[np.int32], count: int, threads: int = 0) -> None:
        self.quads, self.threads = quads, threads
        sides = np.sort(quads[:, [0, 1, 1, 2, 2, 3, 3, 0]].reshape(-1, 2), axis=1)
        edges, uses = np.unique(sides, axis=0, return_counts=True)
        rim = np.zeros(count, bool)
        rim[edges[uses == 1]] = True
        inner = np.concatenate([edges, edges[:, ::-1]])
        inner = inner[(np.tile(uses, 2) == 1) | ~rim[inner[:, 0]]]
        inner = inner[np.lexsort(inner.T[::-1])]
        self.start = np.concatenate([[0], np.cumsum(np.bincount(inner[:, 0], minlength=count))])
        self.neighbors = np.ascontiguousarray(inner[:, 1], np.int32)


@dataclass(frozen=True)
class Side:
    """What is kept of the walls: one side of each sheet.

    Attributes
    ----------
    vertices : (n,) bool array
    quads : (q,) bool array
    ring : SheetRing
        Of the kept squares, over the kept vertices.
    """

    vertices: NDArray[np.bool_]
    quads: NDArray[np.bool_]
    ring: SheetRing

    @classmethod
    def of(cls, ring, vertices, quads):
        quads = quads & vertices[ring.quads].all(axis=1)
        used = np.zeros(len(vertices), bool)
        used[ring.quads[quads]] = True
        number = np.cumsum(used, dtype=np.int32) - np.int32(1)
        return cls(used, quads, SheetRing(number[ring.quads[quads]], int(used.sum()), ring.threads))


def apron(borders: Borders, edge: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Return places (a, 3) that carry a sheet on beyond its borders, and which are at the outer end."""
    places, beyond = borders.apron(APRON, DENSE * edge)
    return places, beyond >= TIP


def one_side(vertices: Floats, ring: Ring, samples: Samples, borders: Borders, edge: float) -> Side | None:
    """Keep one side of the two-walled shell of each sheet.

    Returns
    -------
    Side or None
        None where both sides of a sheet are one piece.
    """
    places, tips = apron(borders, edge)
    _, near = cKDTree(np.concatenate([samples.positions, places])).query(vertices)
    on_apron = near >= len(samples.positions)
    cut = np.append(np.zeros(len(samples.positions), bool), tips)[near]
    quads = ring.quads[~cut[ring.quads].any(axis=1)]
    pieces = _pieces(quads, len(vertices))
    own = np.flatnonzero((pieces >= 0) & ~on_apron)
    facing = (ring.normals(vertices)[own] * samples.normals[near[own]]).sum(axis=1) > 0
    kept = _kept(pieces[own], _plots(samples, WIDE * edge)[near[own]], facing, _outward(vertices, quads, pieces))
    return None if kept is None else Side.of(ring, np.isin(pieces, kept) , ~cut[ring.quads].any(axis=1))


def _plots(samples: Samples, edge: float) -> NDArray[np.int64]:
    """Return the number of the cube of an edge that holds each sample, (p,)."""
    index = Index.of(samples.positions, edge)
    plots = np.empty(len(index.order), np.int64)
    plots[index.order] = np.repeat(np.arange(len(index.groups) - 1), np.diff(index.groups))
    return plots


def _pieces(quads: NDArray[np.int32], count: int) -> NDArray[np.int64]:
    """Return the connected piece of each vertex, (n,), -1 where it has no square, the largest first."""
    pairs = quads[:, [0, 1, 1, 2, 2, 3]].reshape(-1, 2)
    links = sparse.coo_array((np.ones(len(pairs), bool), pairs.T), shape=(count, count))
    _, label = connected_components(links, directed=False)
    size = np.bincount(label[quads[:, 0]], minlength=label.max() + 1)
    order = np.argsort(-size, kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return np.where(size[label] >= max(CRUMB * len(quads), 1), rank[label], -1)


def _kept(pieces, plots, facing, outward):
    """Return the pieces that are kept; None where one is both sides of a sheet."""
    shape = (len(outward), int(plots.max()) + 1)
    behind, before = (
        sparse.coo_array((np.ones(int(way.sum()), np.int64), (pieces[way], plots[way])), shape=shape).tocsr().sign()
        for way in (~facing, facing)
    )
    over = (behind + before).sign()
    size = over.sum(axis=1)
    print("both",behind.multiply(before).sum(axis=1)[:4],size[:4])
    if (behind.multiply(before).sum(axis=1) > BOTH * size).any():
        return None
    shared, kept = (over @ over.T).toarray(), []
    for piece in sorted(range(len(outward)), key=lambda p: (not outward[p], p)):
        if all(shared[piece, other] <= SAME * min(size[piece], size[other]) for other in kept):
            kept.append(piece)
    return kept


def _outward(vertices, quads, pieces):
    """Tell which pieces face outward: away from what they enclose, or in the direction of the largest axis."""
    a, b, c, d = (vertices[corner] for corner in quads.T)
    areas, middle = 0.5 * np.cross(c - a, d - b), 0.25 * (a + b + c + d)
    piece = pieces[quads[:, 0]]
    result = np.zeros(int(pieces.max()) + 1, bool)
    for n in range(len(result)):
        area = areas[piece == n]
        size = np.sqrt((area**2).sum(axis=1)).sum()
        where = middle[piece == n]
        volume = ((where - where.mean(axis=0)) * area).sum() / 3
        whole = area.sum(axis=0)
        axis = np.argmax(np.abs(whole))
        result[n] = volume > 0 if abs(volume) > HOLLOW * size**1.5 else whole[axis] > 0
    return result
