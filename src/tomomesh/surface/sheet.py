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
SAME = 0.5
"""Share of a piece's samples over which another piece is its other side, or it is both sides itself."""
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


def apron(borders: Borders, edge: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Return places (a, 3) that carry a sheet on beyond its borders, and which are at the outer end."""
    places, beyond = borders.apron(APRON, DENSE * edge)
    return places, beyond >= TIP


def one_side(vertices: Floats, ring: Ring, samples: Samples, borders: Borders, edge: float) -> Side:
    """Keep one side of the two-walled shell of each sheet."""
    places, tips = apron(borders, edge)
    ground = np.concatenate([samples.positions, places])
    facing = np.concatenate([samples.normals, np.repeat(borders.samples[:, 3:6], len(places) // max(len(borders.radii), 1), axis=0)])
    _, near = cKDTree(ground).query(vertices)
    tip = np.append(np.zeros(len(samples.positions), bool), tips)[near][ring.quads].any(axis=1)
    normals = ring.normals(vertices)
    seen = _Seen(near, (normals * facing[near]).sum(axis=1) > 0)
    turned = seen.turned(ring.quads, facing[near])
    close = np.isfinite(borders.depths(vertices, threads=ring.threads))[ring.quads].any(axis=1)
    for cut in (tip, tip | turned & close, tip | turned):
        pieces = _pieces(ring.quads[~cut], len(vertices))
        kept = _kept(vertices, ring.quads[~cut], pieces, seen)
        if kept is not None:
            break
    else:
        raise GeometryError("both sides of the surface are one, as on a Moebius strip", found="x", expected="an orientable surface", hint="")
    whole = np.isin(pieces[ring.quads], kept).all(axis=1) & (pieces[ring.quads] == pieces[ring.quads[:, :1]]).all(axis=1)
    quads = whole & ~tip
    used = np.zeros(len(vertices), bool)
    used[ring.quads[quads]] = True
    number = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return Side(used, quads, SheetRing(number[ring.quads[quads]], int(used.sum()), ring.threads))


@dataclass(frozen=True)
class _Seen:
    near: NDArray[np.int64]
    front: NDArray[np.bool_]

    def turned(self, quads, normals):
        sides = self.front[quads] ^ ((normals[quads] * normals[quads[:, :1]]).sum(axis=2) < 0)
        return sides.any(axis=1) & ~sides.all(axis=1)


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


def _kept(vertices: Floats, quads: NDArray[np.int32], pieces, seen):
    """Return the pieces that are kept; None where one is both sides of a sheet."""
    total = int(pieces.max()) + 1
    own = pieces >= 0
    shape = (total, int(seen.near.max()) + 1)
    sees = [sparse.coo_array((np.ones(int(w.sum())), (pieces[w], seen.near[w])), shape=shape).tocsr().astype(bool).astype(np.int64)
        for w in (own & ~seen.front, own & seen.front)]
    both = sees[0].multiply(sees[1]).sum(axis=1)
    either = (sees[0] + sees[1]).astype(bool).astype(np.int64)
    size = either.sum(axis=1)
    print("both", both[:4], size[:4])
    if (both > SAME * size).any():
        return None
    shared = (either @ either.T).toarray()
    outward = _outward(vertices, quads, pieces, total)
    kept = []
    for piece in sorted(range(total), key=lambda p: (not outward[p], p)):
        if all(shared[piece, other] <= SAME * min(size[piece], size[other]) for other in kept):
            kept.append(piece)
    return kept


def _outward(vertices, quads, pieces, total):
    """Tell which pieces face outward: away from what they enclose, or in the direction of the largest axis."""
    a, b, c, d = (vertices[corner] for corner in quads.T)
    areas, middle = 0.5 * np.cross(c - a, d - b), 0.25 * (a + b + c + d)
    piece = pieces[quads[:, 0]]
    result = np.zeros(total, bool)
    for n in range(total):
        area = areas[piece == n]
        size = np.sqrt((area**2).sum(axis=1)).sum()
        where = middle[piece == n]
        volume = ((where - where.mean(axis=0)) * area).sum() / 3
        whole = area.sum(axis=0)
        axis = np.argmax(np.abs(whole))
        result[n] = volume > 0 if abs(volume) > HOLLOW * size**1.5 else whole[axis] > 0
    return result
