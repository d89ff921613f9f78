"""Measures of networks against their definitions, written out, and on networks whose answer is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from tomomesh.errors import UsageError
from tomomesh.model.lattice import TOPOLOGIES, Lattice, lattice
from tomomesh.som.measures import (
    dead_neurons,
    distortion,
    neighborhood_preservation,
    network_measures,
    quantization_error,
    topographic_error,
    topographic_product,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

made_of = st.tuples(seeds, st.sampled_from(TOPOLOGIES), st.sampled_from([1, 2, 3, 11]))


def made(seed: int, name: str, d: int) -> tuple[Floats, Lattice, Floats, Floats]:
    rng = np.random.default_rng(seed)
    graph = lattice(name, int(rng.integers(4, 20)))
    return rng.normal(size=(len(graph), d)), graph, rng.normal(size=(40, d)), rng.uniform(0.1, 2, 40)


def order_of(j: int, first: Floats, second: Floats) -> list[int]:
    return sorted((i for i in range(len(first)) if i != j), key=lambda i: (first[i], second[i]))


def orders(codebook: Floats, graph: Lattice, j: int) -> tuple[list[int], list[int], Floats, Floats]:
    """Return the others from the nearest on, on the graph and among the inputs, with both distances."""
    apart, hops = np.sqrt(((codebook - codebook[j]) ** 2).sum(axis=1)), graph.hops[j].astype(float)
    return order_of(j, hops, apart), order_of(j, apart, hops), apart, hops


class TestDefinitions:
    @law(40)
    @given(case=made_of)
    def test_errors_on_inputs(self, case: tuple[int, str, int]) -> None:
        codebook, graph, inputs, weights = made(*case)
        apart = np.linalg.norm(inputs[:, None] - codebook, axis=2)
        nearest = np.argsort(apart, axis=1, kind="stable")
        share = weights / weights.sum()
        assert quantization_error(codebook, inputs, weights=weights) == pytest.approx(
            (share * apart.min(axis=1)).sum(), rel=1e-4
        )
        torn = graph.hops[nearest[:, 0], nearest[:, 1]] > 1
        assert topographic_error(codebook, graph, inputs, weights=weights) == pytest.approx((share * torn).sum())
        h = np.exp(-0.5 * (graph.hops[nearest[:, 0]] / 1.5) ** 2)
        wanted = (share * (h * apart**2).sum(axis=1)).sum()
        assert distortion(codebook, graph, inputs, radius=1.5, weights=weights) == pytest.approx(wanted, rel=1e-6)
        assert dead_neurons(codebook, inputs) == len(graph) - len(set(nearest[:, 0].tolist()))

    @law(25)
    @given(case=made_of)
    def test_topographic_product(self, case: tuple[int, str, int]) -> None:
        codebook, graph, _, _ = made(*case)
        u, total = len(graph), 0.0
        for j in range(u):
            near_a, near_v, apart, hops = orders(codebook, graph, j)
            for k in range(1, u):
                product = 1.0
                for a, v in zip(near_a[:k], near_v[:k], strict=True):
                    product *= apart[a] / apart[v] * hops[a] / hops[v]
                total += np.log(product ** (1 / (2 * k)))
        assert topographic_product(codebook, graph) == pytest.approx(total / (u * (u - 1)), rel=1e-9, abs=1e-12)

    @law(25)
    @given(case=made_of, k=st.integers(1, 3))
    def test_neighborhood_preservation(self, case: tuple[int, str, int], k: int) -> None:
        codebook, graph, _, _ = made(*case)
        u = len(graph)
        k = min(k, (u - 1) // 2)
        lost = [0, 0]
        for j in range(u):
            near_a, near_v, _, _ = orders(codebook, graph, j)
            lost[0] += sum(near_v.index(i) + 1 - k for i in near_a[:k] if i not in near_v[:k])
            lost[1] += sum(near_a.index(i) + 1 - k for i in near_v[:k] if i not in near_a[:k])
        scale = 2 / (u * k * (2 * u - 3 * k - 1))
        wanted = [1 - scale * loss for loss in lost]
        assert neighborhood_preservation(codebook, graph, neighbors=k) == pytest.approx(wanted)


class TestKnown:
    @pytest.mark.parametrize("name", ["chain", "grid"])
    def test_a_network_at_rest_is_perfect(self, name: str) -> None:
        graph = lattice(name, 36)
        found = network_measures(graph.places, graph, graph.places)
        assert found["dead_neurons"] == 0
        assert found["quantization_error"] == pytest.approx(0, abs=1e-6)
        assert found["topographic_error"] == 0
        assert found["trustworthiness"] > 0.98
        assert found["continuity"] > 0.98
        assert abs(found["topographic_product"]) < 0.02

    def test_a_chain_over_a_square_is_too_thin_and_a_grid_over_a_line_too_thick(self) -> None:
        square = np.stack(np.meshgrid(np.arange(8.0), np.arange(8.0)), axis=-1)
        square[1::2] = square[1::2, ::-1]
        assert topographic_product(square.reshape(-1, 2), lattice("chain", 64)) < -0.02
        line = np.arange(64.0)[:, None]
        assert topographic_product(line, lattice("grid", 64)) > 0.02

    def test_a_shuffled_network_is_worse_on_its_graph_alone(self) -> None:
        graph = lattice("ring", 40)
        order = np.random.default_rng(0).permutation(40)
        inputs = graph.places + 0.01 * np.random.default_rng(1).normal(size=(40, 2))
        good, bad = (network_measures(places, graph, inputs) for places in (graph.places, graph.places[order]))
        assert bad["quantization_error"] == pytest.approx(good["quantization_error"], rel=1e-4)
        assert bad["topographic_error"] > 0.8 > 0.1 > good["topographic_error"]
        assert bad["trustworthiness"] < 0.7 < 0.99 < good["trustworthiness"]
        assert bad["distortion"] > 5 * good["distortion"]

    @pytest.mark.parametrize("neighbors", [0, 20, 30])
    def test_refuses_too_many_neighbors(self, neighbors: int) -> None:
        graph = lattice("ring", 40)
        with pytest.raises(UsageError, match="neighbors"):
            neighborhood_preservation(graph.places, graph, neighbors=neighbors)
