"""Which side of a sampled surface is inside, where no shell of cubes keeps the outside out.

The indicator of a solid, 1 inside and 0 outside, has the gradient -n on the surface and none elsewhere. So the normals
of samples tell it, by one Poisson equation (Kazhdan et al. 2006), solved on a periodic lattice by Fourier transforms;
and the indicator tells the normals, of which only the line was known. Each is found from the other in turns, from
normals that a leaky shell tells (Hou et al. 2022: iterative Poisson surface reconstruction).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..progress import Progress, silent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .samples import Samples

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

ROUNDS = 16
"""Times that all normals are turned. Chosen: half and twice of it change no volume (a torus of 300 points, a sphere of
60, a thin box, a bowl, half a sphere)."""
WIDTH = 0.7
"""Width of the smoothing, sampling distances: with 1.4 times of it the hole of a torus of 300 points closes."""
LEAST_WIDTH = 1.1
"""The same, cubes: the lattice shows nothing narrower."""
MARGIN = 8
"""Cubes of the lattice around the samples: a solid tells nothing of itself outside, so that few suffice."""
CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
"""Of the cube of the lattice that a sample lies in."""


@dataclass(frozen=True)
class Indicator:
    """What lies inside of a sampled surface.

    Attributes
    ----------
    lowest : (3,) float array
        Corner of cube (0, 0, 0).
    inside : (c, 3) int64 array
        The cubes inside (x, y, z).
    normals : (p, 3) float array
        Of the samples, outward.
    doubtful : int
        The sample at which the indicator falls least.
    """

    lowest: Floats
    inside: Integers
    normals: Floats
    doubtful: int


def find_inside(
    samples: Samples, starts: Sequence[Floats], cell: float, *, threads: int = 0, progress: Progress = silent
) -> Indicator:
    """Find which cubes lie inside of the surface that samples describe.

    Parameters
    ----------
    samples : Samples
    starts : sequence of (p, 3) float arrays
        Normals to begin with, which may face either way; the start from which the indicator
        falls most is taken.
    cell : float
        Edge of the cubes.
    threads : int
    progress : callable

    Returns
    -------
    Indicator
    """
    lattice = _Lattice.over(samples.positions, cell, threads)
    area = samples.spacing**2
    width = max(WIDTH * float(np.median(samples.spacing)), LEAST_WIDTH * cell)
    found = []
    for number, normals in enumerate(starts):
        for count in range(ROUNDS):
            progress("inside", number * ROUNDS + count, len(starts) * ROUNDS)
            gradient = lattice.gradient(lattice.solved(normals * area[:, None], width))
            fall = np.sqrt((gradient**2).sum(axis=1))
            normals = -gradient / np.maximum(fall, 1e-300)[:, None]
        found.append((normals, fall))
    progress("inside", len(starts) * ROUNDS, len(starts) * ROUNDS)
    normals, fall = max(found, key=lambda one: float(one[1].mean()))
    normals = facing(samples.normals, normals)
    values = lattice.values(lattice.solved(normals * area[:, None], width))
    inside = np.argwhere(values > np.median(lattice.at(values)))
    return Indicator(lattice.lowest, inside.astype(np.int64), normals, int(np.argmin(fall)))


def facing(normals: Floats, ways: Floats) -> Floats:
    """Turn normals so that they face a way, (p, 3)."""
    return np.where((normals * ways).sum(axis=1)[:, None] < 0, -normals, normals)


@dataclass(frozen=True)
class _Lattice:
    """A periodic lattice of cubes (x, y, z), the corners of a cube of middles about each sample, and their weights."""

    lowest: Floats
    shape: tuple[int, int, int]
    cell: float
    nodes: Integers
    weights: Floats
    waves: tuple[Floats, Floats, Floats]
    threads: int

    @classmethod
    def over(cls, positions: Floats, cell: float, threads: int) -> _Lattice:
        low, extent = positions.min(axis=0), np.ptp(positions, axis=0)
        x, y, z = (scipy.fft.next_fast_len(int(np.ceil(side / cell)) + 2 * MARGIN, real=True) for side in extent)
        shape = (x, y, z)
        lowest = low + 0.5 * (extent - np.array(shape) * cell)
        place = (positions - lowest) / cell - 0.5
        cube = np.floor(place).astype(np.int64)
        share = place - cube
        weights = np.stack([np.where(corner, share, 1 - share).prod(axis=1) for corner in CORNERS], axis=1)
        steps = np.array([y * z, z, 1])
        nodes = (cube @ steps)[:, None] + CORNERS @ steps
        first, second = (2 * np.pi * scipy.fft.fftfreq(count, cell) for count in (x, y))
        third = 2 * np.pi * scipy.fft.rfftfreq(z, cell)
        waves = first[:, None, None], second[:, None], third
        return cls(lowest, shape, cell, nodes, weights, waves, threads)

    def solved(self, normals: Floats, width: float) -> NDArray[np.complex128]:
        """Return the transform of the indicator whose gradient is the smoothed field of normals (p, 3), turned."""
        x, y, z = self.waves
        squared = x**2 + y**2 + z**2
        squared[0, 0, 0] = 1.0
        sources = [1j * wave * self._transformed(column) for wave, column in zip(self.waves, normals.T, strict=True)]
        return np.asarray((sources[0] + sources[1] + sources[2]) / squared * np.exp(-0.5 * width**2 * squared))

    def gradient(self, transform: NDArray[np.complex128]) -> Floats:
        """Return the gradient of the indicator at the samples, (p, 3)."""
        return np.stack([self.at(self.values(1j * wave * transform)) for wave in self.waves], axis=1)

    def values(self, transform: NDArray[np.complex128]) -> Floats:
        """Return the values in the middles of all cubes."""
        return np.asarray(scipy.fft.irfftn(transform, self.shape, workers=self._workers))

    def at(self, values: Floats) -> Floats:
        """Interpolate values at the samples, (p,)."""
        return np.asarray((values.reshape(-1)[self.nodes] * self.weights).sum(axis=1))

    def _transformed(self, column: Floats) -> NDArray[np.complex128]:
        shares = np.bincount(self.nodes.ravel(), (self.weights * column[:, None]).ravel(), int(np.prod(self.shape)))
        return np.asarray(scipy.fft.rfftn(shares.reshape(self.shape) / self.cell**3, workers=self._workers))

    @property
    def _workers(self) -> int:
        return self.threads or -1
