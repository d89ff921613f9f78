"""Networks -> points: neurons in patient millimeters, bridged gaps and caps (Fig. 7)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from ..measure.polygon import area, distance, inside_lattice, lattice_over, side_lengths
from ..model.points import BRIDGE, CAP, NEURON, RING, SIDE, TRACK, PointSet

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.contours import Contours
    from ..model.networks import Networks
    from ..model.volume import Volume

REACH = 2
"""Rings at most this many slices apart count as neighbors: one slice without a network between them is bridged."""
MOST_PIECES = 4
"""Samples of a bridged gap for each neuron of its network, at most: the other edges may have no length. Chosen: half
and twice of it change no case of benchmarks/constants.py."""


@dataclass(frozen=True)
class Sampling:
    """The point set P with what is known about its density.

    Attributes
    ----------
    points : PointSet
    spacing_mm : float
        r, the edge of the cubes: the widest gap between neighbors in a network and between slices, or from a neuron
        to the one nearest to it.
    bridged : int
        Edges of the networks that were sampled along their line.
    ring_area_mm2 : (s,) float array
        Area inside each ring; empty for other networks.
    distance_mm : (s,) float array
        Position of each network's slice along the stack.
    """

    points: PointSet
    spacing_mm: float
    bridged: int
    ring_area_mm2: NDArray[np.float64]
    distance_mm: NDArray[np.float64]

    @property
    def volume_mm3(self) -> float:
        """Volume between the rings: their areas times the distance of the slices; 0 without rings."""
        if len(self.ring_area_mm2) < 2:
            return 0.0
        return float(np.trapezoid(self.ring_area_mm2, self.distance_mm))


def sample(
    networks: Networks, volume: Volume, *, caps: bool = True, bridge: float = 2.0, cell_from: str = "adjacent"
) -> Sampling:
    """Place the neurons of all slices in space, sample bridged gaps, and close the ends of rings.

    Parameters
    ----------
    networks : Networks
    volume : Volume
        Its slices K are those of the networks.
    caps : bool
        Whether to close the inside of rings that have nothing above or below.
    bridge : float
        Gaps between slices over this many medians do not widen r; 0 takes the widest.
    cell_from : str
        What r is: the widest distance of neurons that are ``"adjacent"`` along a network or from slice to slice, or
        of a neuron to the ``"nearest"``.

    Returns
    -------
    Sampling
    """
    neurons = _neurons(networks, volume)
    bridges, in_ring = _bridges(networks, volume)
    points = neurons.joined(bridges)
    is_ring = networks.lattice.name == "ring"
    adjacent = max(in_ring, _slice_step(networks, volume))
    spacing = adjacent if cell_from == "adjacent" else _to_nearest(points) or adjacent
    fill = _caps(networks, volume, spacing) if is_ring and caps else _none(volume)
    if cell_from == "adjacent":
        spacing = max(spacing, _across(points, fill, bridge))
    points = points.joined(fill)
    pixel = volume.pixel_area_mm2
    areas = np.array([abs(area(ring)) for ring in networks.codebooks]) * pixel if is_ring else np.empty(0)
    return Sampling(
        points,
        spacing,
        int(networks.bridged.sum()),
        areas,
        networks.slices * np.float64(volume.slice_distance_mm),
    )


def sample_contours(contours: Contours, volume: Volume) -> Sampling:
    """Place the neurons of all contours in space; each knows its slice, ring, side and track.

    Nothing is set along bridged gaps or inside end rings: the surface is closed between the slices themselves.

    Parameters
    ----------
    contours : Contours
    volume : Volume
        Its slices K are those of the contours.

    Returns
    -------
    Sampling
        Holes take from the area of a slice. The slices before the first and after the last have none, nor have those
        between without a contour: what is on a slice goes on for half of the way to the next.
    """
    sizes = [len(one) for one in contours.contours]
    slices, ring, side, track = (
        np.repeat(np.array(values, np.int32), sizes)
        for values in zip(*((one.slice, one.ring, one.side, one.track) for one in contours.contours), strict=True)
    )
    neurons = np.concatenate([np.arange(size, dtype=np.int32) for size in sizes])
    positions = _place(np.concatenate([one.codebook for one in contours.contours]), slices, volume)
    points = PointSet(
        positions, slices, neurons, np.full(len(slices), NEURON, np.uint8), {RING: ring, SIDE: side, TRACK: track}
    )
    first = int(contours.slices[0]) - 1
    areas = np.zeros(int(contours.slices[-1]) + 2 - first)
    for one in contours.contours:
        areas[one.slice - first] += (-1 if one.side % 2 else 1) * abs(area(one.codebook))
    lengths = np.concatenate(
        [side_lengths(one.codebook * volume.spacing_mm[:2])[~one.bridged] for one in contours.contours]
    )
    spacing = float(lengths.max(initial=0.0))
    bridged = sum(int(one.bridged.sum()) for one in contours.contours)
    distance = np.arange(first, first + len(areas)) * np.float64(volume.slice_distance_mm)
    return Sampling(points, spacing, bridged, areas * volume.pixel_area_mm2, distance)


def _neurons(networks: Networks, volume: Volume) -> PointSet:
    count, u = networks.codebooks.shape[:2]
    slices = np.repeat(networks.slices, u)
    numbers = np.tile(np.arange(u, dtype=np.int32), count)
    positions = _place(networks.codebooks.reshape(-1, 2), slices, volume)
    return PointSet(positions, slices, numbers, np.full(len(slices), NEURON, np.uint8))


def _place(indices: NDArray[np.float64], slices: NDArray[Any], volume: Volume) -> NDArray[np.float64]:
    return volume.to_mm(np.column_stack([indices, slices]))


def _made(indices: NDArray[np.float64], heights: NDArray[Any], volume: Volume, kind: int) -> PointSet:
    """Return points that are no neurons; each counts to the slice that is nearest to it."""
    none, slices = np.full(len(heights), -1, np.int32), np.rint(heights).astype(np.int32)
    return PointSet(_place(indices, heights, volume), slices, none, np.full(len(slices), kind, np.uint8))


def _none(volume: Volume) -> PointSet:
    return _made(np.empty((0, 2)), np.empty(0), volume, CAP)


def _bridges(networks: Networks, volume: Volume) -> tuple[PointSet, float]:
    """Sample the bridged gaps as densely as the other edges of their slice; return also the widest gap left."""
    ends = networks.codebooks[:, networks.lattice.edges]
    lengths = np.sqrt((((ends[:, :, 1] - ends[:, :, 0]) * volume.spacing_mm[:2]) ** 2).sum(axis=2))
    usual = np.where(networks.bridged, 0.0, lengths).max(axis=1, keepdims=True)
    pieces = np.ones(lengths.shape, np.int64)
    sampled = networks.bridged & (usual > 0)
    most = MOST_PIECES * len(networks.lattice)
    pieces[sampled] = np.ceil(np.minimum(lengths / np.where(usual > 0, usual, 1.0), most)[sampled])
    which, edge = np.nonzero(pieces > 1)
    inner = pieces[which, edge] - 1
    owner = np.repeat(np.arange(len(which)), inner)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(inner) - inner, inner) + 1
    share = (step / pieces[which, edge][owner])[:, None]
    first, last = ends[which, edge, 0][owner], ends[which, edge, 1][owner]
    indices = first + share * (last - first)
    points = _made(indices, networks.slices[which][owner], volume, BRIDGE)
    return points, float((lengths / pieces).max())


def _slice_step(networks: Networks, volume: Volume) -> float:
    """Return the widest distance between slices that count as neighbors."""
    steps = np.diff(networks.slices)
    steps = steps[steps <= REACH]
    return float(steps.max(initial=1) * volume.spacing_mm[2])


def _to_nearest(points: PointSet) -> float:
    """Return the widest distance of a point to the one nearest to it; 0 where each lies on another, or is alone."""
    if len(points) < 2:
        return 0.0
    distance = np.asarray(scipy.spatial.cKDTree(points.positions).query(points.positions, k=[2])[0])
    return float(distance.max())


def _across(points: PointSet, fill: PointSet, limit: float) -> float:
    """Return the widest gap from a ring to the next slice, or to what fills the inside of either.

    Gaps over `limit` medians are left to the closing of the shell, as bridged edges are; 0 takes the widest.
    """
    order = np.argsort(points.slices, kind="stable")
    present, first = np.unique(points.slices[order], return_index=True)
    groups = np.split(points.positions[order], first[1:])
    gaps = []
    for (here, one), (there, other) in pairwise(zip(present, groups, strict=True)):
        if there - here <= REACH:
            near = fill.positions[(fill.slices >= here) & (fill.slices <= there)]
            gaps += [_to_nearest_of(one, other, near), _to_nearest_of(other, one, near)]
    if not gaps:
        return 0.0
    widest = np.concatenate(gaps)
    return float(widest[widest <= limit * np.median(widest)].max(initial=0.0) if limit else widest.max())


def _to_nearest_of(own: NDArray[np.float64], *others: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of each point to the nearest of some others."""
    there = np.concatenate(others)
    x, y, z = ((own[:, None, axis] - there[:, axis]) ** 2 for axis in range(3))
    return np.asarray(np.sqrt((x + y + z).min(axis=1)))


def _caps(networks: Networks, volume: Volume, spacing: float) -> PointSet:
    """Fill what lies inside a ring but not inside the next ring above, or below, at the given spacing.

    Where there is no next ring, the end is flat: a cap. Between two rings the surface rises from one to the other as
    the distances from both say (Raya and Udupa 1990): a slant gets no steps, and counts as a gap that is bridged. A
    ring is trusted to half a spacing, and a lattice meets it at half a spacing on average: so no point is set that is
    outside of the next ring by less than a half, or nearer to its own than a quarter.
    """
    pixel = np.array(volume.spacing_mm[:2])
    rings, slices = networks.codebooks * pixel, networks.slices.astype(np.float64)
    places, heights, kinds = [np.empty((0, 2))], [np.empty(0)], [np.empty(0, np.uint8)]
    for n, ring in enumerate(rings):
        x, y = lattice_over(ring, spacing)
        own = inside_lattice(ring, x, y)
        beside = [m for m in (n - 1, n + 1) if 0 <= m < len(rings) and abs(slices[m] - slices[n]) <= REACH]
        for m in beside if len(beside) == 2 else (None, *beside):
            bare = _at(x, y, own if m is None else own & ~inside_lattice(rings[m], x, y))
            near = distance(ring, bare)
            away = np.full(len(bare), np.inf) if m is None else distance(rings[m], bare)
            far = (near > spacing / 4) & (away > spacing / 2)
            places.append(bare[far])
            height = slices[n] if m is None else slices[m] - (slices[m] - slices[n]) * (away / (near + away))[far]
            heights.append(np.broadcast_to(height, len(places[-1])))
            kinds.append(np.full(len(places[-1]), CAP if m is None else BRIDGE, np.uint8))
    found = _made(np.concatenate(places) / pixel, np.concatenate(heights), volume, CAP)
    return replace(found, kinds=np.concatenate(kinds))


def _at(x: NDArray[np.float64], y: NDArray[np.float64], held: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return some places of a lattice, row by row, (n, 2)."""
    row, column = np.nonzero(held)
    return np.stack([x[column], y[row]], axis=1)
