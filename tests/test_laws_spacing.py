"""r, the edge of the cubes, in both readings of the paper: from the definition, and what it promises of the cubes."""

from __future__ import annotations

import math
from itertools import pairwise
from statistics import median
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from tomomesh.model.lattice import lattice
from tomomesh.model.networks import Networks
from tomomesh.model.volume import Volume
from tomomesh.segmentation.sample import sample

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.model.points import PointSet

    Stack = tuple[Networks, Volume]

NEURONS = 11
SPACING = (0.5, 0.8, 2.0)


def stack(seed: int, *, shift: float, name: str = "ring") -> Stack:
    """Return lines of 11 neurons on two to five slices, one or two apart, each moved by up to `shift` mm."""
    rng = np.random.default_rng(seed)
    slices = np.cumsum(rng.integers(1, 3, rng.integers(2, 6))).astype(np.int32)
    angle = 2 * np.pi * np.arange(NEURONS) / NEURONS
    round_ = np.column_stack([np.cos(angle), np.sin(angle)])
    places = rng.uniform(8, 12, (len(slices), 1, 1)) * round_ + rng.uniform(-1, 1, (len(slices), NEURONS, 2))
    places += rng.uniform(-shift, shift, (len(slices), 1, 2))
    return of(name, places, slices)


def of(name: str, places: NDArray[np.float64], slices: NDArray[np.int32]) -> Stack:
    """Return networks whose neurons (s, u, 2) are given in millimeters, without bridged gaps."""
    graph = lattice(name, places.shape[1])
    none, bridged = np.zeros(len(slices), np.int64), np.zeros((len(slices), len(graph.edges)), bool)
    networks = Networks(graph, slices, places / np.array(SPACING[:2]), bridged, False, none, none)
    return networks, Volume.from_stored(np.zeros((int(slices[-1]) + 1, 9, 9)), np.diag([*SPACING, 1.0]))


def along(made: Stack) -> list[tuple[int, int]]:
    """Return the pairs of neurons that follow each other on a line, numbered slice by slice."""
    ring = made[0].lattice.name == "ring"
    on_slice = [(n, (n + 1) % NEURONS) for n in range(NEURONS if ring else NEURONS - 1)]
    return [(k * NEURONS + a, k * NEURONS + b) for k in range(len(made[0].slices)) for a, b in on_slice]


def to_next_slice(points: PointSet) -> list[float]:
    """Return how far each point of a line is from the nearest of either slice beside it, or of what fills between."""
    rows = list(zip(points.slices.tolist(), points.neurons.tolist(), points.positions.tolist(), strict=True))
    used = sorted({at for at, neuron, _ in rows if neuron >= 0})
    pairs = {pair for low, high in pairwise(used) for pair in ((low, high), (high, low))}
    return [
        min(
            math.dist(place, b)
            for there, other, b in rows
            if (other >= 0 and there == to) or (other < 0 and min(here, to) <= there <= max(here, to))
        )
        for here, to in sorted(pairs)
        for at, neuron, place in rows
        if at == here and neuron >= 0
    ]


def to_nearest(points: PointSet) -> list[float]:
    """Return how far each neuron is from the one nearest to it."""
    places = points.positions[points.neurons >= 0].tolist()
    return [min(math.dist(a, b) for m, b in enumerate(places) if m != n) for n, a in enumerate(places)]


def cells(points: PointSet, edge: float) -> NDArray[np.int64]:
    """Return the cube of edge r of each neuron."""
    return np.asarray(np.floor(points.positions[points.neurons >= 0] / edge * (1 - 1e-12)), np.int64)


class TestAdjacent:
    @law(80)
    @given(
        seed=seeds, shift=st.sampled_from([0.0, 4.0, 12.0]), caps=st.booleans(), name=st.sampled_from(["ring", "chain"])
    )
    def test_is_the_widest_distance_along_a_line_between_slices_and_to_the_next(
        self, seed: int, shift: float, caps: bool, name: str
    ) -> None:
        networks, volume = made = stack(seed, shift=shift, name=name)
        found = sample(networks, volume, caps=caps, bridge=0.0)
        places = found.points.positions
        in_line = max(math.dist(places[a], places[b]) for a, b in along(made))
        between = max(np.diff(networks.slices).tolist()) * SPACING[2]
        assert found.spacing_mm == pytest.approx(max(in_line, between, *to_next_slice(found.points)), rel=1e-12)

    @law(60)
    @given(seed=seeds, limit=st.sampled_from([1.2, 2.0, 3.0]))
    def test_leaves_gaps_to_the_next_slice_over_so_many_medians_to_the_closing(self, seed: int, limit: float) -> None:
        networks, volume = made = stack(seed, shift=12.0)
        found = sample(networks, volume, caps=False, bridge=limit)
        gaps = to_next_slice(found.points)
        usual = [gap for gap in gaps if gap <= limit * median(gaps)]
        places = found.points.positions
        in_line = max(math.dist(places[a], places[b]) for a, b in along(made))
        between = max(np.diff(networks.slices).tolist()) * SPACING[2]
        assert found.spacing_mm == pytest.approx(max(in_line, between, *usual), rel=1e-12)

    def test_of_rings_that_lie_apart_is_the_way_across(self) -> None:
        """0.5 and 1 mm along the lines, 2 mm between the slices, 5.4 mm from one ring to the other."""
        angle = 2 * np.pi * np.arange(60) / 60
        ring = 5 * np.column_stack([np.cos(angle), np.sin(angle)])
        networks, volume = of("ring", np.stack([ring, 2 * ring]), np.array([0, 1], np.int32))
        assert sample(networks, volume, caps=False).spacing_mm == pytest.approx(math.hypot(5, 2), rel=1e-12)
        assert sample(networks, volume, caps=False, cell_from="nearest").spacing_mm == pytest.approx(
            2 * 10 * math.sin(math.pi / 60), rel=1e-12
        )

    @law(60)
    @given(seed=seeds, shift=st.sampled_from([0.0, 4.0, 12.0]))
    def test_lays_neighbors_into_one_cube_or_into_neighboring_ones(self, seed: int, shift: float) -> None:
        """The paper's promise of e = r, along lines and from slice to slice."""
        networks, volume = made = stack(seed, shift=shift)
        found = sample(networks, volume, caps=False, bridge=0.0)
        cubes = cells(found.points, found.spacing_mm)
        assert max(np.abs(cubes[a] - cubes[b]).max() for a, b in along(made)) <= 1
        for low, high in pairwise(networks.slices):
            here, there = (cubes[found.points.slices == k] for k in (low, high))
            apart = np.abs(here[:, None] - there).max(axis=2)
            assert apart.min(axis=1).max() <= 1
            assert apart.min(axis=0).max() <= 1


class TestNearest:
    @law(80)
    @given(
        seed=seeds, shift=st.sampled_from([0.0, 4.0, 12.0]), caps=st.booleans(), name=st.sampled_from(["ring", "chain"])
    )
    def test_is_the_widest_distance_of_a_neuron_to_the_one_nearest_to_it(
        self, seed: int, shift: float, caps: bool, name: str
    ) -> None:
        networks, volume = stack(seed, shift=shift, name=name)
        found = sample(networks, volume, caps=caps, bridge=0.0, cell_from="nearest")
        assert found.spacing_mm == pytest.approx(max(to_nearest(found.points)), rel=1e-12)
        assert found.spacing_mm <= sample(networks, volume, caps=caps, bridge=0.0).spacing_mm

    @law(40)
    @given(seed=seeds)
    def test_lays_each_neuron_beside_the_one_nearest_to_it(self, seed: int) -> None:
        networks, volume = stack(seed, shift=4.0)
        found = sample(networks, volume, caps=False, cell_from="nearest")
        cubes, places = cells(found.points, found.spacing_mm), found.points.positions
        for n, place in enumerate(places):
            away = np.linalg.norm(places - place, axis=1)
            away[n] = np.inf
            assert np.abs(cubes[n] - cubes[away.argmin()]).max() <= 1

    def test_of_neurons_that_all_lie_on_another_is_that_of_the_slices(self) -> None:
        pile = np.zeros((2, NEURONS, 2))
        networks, volume = of("ring", pile, np.array([0, 2], np.int32))
        assert sample(networks, volume, caps=False, cell_from="nearest").spacing_mm == 4.0
