"""Lines in a slice: polygons against other people's, even steps, and gaps that stay gaps."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.path import Path

from conftest import law, seeds
from tomomesh.measure.polygon import area, distance, inside, inside_lattice, lattice_over
from tomomesh.model.lattice import lattice
from tomomesh.model.networks import Networks
from tomomesh.model.points import BRIDGE, CAP, NEURON
from tomomesh.model.volume import Volume
from tomomesh.segmentation.sample import Sampling, sample
from tomomesh.som.even_spacing import bridged_edges, even_spacing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@st.composite
def rings(draw: st.DrawFn, most: int = 40) -> Floats:
    """Draw a ring around the origin that does not cross itself, with uneven steps."""
    rng = np.random.default_rng(draw(seeds))
    steps = rng.uniform(0.2, 1.0, draw(st.integers(8, most)))
    angle = 2 * np.pi * np.cumsum(steps) / steps.sum()
    radius = rng.uniform(5, 10) + rng.uniform(-1, 1, len(angle))
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def along(line: Floats) -> Floats:
    """Return the distance of each vertex of an open line from the first, along it."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def places_on(line: Floats, points: Floats) -> Floats:
    """Return how far along an open line its points lie; they must lie on it, in order."""
    reached, found, least = along(line), [], 0.0
    for point in points:
        a, step = line[:-1], np.diff(line, axis=0)
        length = np.maximum((step**2).sum(axis=1), 1e-300)
        share = np.clip(((point - a) * step).sum(axis=1) / length, 0, 1)
        off = np.linalg.norm(point - a - share[:, None] * step, axis=1)
        places = reached[:-1] + share * np.sqrt(length)
        on = places[(off < 1e-9) & (places >= least - 1e-9)]
        assert len(on)
        least = on.min()
        found.append(least)
    return np.array(found)


class TestPolygon:
    @law(80)
    @given(ring=rings(), seed=seeds)
    def test_inside_is_matplotlib_s(self, ring: Floats, seed: int) -> None:
        points = np.random.default_rng(seed).uniform(-12, 12, (100, 2))
        np.testing.assert_array_equal(inside(ring, points), Path(ring).contains_points(points))
        np.testing.assert_array_equal(inside(ring[::-1], points), inside(ring, points))

    @law(80)
    @given(ring=rings(), seed=seeds)
    def test_distance_is_that_of_a_fine_line(self, ring: Floats, seed: int) -> None:
        points = np.random.default_rng(seed).uniform(-12, 12, (10, 2))
        share = np.linspace(0, 1, 400, endpoint=False)[:, None]
        closed = np.concatenate([ring, ring[:1]])
        fine = np.concatenate([a + share * (b - a) for a, b in pairwise(closed)])
        brute = np.linalg.norm(points[:, None] - fine, axis=2).min(axis=1)
        found = distance(ring, points)
        assert (found <= brute + 1e-12).all()
        np.testing.assert_allclose(found, brute, atol=0.05)

    @law(80)
    @given(ring=rings(), shift=st.floats(-50, 50), factor=st.floats(0.1, 10))
    def test_area_is_signed_and_scales(self, ring: Floats, shift: float, factor: float) -> None:
        triangles = _fan_area(ring)
        assert area(ring) == pytest.approx(triangles)
        assert area(ring) > 0
        assert area(ring[::-1]) == pytest.approx(-area(ring))
        assert area(ring * factor + shift) == pytest.approx(area(ring) * factor**2, rel=1e-6)

    @law(40)
    @given(ring=rings(), spacing=st.floats(0.3, 3))
    def test_lattice_fills_the_ring(self, ring: Floats, spacing: float) -> None:
        x, y = lattice_over(ring, spacing)
        places = np.stack(np.meshgrid(x, y), axis=-1)
        found = inside_lattice(ring, x, y)
        np.testing.assert_array_equal(found.ravel(), inside(ring, places.reshape(-1, 2)))
        lattice_points = places[found]
        length = along(np.concatenate([ring, ring[:1]]))[-1]
        assert abs(len(lattice_points) * spacing**2 - area(ring)) <= 1.5 * spacing * length
        if len(lattice_points) > 1:
            steps = (lattice_points - lattice_points[0]) / spacing
            np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)


def _fan_area(ring: Floats) -> float:
    """Add up the triangles from the origin."""
    after = np.roll(ring, -1, axis=0)
    return float(sum(0.5 * np.linalg.det(np.stack(pair)) for pair in zip(ring, after, strict=True)))


class TestEvenSpacing:
    @law(80)
    @given(ring=rings())
    def test_a_ring_gets_equal_steps_along_its_line(self, ring: Floats) -> None:
        graph = lattice("ring", len(ring))
        even, gaps = even_spacing(ring, graph, np.zeros(len(ring), bool))
        closed = np.concatenate([ring, ring[:1]])
        np.testing.assert_array_equal(even[0], ring[0])
        wanted = np.arange(len(ring)) * along(closed)[-1] / len(ring)
        np.testing.assert_allclose(places_on(closed, even), wanted, atol=1e-8)
        assert not gaps.any()

    @law(80)
    @given(ring=rings())
    def test_a_chain_keeps_its_ends(self, ring: Floats) -> None:
        even, _ = even_spacing(ring, lattice("chain", len(ring)), np.zeros(len(ring) - 1, bool))
        np.testing.assert_allclose(even[[0, -1]], ring[[0, -1]], atol=1e-12)
        np.testing.assert_allclose(places_on(ring, even), np.linspace(0, along(ring)[-1], len(ring)), atol=1e-8)

    @law(80)
    @given(ring=rings(), name=st.sampled_from(["chain", "ring"]), seed=seeds)
    def test_gaps_keep_their_ends(self, ring: Floats, name: str, seed: int) -> None:
        graph, rng = lattice(name, len(ring)), np.random.default_rng(seed)
        gaps = np.zeros(len(graph.edges), bool)
        gaps[rng.choice(len(gaps), 2, replace=False) if rng.random() < 0.5 else rng.integers(len(gaps))] = True
        even, moved = even_spacing(ring, graph, gaps)
        assert even.shape == ring.shape
        assert moved.sum() == gaps.sum()
        before = {frozenset(map(tuple, np.round(ring[e], 9).tolist())) for e in graph.edges[gaps]}
        after = {frozenset(map(tuple, np.round(even[e], 9).tolist())) for e in graph.edges[moved]}
        lonely = min(*_arcs(gaps, name), *_arcs(moved, name)) < 2
        assert lonely or before == after

    @law(40)
    @given(ring=rings(), turn=st.integers(0, 39), seed=seeds)
    def test_a_turned_ring_with_a_gap_gives_the_turned_ring(self, ring: Floats, turn: int, seed: int) -> None:
        graph, gaps = lattice("ring", len(ring)), np.zeros(len(ring), bool)
        gaps[np.random.default_rng(seed).integers(len(ring))] = True
        even, moved = even_spacing(ring, graph, gaps)
        other, also = even_spacing(np.roll(ring, turn, axis=0), graph, np.roll(gaps, turn))
        np.testing.assert_allclose(np.roll(even, turn, axis=0), other, atol=1e-12)
        np.testing.assert_array_equal(np.roll(moved, turn), also)

    def test_leaves_a_grid_alone(self) -> None:
        codebook = np.random.default_rng(0).random((12, 2))
        even, _ = even_spacing(codebook, lattice("grid", 12), np.zeros(17, bool))
        assert even is codebook

    @pytest.mark.parametrize("name", ["chain", "ring"])
    def test_keeps_neurons_that_have_fallen_together(self, name: str) -> None:
        """Without any length to share, every neuron still stays where it is."""
        graph, pile = lattice(name, 10), np.repeat([[0.0, 0.0], [5.0, 0.0]], 5, axis=0)
        even, moved = even_spacing(pile, graph, bridged_edges(pile, graph, 2.0))
        np.testing.assert_array_equal(even, pile)
        np.testing.assert_array_equal(moved, bridged_edges(pile, graph, 2.0))

    def test_finds_a_gap_by_its_length(self) -> None:
        line = np.column_stack([[0.0, 1, 2, 3, 9, 10, 11], np.zeros(7)])
        graph = lattice("chain", 7)
        assert np.flatnonzero(bridged_edges(line, graph, 2.0)).tolist() == [3]
        assert not bridged_edges(line, graph, 0.0).any()
        assert not bridged_edges(line, graph, 6.0).any()


def _arcs(gaps: NDArray[np.bool_], name: str) -> list[int]:
    """Return how many neurons lie between one gap and the next."""
    at = np.flatnonzero(gaps)
    ends = [-1, *at, len(gaps)] if name == "chain" else [*at, at[0] + len(gaps)]
    return [int(after - before) for before, after in pairwise(ends)]


def stack(rings_: list[Floats], slices: list[int], spacing: tuple[float, float, float]) -> tuple[Networks, Volume]:
    """Return networks whose rings are given in millimeters, and the volume they belong to."""
    graph = lattice("ring", len(rings_[0]))
    codebooks = np.stack(rings_) / spacing[:2]
    gaps = np.stack([bridged_edges(ring, graph, 2.0) for ring in rings_])
    count = len(rings_)
    none = np.zeros(count, np.int64)
    networks = Networks(graph, np.array(slices, np.int32), codebooks, gaps, False, none, none)
    return networks, Volume.from_stored(np.zeros((max(slices) + 1, 9, 9)), np.diag([*spacing, 1.0]))


def circle(radius: float, count: int = 60, start: float = 0.0, turn: float = 1.0) -> Floats:
    angle = start + 2 * np.pi * turn * np.arange(count) / count
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def sampled(rings_: list[Floats], slices: list[int], **kind: float) -> Sampling:
    networks, volume = stack(rings_, slices, (0.5, 0.8, 2.0))
    return sample(networks, volume, **kind)  # type: ignore[arg-type]


class TestSample:
    def test_places_every_neuron_in_its_slice(self) -> None:
        found = sampled([circle(20.0), circle(22.0)], [3, 4]).points
        neurons = found.kinds == NEURON
        assert neurons.sum() == 120
        np.testing.assert_allclose(found.positions[neurons][:60, :2], circle(20.0), atol=1e-12)
        np.testing.assert_allclose(found.positions[neurons][:, 2], np.repeat([6.0, 8.0], 60))
        np.testing.assert_array_equal(found.neurons[neurons], np.tile(np.arange(60), 2))
        assert (found.neurons[~neurons] == -1).all()

    def test_samples_a_bridged_gap_as_densely_as_the_rest(self) -> None:
        arc = circle(20.0, turn=0.75)
        found = sampled([arc], [0], caps=False)
        step = np.linalg.norm(arc[1] - arc[0])
        bridge = found.points.positions[found.points.kinds == BRIDGE][:, :2]
        line = np.concatenate([arc[-1:], bridge, arc[:1]])
        steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
        np.testing.assert_allclose(steps, steps[0])
        assert 0.9 * step < steps[0] <= step * (1 + 1e-9)
        np.testing.assert_allclose(places_on(arc[[-1, 0]], bridge), np.cumsum(steps)[:-1])
        assert found.bridged == 1

    def test_leaves_an_even_ring_without_bridges(self) -> None:
        found = sampled([circle(20.0)], [0], caps=False)
        assert found.bridged == 0
        assert (found.points.kinds == NEURON).all()

    def test_closes_both_ends_and_nothing_between(self) -> None:
        found = sampled([circle(20.0)] * 4, [1, 2, 3, 4])
        caps = found.points.positions[found.points.kinds == CAP]
        assert set(caps[:, 2]) == {2.0, 8.0}
        assert (np.hypot(caps[:, 0], caps[:, 1]) < 20).all()
        for z in (2.0, 8.0):
            count = (caps[:, 2] == z).sum()
            assert count * found.spacing_mm**2 == pytest.approx(np.pi * 20**2, rel=0.25)

    def test_closes_the_step_from_a_wide_ring_to_a_narrow_one(self) -> None:
        found = sampled([circle(20.0), circle(20.0), circle(9.0), circle(9.0)], [0, 1, 2, 3])
        step = found.points.positions[found.points.kinds == BRIDGE]
        far = np.hypot(step[:, 0], step[:, 1])
        assert len(step) > 0
        assert far.min() > 9
        assert far.max() < 20
        np.testing.assert_allclose(step[:, 2], 2 + 2 * (20 - far) / 11, atol=0.1)

    @pytest.mark.parametrize(("gap", "closed"), [(2, {0.0, 2.0, 6.0, 8.0} - {2.0, 6.0}), (3, {0.0, 2.0, 8.0, 10.0})])
    def test_one_slice_without_a_network_is_bridged_and_two_are_not(self, gap: int, closed: set[float]) -> None:
        found = sampled([circle(20.0)] * 4, [0, 1, 1 + gap, 2 + gap])
        assert set(found.points.positions[found.points.kinds == CAP][:, 2]) == closed

    def test_knows_the_widest_gap_and_the_area_of_each_ring(self) -> None:
        found = sampled([circle(20.0), circle(21.0)], [0, 1], caps=False)
        assert found.spacing_mm >= max(2.0, float(np.linalg.norm(circle(21.0)[1] - circle(21.0)[0])))
        np.testing.assert_allclose(found.ring_area_mm2, [area(circle(20.0)), area(circle(21.0))])
        np.testing.assert_allclose(found.distance_mm, [0.0, 2.0])
