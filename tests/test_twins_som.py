"""The compiled loops of the self-organising map against the definition, written out slowly."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds, size
from tomomesh.kernels.som import batch as batch_kernels
from tomomesh.kernels.som import online as kernels
from tomomesh.kernels.som import products as around
from tomomesh.kernels.som.neighborhoods import BUBBLE, GAUSSIAN, LATERAL, weigh
from tomomesh.kernels.som.search import BLOCK
from tomomesh.model.lattice import TOPOLOGIES, Lattice, lattice
from tomomesh.som import products
from tomomesh.som.inputs import SortedInputs, match

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

Train = Callable[..., int]

topologies = st.sampled_from(TOPOLOGIES)


def follows(shape: int, hops: int, radius: float) -> float:
    """Return the neighborhood as it is described."""
    if shape == GAUSSIAN:
        return float(np.exp(-0.5 * (hops / radius) ** 2)) if hops <= 6 * radius else 0.0
    if hops <= radius:
        return 1.0
    if shape == BUBBLE or hops > 9 * radius:
        return 0.0
    return -0.03 if hops <= 3 * radius else 0.0015


def online(codebook: Floats, shown: Floats, graph: Lattice, alpha: Floats, radius: Floats, shape: int) -> Floats:
    """Present inputs one by one: eq. 1 and 2 as they are printed, for (u, d) neurons."""
    m = codebook.copy()
    for x, rate, reach in zip(shown, alpha, radius, strict=True):
        c = int(np.argmin([np.linalg.norm(x - neuron) for neuron in m]))
        for i in range(len(m)):
            m[i] += rate * follows(shape, int(graph.hops[c, i]), reach) * (x - m[i])
        if shape == LATERAL:
            m = np.clip(m, shown.min(axis=0), shown.max(axis=0))
    return m


def batch(codebook: Floats, inputs: Floats, amounts: Floats, hops: NDArray[np.int32], weights: Floats) -> Floats:
    """Move every neuron to the weighted mean of the inputs, for (u, d) neurons and (n, d) inputs."""
    m = codebook.copy()
    for by_hop in weights:
        distance = np.linalg.norm(inputs[:, None] - m, axis=2)
        h = by_hop[hops[:, distance.argmin(axis=1)]] * amounts
        reached = h.sum(axis=1)
        mean = (h @ inputs) / np.where(reached > 0, reached, 1)[:, None]
        m = np.where(reached[:, None] > 0, np.clip(mean, inputs.min(axis=0), inputs.max(axis=0)), m)
    return m


def made(seed: int, name: str, d: int, n: int) -> tuple[Lattice, Floats, Floats, np.random.Generator]:
    """Draw neurons and inputs."""
    rng = np.random.default_rng(seed)
    graph = lattice(name, int(rng.integers(3, 30)))
    return graph, rng.normal(size=(len(graph), d)) * 5, rng.normal(size=(n, d)) * 5, rng


def box_of(inputs: Floats) -> Floats:
    return np.stack([inputs.min(axis=0), inputs.max(axis=0)])


def train_in_blocks(codebook: Floats, by_axis: Floats, amounts: Floats, *falls: Any) -> int:
    """Train on inputs (d, n) as `products.train_batch` does, by the compiled loops."""
    blocks = SortedInputs.of(by_axis, box_of(by_axis.T))
    return batch_kernels.train_batch(codebook, blocks.places, blocks.boxes, blocks.filled(amounts), *falls)


shapes = st.sampled_from([BUBBLE, GAUSSIAN, LATERAL])


class TestNeighborhood:
    @law(60)
    @given(shape=shapes, radius=st.floats(0.01, 30), scale=st.floats(0.01, 1), most=st.integers(0, 60))
    def test_is_its_description(self, shape: int, radius: float, scale: float, most: int) -> None:
        weight = np.full(most + 1, np.nan)
        reach = weigh(weight, radius, scale, shape)
        wanted = [scale * follows(shape, hops, radius) for hops in range(most + 1)]
        np.testing.assert_allclose(weight[: reach + 1], wanted[: reach + 1], rtol=1e-9)
        assert not any(wanted[reach + 1 :])


class TestOnline:
    @law(60)
    @given(seed=seeds, name=topologies, d=st.integers(2, 4), shape=shapes)
    def test_is_the_definition(self, seed: int, name: str, d: int, shape: int) -> None:
        graph, start, shown, rng = made(seed, name, d, 60)
        alpha, radius = rng.uniform(0, 0.1, 60), rng.uniform(0.5, len(graph) / 2, 60)
        codebook, order = start.T.copy(order="C"), (graph.hops, graph.nearest_first, graph.within)
        kernels.train_online(codebook, shown, *order, alpha, radius, shape, box_of(shown))
        wanted = online(start, shown, graph, alpha, radius, shape)
        np.testing.assert_allclose(codebook.T, wanted, rtol=0, atol=1e-10)

    @pytest.mark.parametrize("shape", [BUBBLE, GAUSSIAN, LATERAL])
    def test_the_lowest_of_equal_neurons_wins(self, shape: int) -> None:
        graph, codebook = lattice("chain", 4), np.array([[3.0, 1.0, -1.0, 1.0], [0.0, 0.0, 0.0, 0.0]])
        narrow, order = np.array([0.01]), (graph.hops, graph.nearest_first, graph.within)
        box = np.array([[-9.0, -9.0], [9.0, 9.0]])
        kernels.train_online(codebook, np.zeros((1, 2)), *order, np.ones(1), narrow, shape, box)
        np.testing.assert_array_equal(codebook[0], [3.0, 0.0, -1.0, 1.0])


class TestBatch:
    @law(60)
    @given(
        seed=seeds, name=topologies, d=st.integers(2, 4), sigma=st.floats(0.3, 6), inhibition=st.sampled_from([0, 0.03])
    )
    @pytest.mark.parametrize("run", [train_in_blocks, products.train_batch])
    def test_is_the_definition(self, run: Train, seed: int, name: str, d: int, sigma: float, inhibition: float) -> None:
        graph, start, inputs, rng = made(seed, name, d, 100)
        fall, amounts = sigma * np.array([[1.0], [0.7], [0.4]]), rng.uniform(0, 2, 100)
        weights = np.exp(-0.5 * (np.arange(graph.hops.max() + 1) / fall) ** 2) - inhibition
        codebook, history = start.T.copy(order="C"), np.empty((3, 2))
        by_axis = np.ascontiguousarray(inputs.T)
        assert run(codebook, by_axis, amounts, graph.hops, weights, box_of(inputs), -1.0, 0, history) == 3
        wanted = [start] + [batch(start, inputs, amounts, graph.hops, weights[: n + 1]) for n in range(3)]
        np.testing.assert_allclose(codebook.T, wanted[-1], rtol=0, atol=1e-9)
        for epoch in range(3):
            nearest = np.linalg.norm(inputs[:, None] - wanted[epoch], axis=2).min(axis=1)
            assert history[epoch, 0] == pytest.approx(np.average(nearest, weights=amounts), rel=1e-4)
            moved = np.linalg.norm(wanted[epoch + 1] - wanted[epoch], axis=1).max()
            assert history[epoch, 1] == pytest.approx(moved, rel=1e-6, abs=1e-9)

    @pytest.mark.parametrize("run", [train_in_blocks, products.train_batch])
    def test_a_neuron_that_nothing_reaches_stays_and_one_at_rest_ends_it(self, run: Train) -> None:
        codebook, history = np.array([[0.0, 10.0, 20.0], [0.0, 0.0, 0.0]]), np.empty((9, 2))
        weights, inputs = np.repeat([[1.0, 0.0, 0.0]], 9, axis=0), np.array([[1.0, 3.0], [0.0, 0.0]])
        box, hops = box_of(inputs.T), lattice("chain", 3).hops
        assert run(codebook, inputs, np.ones(2), hops, weights, box, 0.0, 0, history) == 2
        np.testing.assert_array_equal(codebook[0], [2.0, 10.0, 20.0])
        assert run(codebook, inputs, np.ones(2), hops, weights, box, 0.0, 5, history) == 6


class TestMatch:
    @law(60)
    @given(
        seed=seeds, d=st.sampled_from([2, 3, 4, 20]), n=st.sampled_from([1, 511, 512, 513, 2100]), whole=st.booleans()
    )
    def test_is_the_nearest_and_of_equals_the_lowest(self, seed: int, d: int, n: int, whole: bool) -> None:
        rng, n = np.random.default_rng(seed), min(n, size(2100, 513))
        codebook, inputs = rng.normal(size=(9, d)) * 3, rng.normal(size=(n, d)) * 3
        if whole:  # many exact ties
            codebook, inputs = np.round(codebook), np.round(inputs)
        winners, squared = match(codebook, inputs)
        wanted = ((inputs[:, None] - codebook) ** 2).sum(axis=2)
        np.testing.assert_allclose(squared, wanted.min(axis=1), rtol=1e-4, atol=1e-4)
        np.testing.assert_allclose(wanted[np.arange(n), winners], wanted.min(axis=1), rtol=1e-4, atol=1e-4)
        if whole and d < 9:
            np.testing.assert_array_equal(winners, wanted.argmin(axis=1))


@law(40)
@given(seed=seeds, d=st.integers(9, 40), scale=st.sampled_from([1e-4, 1.0, 1e4]))
def test_near_ties_in_many_dimensions_are_decided_in_double_at_every_scale(seed: int, d: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    apart = rng.normal(size=(12, d))
    codebook = scale * np.concatenate([apart, apart + 1e-7 * rng.normal(size=apart.shape)])
    inputs = scale * (apart[rng.integers(12, size=30)] + 1e-2 * rng.normal(size=(30, d)))
    nearest = [int(((codebook - one) ** 2).sum(axis=1).argmin()) for one in inputs]
    np.testing.assert_array_equal(products.best_matching_units(codebook, inputs)[0], nearest)


@law(40)
@given(seed=seeds, d=st.integers(2, 5), n=st.integers(1, 700), shrunk=st.sampled_from([1e-3, 1.0, 30.0]))
def test_a_block_leaves_out_no_neuron_that_may_win(seed: int, d: int, n: int, shrunk: float) -> None:
    """Many neurons, near each other or far apart, among inputs in clusters: what is found is the nearest of all."""
    rng = np.random.default_rng(seed)
    inputs = rng.normal(size=(7, d))[rng.integers(7, size=n)] + 0.1 * rng.normal(size=(n, d))
    codebook = shrunk * rng.normal(size=(rng.integers(1, 120), d))
    winners, squared = match(codebook, inputs)
    wanted = ((inputs[:, None] - codebook) ** 2).sum(axis=2)
    np.testing.assert_allclose(squared, wanted.min(axis=1), rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(wanted[np.arange(n), winners], wanted.min(axis=1), rtol=1e-5, atol=1e-9)


@law(40)
@given(seed=seeds, n=st.integers(1, 300), d=st.integers(2, 4))
def test_blocks_hold_every_input_once_and_their_boxes_hold_it(seed: int, n: int, d: int) -> None:
    inputs = np.random.default_rng(seed).normal(size=(d, n))
    blocks = SortedInputs.of(inputs, box_of(inputs.T))
    np.testing.assert_array_equal(np.sort(blocks.order[:n]), np.arange(n))
    np.testing.assert_array_equal(blocks.places, inputs[:, blocks.order])
    middle, half = (np.repeat(edge, BLOCK, axis=1) for edge in blocks.boxes)
    assert (np.abs(blocks.places - middle) <= half * (1 + 1e-9) + 1e-12).all()
    assert blocks.filled(None).sum() == n


@law(40)
@given(seed=seeds, n=st.integers(1, 20), u=st.integers(1, 50), rounding=st.sampled_from([0.0, 0.1, 10.0]))
def test_the_highest_scores_and_those_close_to_them(seed: int, n: int, u: int, rounding: float) -> None:
    score = np.round(np.random.default_rng(seed).normal(size=(n, u)), 1).astype(np.float32)
    best, close = np.empty(n, np.int32), np.empty(n, np.int32)
    off = np.full(n, rounding, np.float32)
    around.highest(score, off, best, close)
    np.testing.assert_array_equal(best, score.argmax(axis=1))
    np.testing.assert_array_equal(close, (score >= (score.max(axis=1) - off)[:, None]).sum(axis=1))


@law(20)
@given(seed=seeds, name=topologies, k=st.sampled_from([1, 9, 80, 81, 200]))
def test_shares_are_a_product(seed: int, name: str, k: int) -> None:
    graph, _, _, rng = made(seed, name, 2, 1)
    totals, by_hop = rng.normal(size=(len(graph), k)), np.exp(-np.arange(graph.farthest + 1.0))
    by_hop[2:] = 0.0
    sums = np.empty_like(totals)
    around.add_shares(totals, graph.hops, by_hop, sums)
    np.testing.assert_allclose(sums, by_hop[graph.hops] @ totals, rtol=0, atol=1e-12)
