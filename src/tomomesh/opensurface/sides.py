"""The two sides of the shell of an open surface, and which of them is kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..dynamics.low_pass import OneRing
from ..pointcloud.search import Index

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..pointcloud.samples import Samples

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]
    Marks = NDArray[np.bool_]

LEAST_PIECE = 0.01
"""Share of the squares under which a piece of the shell is left out. Chosen: half and twice of it change no case of
benchmarks/constants.py."""
PLOT = 1.5
"""Edge of the plots over which two pieces are compared, cube edges: each side has vertices over each. Chosen: half and
twice of it change no case of benchmarks/constants.py."""
SAME = 0.5
"""Share of its plots that a piece has in common with its other side. Chosen: half of it changes nothing, twice by
+1308.1 %."""
BOTH = 0.25
"""Share of its plots that a piece sees from both sides where the sides have not come apart. Chosen: half and twice of
it change no case of benchmarks/constants.py."""
HOLLOW = 0.01
"""Volume under a sheet, over the power 3/2 of its area, from which one of its sides is the outer one. Chosen: half and
twice of it change no case of benchmarks/constants.py."""


def sheet_ring(quads: NDArray[np.int32], count: int, threads: int = 0) -> OneRing:
    """Take the neighbors of each vertex of a sheet: a vertex on a border has only those along it."""
    sides = np.sort(quads[:, [0, 1, 1, 2, 2, 3, 3, 0]].reshape(-1, 2), axis=1)
    edges, uses = np.unique(sides, axis=0, return_counts=True)
    rim = np.zeros(count, bool)
    rim[edges[uses == 1]] = True
    pairs = np.concatenate([edges, edges[:, ::-1]])
    pairs = pairs[(np.tile(uses, 2) == 1) | ~rim[pairs[:, 0]]]
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    start = np.concatenate([[0], np.cumsum(np.bincount(pairs[:, 0], minlength=count))])
    return OneRing(start, np.ascontiguousarray(pairs[:, 1], np.int32), quads, threads)


@dataclass(frozen=True)
class Side:
    """What is kept of a shell: one side of each sheet.

    Attributes
    ----------
    vertices : (n,) bool array
    quads : (q,) bool array
    ring : OneRing
        Of the kept squares, over the kept vertices.
    """

    vertices: Marks
    quads: Marks
    ring: OneRing


def one_side(
    vertices: Floats, ring: OneRing, samples: Samples, apron: Floats, tips: Marks, edge: float, *, largest: bool = False
) -> Side | None:
    """Cut the shell where it turns over the rim, and keep one side of each sheet.

    The outer one is kept where the sheet is hollow; else the one that faces along the axis that it faces most.

    Parameters
    ----------
    vertices : (n, 3) float array
    ring : OneRing
        The squares of the shell.
    samples : Samples
    apron : (a, 3) float array
        Places that carry the sheet on beyond its borders.
    tips : (a,) bool array
        Those at its outer end: what lies nearest to them is cut away.
    edge : float
        Edge of the cubes.
    largest : bool
        Keep the largest sheet alone.

    Returns
    -------
    Side or None
        None where the two sides of a sheet are one piece.
    """
    count = len(samples.positions)
    near = np.asarray(scipy.spatial.cKDTree(np.concatenate([samples.positions, apron])).query(vertices)[1])
    cut = np.append(np.zeros(count, bool), tips)[near]
    quads = np.asarray(~cut[ring.quads].any(axis=1))
    pieces = _pieces(ring.quads[quads], len(vertices))
    own = np.flatnonzero((pieces >= 0) & (near < count))
    if len(own) == 0:
        return None
    below = near[own].astype(np.int64)
    facing = (ring.normals(vertices)[own] * samples.normals[below]).sum(axis=1) > 0
    plots = _plots(samples.positions, PLOT * edge)[below]
    kept = _kept(pieces[own], plots, facing, _outer(vertices, ring.quads[quads], pieces))
    return None if kept is None else _side(ring, quads, np.isin(pieces, kept[:1] if largest else kept))


def _side(ring: OneRing, quads: Marks, vertices: Marks) -> Side:
    quads = quads & vertices[ring.quads].all(axis=1)
    used = np.zeros(len(vertices), bool)
    used[ring.quads[quads]] = True
    number = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return Side(used, quads, sheet_ring(number[ring.quads[quads]], int(used.sum()), ring.threads))


def _pieces(quads: NDArray[np.int32], count: int) -> Integers:
    """Return the connected piece of each vertex, (n,), the largest first; -1 for crumbs."""
    pairs = quads[:, [0, 1, 1, 2, 2, 3]].reshape(-1, 2)
    links = scipy.sparse.coo_array((np.ones(len(pairs), bool), pairs.T), shape=(count, count))
    total, label = scipy.sparse.csgraph.connected_components(links, directed=False)
    size = np.bincount(label[quads[:, 0]], minlength=total)
    rank = np.empty(total, np.int64)
    rank[np.argsort(-size, kind="stable")] = np.arange(total)
    return np.asarray(np.where(size[label] >= max(LEAST_PIECE * len(quads), 1), rank[label], -1))


def _plots(positions: Floats, edge: float) -> Integers:
    """Return the number of the cube of an edge that holds each position, (p,)."""
    index = Index.of(positions, edge)
    plots = np.empty(len(positions), np.int64)
    plots[index.order] = np.repeat(np.arange(len(index.groups) - 1), np.diff(index.groups))
    return plots


def _kept(pieces: Integers, plots: Integers, facing: Marks, outer: Marks) -> list[int] | None:
    """Return the pieces to keep, the largest first; None where one is both sides of a sheet.

    Parameters
    ----------
    pieces, plots : (v,) int64 arrays
        Piece of each vertex, and the plot that it lies over.
    facing : (v,) bool array
        Whether it faces as the sample there does.
    outer : (total,) bool array
        Pieces that come first.
    """
    shape = (len(outer), int(plots.max()) + 1)
    behind, before = (
        scipy.sparse.coo_array((np.ones(int(way.sum()), np.int64), (pieces[way], plots[way])), shape=shape)
        .tocsr()
        .sign()
        for way in (~facing, facing)
    )
    over = (behind + before).sign()
    size: Integers = over.sum(axis=1)
    if (behind.multiply(before).sum(axis=1) > BOTH * size).any():
        return None
    shared, kept = (over @ over.T).toarray(), list[int]()
    for piece in sorted(range(len(outer)), key=lambda p: (not outer[p], p)):
        if all(shared[piece, other] <= SAME * min(size[piece], size[other]) for other in kept):
            kept.append(piece)
    return sorted(kept)


def _outer(vertices: Floats, quads: NDArray[np.int32], pieces: Integers) -> Marks:
    """Tell which pieces, (total,), face away from what they enclose, or else along the axis that they face most."""
    a, b, c, d = (vertices[corner] for corner in quads.T)
    areas, middles, piece = 0.5 * np.cross(c - a, d - b), 0.25 * (a + b + c + d), pieces[quads[:, 0]]
    outer = np.zeros(int(pieces.max()) + 1, bool)
    for n in range(len(outer)):
        area, middle = areas[piece == n], middles[piece == n]
        volume = float(((middle - middle.mean(axis=0)) * area).sum()) / 3
        hollow = abs(volume) > HOLLOW * float(np.sqrt((area**2).sum(axis=1)).sum()) ** 1.5
        whole = area.sum(axis=0)
        outer[n] = volume > 0 if hollow else whole[np.argmax(np.abs(whole))] > 0
    return outer
