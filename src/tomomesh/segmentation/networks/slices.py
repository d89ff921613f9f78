"""What the networks of a study are shown on its slices, how they are trained there, and how many neurons they need."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...kernels.som.neighborhoods import GAUSSIAN
from ...measure.polygon import side_lengths
from ...model.lattice import lattice
from ...model.sliced import areas_of, parts_of, some_of
from ...settings import IN_SLICE, MOST_NEURONS
from ...som.even_spacing import bridged_edges, even_spacing
from ...som.fit import fit, radii, shape_of
from ..contours.curved import evened
from ..contours.inputs import FEWEST, SIDES_EACH
from ..contours.shrinking import unshrunk
from ..signal import crossings_around, fills_most, is_stepped, outline, pixels_of
from ..window import by_layer

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...isosurface.crossings import Levels
    from ...model.lattice import Lattice
    from ...model.sliced import Sliced
    from ...model.volume import Volume
    from ...settings import NetworkSettings
    from ...som.fit import Fitted
    from ...som.passes import Look
    from ..window import Limit

LOOKED_AT = 6
"""Slices on which the number of neurons is found: a tenth of a study's, and of its time. Chosen: half of it changes the
distance by -1.2 %, twice by -1.9 %."""
MUCH = 1.5
"""Neurons over those of a ring up to which what it asks for is believed: its sides' errors, taken for parabolas, are
those of a cubic, and 1.5^2 times as small."""
CHORD = 0.1
"""Most that the middle of a side may be off the line, pixels, where the number of neurons follows from the outlines:
twice what the pixels' noise moves a neuron (measured, 0.04 px). Chosen: half of it changes the distance by -3.2 %, with
two fifths more neurons, twice by +20.9 %."""
REST = 0.05
"""Share of a ring whose sides may be off by more: at a corner no number is enough. Chosen: half of it changes the
distance by -2.4 %, twice by -1.1 %."""
NEAR = 2.0
"""First radius, hops, where a network starts from the result of the slice below. Measured: a ring that starts from its
neighbor's place needs 3 epochs from there, and a start at 4 fails on two-sided walls."""


@dataclass(frozen=True)
class Slices:
    """What the networks of a study see, and how they are trained."""

    mask: Sliced
    layers: Sliced | None
    levels: Levels | None
    settings: NetworkSettings
    pixel_mm: tuple[float, float]
    seed: int
    first: int
    outlined: bool
    times_shown: float = 1.0
    """How often a pixel is shown: once, or for each of its layers."""

    @classmethod
    def of(
        cls, mask: Sliced, layers: Sliced | None, levels: Levels | None,
        settings: NetworkSettings, pixel_mm: tuple[float, float], seed: int, first: int,
    ) -> Slices:  # fmt: skip
        """Choose what is shown; for the whole study, which would else have a step in its surface."""
        solid = settings.signal == "auto" and settings.topology != "grid" and fills_most(mask)
        outlined = settings.signal == "boundary" or solid
        fine = levels if outlined and settings.training == "batch" else None
        if fine is not None and is_stepped(mask, fine):
            fine = None
        shown = 1.0 if outlined or layers is None else _times_shown(layers)
        return cls(mask, layers, fine, settings, pixel_mm, seed, first, outlined, shown)

    def part(self, start: int, stop: int) -> Slices:
        """Return a range of the slices, in the memory."""
        mask, layers = (None if one is None else some_of(one, start, stop) for one in (self.mask, self.layers))
        levels = None if self.levels is None else self.levels.part(start, stop)
        assert mask is not None
        return replace(self, mask=mask, layers=layers, levels=levels, first=self.first + start)

    def shown(self, k: int) -> NDArray[np.float64]:
        """Return what the network of a slice sees, in millimeters."""
        plane = self.mask[k] if self.outlined or self.layers is None else self.layers[k]
        if self.levels is not None:
            shown = crossings_around(plane, self.levels, k)
        else:
            shown = outline(plane) if self.outlined else pixels_of(plane)
        return shown * (*self.pixel_mm, self.pixel_mm[0])[: shown.shape[1]]

    @property
    def pixel_area(self) -> float:
        """Area that an input stands for, mm^2; 0 where the inputs are on a line."""
        return 0.0 if self.levels is not None else self.pixel_mm[0] * self.pixel_mm[1]

    def fitted(
        self, k: int, shown: NDArray[np.float64], graph: Lattice, below: NDArray[np.float64] | None = None,
        look: Look | None = None,
    ) -> Fitted:  # fmt: skip
        """Train the network of a slice, a smaller one where the inputs are few; one that follows another begins there.

        One that follows another has its own place near the other's.
        """
        settings, rng = self.settings, np.random.default_rng([self.seed, self.first + k])
        if len(shown) < SIDES_EACH * len(graph) and settings.neurons_follow:
            graph, below = lattice("ring", len(shown) // SIDES_EACH), None
        if below is not None and settings.radius is None:
            _, last = radii(shown, graph, settings, self.pixel_area)
            settings = replace(settings, radius=(max(NEAR, last), last))
        return fit(shown, graph, settings, rng, pixel_area=self.pixel_area, start=below, look=look)

    def spaced(self, fitted: Fitted, graph: Lattice) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the neurons in pixels, and which edges bridge gaps; rings unshrunk, lines evenly spaced if asked for.

        A ring that was trained with fewer neurons than there are in `graph` gets as many along its curve.
        """
        settings, codebook = self.settings, np.ascontiguousarray(fitted.codebook[:, :2])
        own = of_size(graph, len(codebook))
        gaps = bridged_edges(codebook, own, settings.bridge)
        ring = graph.name == "ring"
        if ring and settings.training == "batch" and shape_of(settings) == GAUSSIAN:
            codebook = unshrunk(codebook, gaps, fitted.radius, self._half_width(fitted, gaps))
        if ring and (settings.even or own is not graph):
            codebook, gaps = evened(codebook, gaps, len(graph))
        elif settings.even:
            codebook, gaps = even_spacing(codebook, graph, gaps)
        return codebook / self.pixel_mm, gaps

    def _half_width(self, fitted: Fitted, gaps: NDArray[np.bool_]) -> float:
        """Return half the width of the band that the inputs of a ring fill: their area over the ring's length."""
        length = float(side_lengths(fitted.codebook[:, :2])[~gaps].sum())
        return float(fitted.kept.sum()) * self.pixel_area / (2 * self.times_shown * max(length, 1e-300))

    @property
    def network(self) -> Lattice:
        """The network of every slice."""
        settings = self.settings
        return lattice(settings.topology, self.enough() if settings.neurons_follow else settings.neuron_count)

    def least(self, graph: Lattice) -> int:
        """Return how many inputs a slice needs for a network."""
        return SIDES_EACH * FEWEST if self.settings.neurons_follow else len(graph)

    def enough(self) -> int:
        """Return how many neurons a ring needs to follow the outlines of all slices; see `neurons_for`.

        Some slices are looked at, evenly spaced: a ring of `IN_SLICE` is trained on each, and the one that it asks for
        where that is much larger, for it may show bends which the first could not.
        """
        full = np.flatnonzero(areas_of(self.mask))
        some = full[np.linspace(0, len(full) - 1, min(LOOKED_AT, len(full))).round().astype(int)]
        return max([FEWEST, *(self._wanted_on(int(k)) for k in some)])

    def _wanted_on(self, k: int) -> int:
        shown = self.shown(k)
        count, most = 0, min(MOST_NEURONS, len(shown) // SIDES_EACH)
        asked = min(IN_SLICE, most)
        while asked >= FEWEST and asked > MUCH * count:
            count, graph = asked, lattice("ring", asked)
            ring, gaps = self.spaced(self.fitted(k, shown, graph), graph)
            asked = min(neurons_for(ring * self.pixel_mm, gaps, min(self.pixel_mm)), most)
        return asked


def of_size(graph: Lattice, neurons: int) -> Lattice:
    """Return the network of a slice: the study's, or a ring of fewer neurons where its inputs are few."""
    return graph if neurons == len(graph) else lattice("ring", neurons)


def neurons_for(ring: NDArray[np.float64], gaps: NDArray[np.bool_], pixel: float) -> int:
    """Return how many neurons follow the line of a ring (u, 2) to a `CHORD` of a pixel.

    A chord of length s on curvature c is s^2 c / 8 off in its middle; from the cubic through the neurons around it,
    that is a sixteenth of what the two outer ones lack. So n neurons in place of u are off by (u / n)^2 as much. The
    bends that `REST` of the line leave out are corners, which no number follows.
    """
    off = (ring + np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0) - np.roll(ring, -2, axis=0)) / 16
    near = gaps | np.roll(gaps, 1) | np.roll(gaps, -1)
    lengths = np.sqrt((off**2).sum(axis=1))[~near]
    if len(lengths) == 0:
        return len(ring)
    return int(np.ceil(len(ring) * np.sqrt(float(np.quantile(lengths, 1 - REST)) / (CHORD * pixel))))


@dataclass(frozen=True)
class ByLayer:
    """The window of each layer of the voxels that are kept, (K, J, I, L), made as it is asked for."""

    volume: Volume
    mask: Sliced
    lower: Limit
    upper: Limit

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes K, J, I, L."""
        return (*self.volume.shape, self.volume.layers)

    def __getitem__(self, slices: int | slice) -> NDArray[np.bool_]:
        """Return a slice, or those of a range."""
        if not isinstance(slices, slice):
            return np.asarray(self[slices : slices + 1][0])
        start, stop, _ = slices.indices(self.shape[0])
        some = replace(self.volume, voxels=some_of(self.volume.voxels, start, stop))
        kept = by_layer(some, lower=self.lower, upper=self.upper)
        return np.asarray(kept & some_of(self.mask, start, stop)[..., None])


def _times_shown(layers: Sliced) -> float:
    shown = pixels = 0
    for start, stop in parts_of(layers):
        some = some_of(layers, start, stop)
        shown, pixels = shown + int(some.sum()), pixels + int(some.any(axis=-1).sum())
    return float(shown) / max(float(pixels), 1.0)
