"""Where a sampled surface ends: the borders of a sheet, and those of its holes.

A sample lies on a border where a disk beside it, in its plane, holds no other sample (Edelsbrunner et al. 1983). So
a hole is one that the disk fits through; what is narrower belongs to the surface.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..kernels.pointcloud.linear_algebra import tangents
from ..kernels.pointcloud.sheet import DIRECTIONS, find_depths, find_disks, flatten
from ..kernels.threads import in_blocks
from ..pointcloud.search import Index

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..pointcloud.samples import Samples

    Floats = NDArray[np.float64]

BLOCK = 4_096
"""Samples or places worked on in one call. No result depends on it."""
RADIUS = 2.5
"""Radius of the disks, sampling distances: points thrown at random leave holes as wide, once in 10 million. Chosen:
half of it changes the distance by -17.0 %, twice by +21.8 %."""
PLANE_SIGHT = 2.0
"""How far a sample looks for the plane that it lies in, sampling distances. Chosen: half of it changes the distance by
-15.9 %, twice by +32.6 %."""
LINK = 1.5
"""Distance of the middles of disks that belong to one border, in their radius. Chosen: half and twice of it change no
case of benchmarks/constants.py."""
LEAST = 5
"""Samples on a border; fewer lie beside a sharp edge, or noise. Chosen: half and twice of it change no case of
benchmarks/constants.py."""
ROUGH = 0.18
"""Mean distance of a sample's neighbors from its plane, in sampling distances, over which it lies beside an edge or on
something thin; most samples of a border do not. Chosen: half and twice of it change no case of benchmarks/constants.py.
"""
NEAR = 2.0
"""Distance of samples near a border from the middles of its disks, in their radius. Chosen: half of it changes the
distance by -19.0 %, twice by +30.5 %."""
SIGHT = 1.5
"""Distance from the middle of a disk within which places are told how deep they lie, in its radius. Chosen: half of it
changes the distance by +21.5 %, twice nothing."""


@dataclass(frozen=True)
class Borders:
    """The borders of a sheet: disks beside it, without samples.

    Attributes
    ----------
    samples : (d, 7) float array
        The sample that each disk touches: position, unit normal, spacing.
    middles : (d, 3) float array
        Of the disks, each in the plane of its sample.
    radii : (d,) float array
    labels : (d,) int64 array
        The border of each disk.
    count : int
        Borders.
    """

    samples: Floats
    middles: Floats
    radii: Floats
    labels: NDArray[np.int64]
    count: int

    def apron(self, reach: float, gap: float) -> tuple[Floats, Floats]:
        """Lay places over the disks, from their samples towards their middles.

        Parameters
        ----------
        reach : float
            How far, over the radius.
        gap : float
            Largest distance of the places along each way.

        Returns
        -------
        places : (a, 3) float array
        share : (a,) float array
            How far each lies along the way: 1 at the end.
        """
        pieces = int(np.ceil(reach * self.radii.max(initial=0.0) / gap))
        share = np.arange(1, pieces + 1) / max(pieces, 1)
        ways = reach * (self.middles - self.samples[:, :3])
        places = self.samples[:, None, :3] + share[:, None] * ways[:, None]
        return places.reshape(-1, 3), np.tile(share, len(ways))

    def depths(self, places: Floats, *, threads: int = 0) -> Floats:
        """Return how far places (n, 3) lie from the nearest disk: negative beyond a border, infinite far inside."""
        depth = np.full(len(places), np.inf)
        if not self.count:
            return depth
        reach = SIGHT * float(self.radii.max())
        index = Index.of(self.middles, reach)
        disks = np.column_stack([self.middles, self.samples[:, 3:6], self.radii])[index.order]
        in_blocks(
            lambda a, b: find_depths(places, disks, *index.cells, reach, depth, a, b),
            len(places), block=BLOCK, threads=threads,
        )  # fmt: skip
        return depth

    def only(self, disks: NDArray[np.bool_], labels: NDArray[np.int64]) -> Borders:
        """Keep some of the disks, (d,), under other labels, (d,)."""
        return Borders(
            self.samples[disks], self.middles[disks], self.radii[disks], labels[disks],
            int(labels[disks].max(initial=-1)) + 1,
        )  # fmt: skip


def borders(samples: Samples, edge: float, *, threads: int = 0) -> tuple[Borders, Samples]:
    """Find where the samples of a surface end.

    Parameters
    ----------
    samples : Samples
    edge : float
        Edge of the cubes: no disk is smaller than one over cubes of it.
    threads : int

    Returns
    -------
    borders : Borders
    samples : Samples
        The same, but that those near a border have the normals of the planes that they lie in: a quadratic that
        sees one side only may be tilted.
    """
    spacing = np.maximum(samples.spacing, edge)
    index = Index.of(samples.positions, 2 * RADIUS * float(np.median(spacing)))
    rows = np.column_stack([samples.positions, samples.normals, spacing])[index.order]
    normals, rough = np.empty((len(rows), 3)), np.empty(len(rows))
    beyond, radii = np.empty(len(rows), np.int64), np.empty(len(rows))

    def level(start: int, stop: int) -> None:
        flatten(rows, *index.cells, PLANE_SIGHT, normals, rough, start, stop)

    def lay(start: int, stop: int) -> None:
        find_disks(rows, *index.cells, RADIUS, beyond, radii, start, stop)

    in_blocks(level, len(rows), block=BLOCK, threads=threads)
    rows[:, 3:6] = normals
    in_blocks(lay, len(rows), block=BLOCK, threads=threads)
    at, ways = _ways(rows, beyond)
    found = Borders(rows[at], rows[at, :3] + radii[at, None] * ways, radii[at], np.zeros(len(at), np.int64), 0)
    found = _sorted_out(found, at, rough) if len(at) else found
    return found, _levelled(samples, found, rows[np.argsort(index.order), 3:6])


def _ways(rows: Floats, beyond: NDArray[np.int64]) -> tuple[NDArray[np.int64], Floats]:
    """Return every direction in which a sample has a disk beside it: the sample (d,), and a unit vector (d, 3)."""
    samples = np.flatnonzero(beyond)
    axes = np.empty((len(samples), 2, 3))
    for normal, pair in zip(rows[samples, 3:6], axes, strict=True):
        tangents(np.ascontiguousarray(normal), pair)
    at, way = np.nonzero(beyond[samples, None] >> np.arange(DIRECTIONS) & 1)
    angle = 2 * np.pi * way[:, None] / DIRECTIONS
    return samples[at], np.cos(angle) * axes[at, 0] + np.sin(angle) * axes[at, 1]


def _sorted_out(found: Borders, at: NDArray[np.int64], rough: Floats) -> Borders:
    """Tell the borders apart, and leave out those of a few samples or of rough ones; at (d,) is each disk's sample."""
    pairs = scipy.spatial.cKDTree(found.middles).query_pairs(
        LINK * float(np.median(found.radii)), output_type="ndarray"
    )
    links = scipy.sparse.coo_array((np.ones(len(pairs), bool), pairs.T), shape=(len(at), len(at)))
    count, label = scipy.sparse.csgraph.connected_components(links, directed=False)
    own, first = np.unique(at, return_index=True)
    label = label.astype(np.int64)
    many = np.bincount(label[first], minlength=count) >= LEAST
    smooth = np.bincount(label[first], rough[own] > ROUGH, count) < 0.5 * np.bincount(label[first], minlength=count)
    kept = np.asarray(many & smooth)
    return found.only(kept[label], (np.cumsum(kept) - 1)[label])


def _levelled(samples: Samples, found: Borders, normals: Floats) -> Samples:
    """Give the samples near a border other normals, (p, 3)."""
    if not found.count:
        return samples
    away = np.asarray(scipy.spatial.cKDTree(found.middles).query(samples.positions)[0])
    near = away < NEAR * float(np.median(found.radii))
    return replace(samples, normals=np.where(near[:, None], normals, samples.normals))
