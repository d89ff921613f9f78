"""The surface that the rings of a stack lie on: places along their curves, and which way it faces there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...model.columns import any_of
from ...model.points import CAP
from ...model.sliced import ranges_of
from ...pointcloud.samples import Samples
from ...som.fit import match
from ..sample import REACH

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...model.networks import Networks
    from ...model.volume import Volume
    from ..sample import Sampling

    Floats = NDArray[np.float64]

APART = 1.5
"""Distance of the places along a ring, in slice distances, over which a place is set between each two. Chosen:
half of it changes the distance by +2.2 %, twice by -1.4 %."""
DENSEST = 3.0
"""Places along an edge of a cube at most, as far as the fit is told: it looks for a vertex' samples no farther than a
few times their distance, and vertices start up to an edge away. Chosen: half of it changes the distance by -0.6 %,
twice by +0.0 %; at 24 neurons, without it, a third of the faces have no sample near."""
FINEST = 4
"""Most times that this is done: the neurons of a ring are then sixteen slice distances apart, and nothing is known
between the slices that would be worth more places."""


def surface_under(networks: Networks, sampling: Sampling, volume: Volume) -> Samples:
    """Take the curves through the neurons of rings, and the caps, as samples of a surface.

    A curve is cubic between its neurons, so that a chord's distance from it, s^2 c / 8 at curvature c, is none of the
    surface's. The normal is across the ring and across the way to the places that are nearest on the slices beside it.
    Nothing is placed along bridged gaps: the surface is filled there.

    Parameters
    ----------
    networks : Networks
        Rings.
    sampling : Sampling
        Their points: those on caps face along the stack.
    volume : Volume
        Its slices K are those of the networks.

    Returns
    -------
    Samples
        In patient millimeters; where no slice is beside a ring there are none of it.
    """
    lines, broken = _curves(networks, volume)
    count, size = lines.shape[:2]
    slices = np.repeat(networks.slices, size).astype(np.float64)
    places = volume.to_mm(np.column_stack([lines.reshape(-1, 2), slices])).reshape(count, size, 3)
    del lines, slices
    found = [
        _under(places, broken, networks.slices, sampling.spacing_mm, start, stop) for start, stop in ranges_of(places)
    ]
    caps = sampling.points.positions[sampling.points.kinds == CAP]
    facing = np.broadcast_to(np.cross(volume.affine[:3, 0], volume.affine[:3, 1]), caps.shape)
    found.append((caps, _long_one(facing), np.full(len(caps), sampling.spacing_mm)))
    columns = list(zip(*found, strict=True))
    del places, found
    places, normals, spacing = (np.concatenate(columns.pop(0)) for _ in range(3))  # one after the other is let go
    return Samples(places, normals, spacing, np.zeros_like(spacing), np.zeros_like(spacing), 0, 0.0)


def _under(
    places: Floats, broken: NDArray[np.bool_], slices: NDArray[np.int32], widest: float, start: int, stop: int
) -> tuple[Floats, Floats, Floats]:
    """Return places along some of the rings, the normals there and how far apart they are, as they are kept.

    A ring is told of by two on each side of it.
    """
    low, high = max(start - 2, 0), min(stop + 2, len(places))
    own, around = slice(start - low, stop - low), places[low:high]
    up, down = (_Steps.along(around, slices[low:high], way) for way in (1, -1))
    along, apart = _along(places[start:stop], broken[start:stop])
    normals = np.cross(along, _across(up, down)[own])
    wide = np.maximum(up.lengths[own], down.lengths[own])
    kept = any_of((normals != 0).reshape(-1, 3)) & ~_alone(broken[start:stop]).ravel()
    spacing = np.clip(np.maximum(wide, apart), widest / DENSEST, widest).ravel()
    return places[start:stop].reshape(-1, 3)[kept], _long_one(normals.reshape(-1, 3)[kept]), spacing[kept]


def _long_one(normals: Floats) -> Floats:
    """Return vectors (n, 3) of length 1."""
    return np.asarray(normals / np.sqrt((normals**2).sum(axis=1, keepdims=True)))


def _curves(networks: Networks, volume: Volume) -> tuple[Floats, NDArray[np.bool_]]:
    """Return places (s, m, 2) along the curves, as pixels, and which sides (s, m) from each to the next are gaps."""
    lines, broken = networks.codebooks, networks.bridged
    for _ in range(FINEST):
        sides = (np.roll(lines, -1, axis=1) - lines) * volume.spacing_mm[:2]
        if np.median(np.hypot(sides[..., 0], sides[..., 1])) <= APART * volume.spacing_mm[2]:
            break
        lines, broken = _finer(lines, broken)
    return lines, broken


def _finer(lines: Floats, broken: NDArray[np.bool_]) -> tuple[Floats, NDArray[np.bool_]]:
    """Set a place between each two, on the cubic through four (Dyn, Gregory and Levin 1987); on the chord by a gap."""
    before, after, second = (np.roll(lines, n, axis=1) for n in (1, -1, -2))
    middle = (lines + after) / 2
    straight = broken | np.roll(broken, 1, axis=1) | np.roll(broken, -1, axis=1)
    middle += np.where(straight[..., None], 0.0, (lines + after - before - second) / 16)
    shape = (lines.shape[0], 2 * lines.shape[1])
    return np.stack([lines, middle], axis=2).reshape(*shape, 2), np.repeat(broken, 2, axis=1).reshape(shape)


def _along(places: Floats, broken: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Return the direction of the curve at each place, (s, m, 3), and how far the next place is, (s, m).

    From the place before to the place after, from or to the place itself beside a gap.
    """
    onward = np.where(broken[..., None], 0.0, np.roll(places, -1, axis=1) - places)
    back = np.roll(onward, 1, axis=1)
    lengths = np.sqrt((onward**2).sum(axis=2)), np.sqrt((back**2).sum(axis=2))
    return onward + back, np.maximum(*lengths)


def _alone(broken: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which places have a gap on both sides."""
    return broken & np.roll(broken, 1, axis=1)


@dataclass(frozen=True)
class _Steps:
    """From each place to the nearest on the next slice, up or down.

    Attributes
    ----------
    vectors : (s, m, 3) float array
        Zeros where nothing is beside a slice.
    nearest : (s, m) int array
        Which place of that slice it is.
    way : int
        1 up, -1 down.
    """

    vectors: Floats
    nearest: NDArray[np.int64]
    way: int

    @classmethod
    def along(cls, places: Floats, slices: NDArray[np.int32], way: int) -> _Steps:
        vectors, nearest = np.zeros_like(places), np.zeros(places.shape[:2], np.int64)
        for n in range(max(0, -way), len(places) - max(0, way)):
            if abs(slices[n + way] - slices[n]) <= REACH:
                nearest[n], _ = match(places[n + way], places[n])
                vectors[n] = places[n + way][nearest[n]] - places[n]
        return cls(vectors, nearest, way)

    @cached_property
    def lengths(self) -> Floats:
        """How long each is, (s, m)."""
        return np.asarray(np.sqrt((self.vectors**2).sum(axis=2)))

    @cached_property
    def directions(self) -> Floats:
        """Direction in each place of the parabola through it and the next two, (s, m, 3)."""
        beside = np.clip(np.arange(len(self.vectors)) + self.way, 0, len(self.vectors) - 1)[:, None]
        further = self.vectors[beside, self.nearest]
        near, far = self.lengths[..., None], (self.lengths + self.lengths[beside, self.nearest])[..., None]
        bend = (self.vectors + further) * np.where(far > near, near, 0.0) ** 2
        return np.asarray(self.vectors * far**2 - bend)


def _across(up: _Steps, down: _Steps) -> Floats:
    """Return the direction across the slices, that of the parabola through a place and those above and below it."""
    over, under = up.lengths[..., None], down.lengths[..., None]
    both = up.vectors * under**2 - down.vectors * over**2
    return np.where((over > 0) & (under > 0), both, up.directions - down.directions)
