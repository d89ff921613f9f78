"""The compiled loops of the self-organising map against the definition, written out slowly."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import shortest_path

from conftest import law, seeds, size
from tomomesh.errors import UsageError
from tomomesh.kernels import som as kernels
from tomomesh.model.lattice import Lattice, lattice
from tomomesh.segment.som import match

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

TOPOLOGIES = ["chain", "ring", "grid"]
topologies = st.sampled_from(TOPOLOGIES)


def online(codebook: Floats, shown: Floats, graph: Lattice, alpha: Floats, radius: Floats, gaussian: bool) -> Floats:
    """Present inputs one by one: eq. 1 and 2 as they are printed, for (u, d) neurons."""
    m = codebook.copy()
    for x, rate, reach in zip(shown, alpha, radius, strict=True):
        c = int(np.argmin([np.linalg.norm(x - neuron) for neuron in m]))
        for i in range(len(m)):
            hops = graph.hops[c, i]
            h = np.exp(-0.5 * (hops / reach) ** 2) if gaussian else float(hops <= reach)
            m[i] += rate * h * (x - m[i])
    return m


def batch(codebook: Floats, inputs: Floats, hops: NDArray[np.int32], weights: Floats) -> Floats:
    """Move every neuron to the weighted mean of the inputs, for (u, d) neurons and (n, d) inputs."""
    m = codebook.copy()
    for by_hop in weights:
        distance = np.linalg.norm(inputs[:, None] - m, axis=2)
        h = by_hop[hops[:, distance.argmin(axis=1)]]
        reached = h.sum(axis=1)
        mean = (h @ inputs) / np.where(reached > 0, reached, 1)[:, None]
        m = np.where(reached[:, None] > 0, mean, m)
    return m


def made(seed: int, name: str, d: int, n: int) -> tuple[Lattice, Floats, Floats, np.random.Generator]:
    """Draw neurons and inputs."""
    rng = np.random.default_rng(seed)
    graph = lattice(name, int(rng.integers(3, 30)))
    return graph, rng.normal(size=(len(graph), d)) * 5, rng.normal(size=(n, d)) * 5, rng


class TestOnline:
    @law(40)
    @given(seed=seeds, name=topologies, d=st.integers(2, 3), gaussian=st.booleans())
    def test_is_the_definition(self, seed: int, name: str, d: int, gaussian: bool) -> None:
        graph, start, shown, rng = made(seed, name, d, 60)
        alpha, radius = rng.uniform(0, 0.1, 60), rng.uniform(0.5, len(graph) / 2, 60)
        codebook = start.T.copy(order="C")
        kernels.train_online(codebook, shown, graph.hops, graph.nearest_first, graph.within, alpha, radius, gaussian)
        wanted = online(start, shown, graph, alpha, radius, gaussian)
        np.testing.assert_allclose(codebook.T, wanted, rtol=0, atol=1e-6 if gaussian else 1e-12)

    @pytest.mark.parametrize("gaussian", [False, True])
    def test_the_lowest_of_equal_neurons_wins(self, gaussian: bool) -> None:
        graph, codebook = lattice("chain", 4), np.array([[3.0, 1.0, -1.0, 1.0], [0.0, 0.0, 0.0, 0.0]])
        narrow = np.array([0.01])
        order = (graph.hops, graph.nearest_first, graph.within)
        kernels.train_online(codebook, np.zeros((1, 2)), *order, np.ones(1), narrow, gaussian)
        np.testing.assert_array_equal(codebook[0], [3.0, 0.0, -1.0, 1.0])


class TestBatch:
    @law(60)
    @given(seed=seeds, name=topologies, d=st.integers(2, 3), sigma=st.floats(0.3, 6))
    def test_is_the_definition(self, seed: int, name: str, d: int, sigma: float) -> None:
        graph, start, inputs, _ = made(seed, name, d, 100)
        fall = sigma * np.array([[1.0], [0.7], [0.4]])
        weights = np.exp(-0.5 * (np.arange(graph.hops.max() + 1) / fall) ** 2)
        codebook = start.T.copy(order="C")
        kernels.train_batch(codebook, np.ascontiguousarray(inputs.T), graph.hops, weights)
        np.testing.assert_allclose(codebook.T, batch(start, inputs, graph.hops, weights), rtol=0, atol=1e-9)

    def test_a_neuron_that_nothing_reaches_stays(self) -> None:
        codebook = np.array([[0.0, 10.0, 20.0], [0.0, 0.0, 0.0]])
        weights = np.array([[1.0, 0.0, 0.0]])
        kernels.train_batch(codebook, np.array([[1.0, 3.0], [0.0, 0.0]]), lattice("chain", 3).hops, weights)
        np.testing.assert_array_equal(codebook[0], [2.0, 10.0, 20.0])


class TestMatch:
    @law(60)
    @given(seed=seeds, d=st.integers(2, 4), n=st.sampled_from([1, 511, 512, 513, 1300]), whole=st.booleans())
    def test_is_the_nearest_and_of_equals_the_lowest(self, seed: int, d: int, n: int, whole: bool) -> None:
        rng, n = np.random.default_rng(seed), min(n, size(1300, 513))
        codebook, inputs = rng.normal(size=(9, d)) * 3, rng.normal(size=(n, d)) * 3
        if whole:  # many exact ties
            codebook, inputs = np.round(codebook), np.round(inputs)
        winners, squared = match(np.ascontiguousarray(codebook.T), np.ascontiguousarray(inputs.T))
        wanted = ((inputs[:, None] - codebook) ** 2).sum(axis=2)
        np.testing.assert_allclose(squared, wanted.min(axis=1), rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(wanted[np.arange(n), winners], wanted.min(axis=1), rtol=1e-5, atol=1e-5)
        if whole:
            np.testing.assert_array_equal(winners, wanted.argmin(axis=1))


class TestLattice:
    @pytest.mark.parametrize("name", TOPOLOGIES)
    @pytest.mark.parametrize("neurons", [3, 4, 7, 12, 58, 80, 97])
    def test_hops_are_the_shortest_paths_along_the_edges(self, name: str, neurons: int) -> None:
        graph = lattice(name, neurons)
        links = coo_array((np.ones(len(graph.edges)), tuple(graph.edges.T)), shape=(neurons, neurons))
        paths = shortest_path(links.tocsr(), directed=False, unweighted=True)
        np.testing.assert_array_equal(graph.hops, paths)

    @pytest.mark.parametrize("name", TOPOLOGIES)
    @pytest.mark.parametrize("neurons", [3, 12, 97])
    def test_has_its_neurons_and_each_edge_once(self, name: str, neurons: int) -> None:
        graph = lattice(name, neurons)
        assert len(graph) == np.prod(graph.shape) == neurons
        assert len({frozenset(edge) for edge in graph.edges.tolist()}) == len(graph.edges)

    def test_a_grid_is_as_square_as_it_can_be(self) -> None:
        assert sorted(lattice("grid", 60).shape) == [6, 10]

    def test_refuses_what_there_is_not(self) -> None:
        with pytest.raises(UsageError, match="chain"):
            lattice("moebius", 5)
