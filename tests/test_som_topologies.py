"""Topologies: hops are the shortest paths, counted by brute force; closed networks are closed surfaces."""

from __future__ import annotations

from itertools import product
from math import prod
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from tomomesh.errors import UsageError
from tomomesh.measure.topology import topology
from tomomesh.model.graph import lattice_of
from tomomesh.model.lattice import TOPOLOGIES, Lattice, lattice, other_number
from tomomesh.model.mesh import TriMesh

if TYPE_CHECKING:
    from numpy.typing import NDArray


def hops_by_force(edges: NDArray[np.int64], neurons: int) -> NDArray[np.float64]:
    """Shorten paths over every neuron in turn (Floyd & Warshall)."""
    paths = np.where(np.eye(neurons, dtype=bool), 0, np.inf)
    for a, b in edges:
        paths[a, b] = paths[b, a] = min(paths[a, b], 1)
    for via in range(neurons):
        paths = np.minimum(paths, paths[:, [via]] + paths[via])
    return paths


@pytest.mark.parametrize("name", TOPOLOGIES)
@pytest.mark.parametrize("neurons", [3, 4, 7, 12, 58, 80, 97, 162])
class TestNamed:
    def test_hops_are_the_shortest_paths_along_the_edges(self, name: str, neurons: int) -> None:
        graph = lattice(name, neurons)
        np.testing.assert_array_equal(graph.hops, hops_by_force(graph.edges, len(graph)))

    def test_has_its_neurons_once_each_edge_once_and_a_place_for_each(self, name: str, neurons: int) -> None:
        graph = lattice(name, neurons)
        assert len(graph) == prod(graph.shape) == len(graph.places)
        assert len({frozenset(edge) for edge in graph.edges.tolist()}) == len(graph.edges)
        np.testing.assert_allclose(graph.places.mean(axis=0), 0, atol=1e-9)
        assert len(np.unique(graph.places.round(9), axis=0)) == len(graph)

    def test_has_about_as_many_neurons_as_asked(self, name: str, neurons: int) -> None:
        found = len(lattice(name, neurons))
        if name in ("chain", "ring"):
            assert found == neurons
        elif name == "sphere":
            assert abs(found - neurons) == min(abs(10 * f**2 + 2 - neurons) for f in range(1, 9))
        else:
            assert abs(found - neurons) <= max(2, 6 if neurons < 9 else 0)

    def test_orders_and_counts_what_is_near(self, name: str, neurons: int) -> None:
        graph = lattice(name, neurons)
        for own, order, within in zip(graph.hops, graph.nearest_first, graph.within, strict=True):
            assert (np.diff(own[order]) >= 0).all()
            np.testing.assert_array_equal(within, [(own <= hop).sum() for hop in range(graph.farthest + 1)])


def inner_degrees(graph: Lattice) -> set[int]:
    degrees = np.bincount(graph.edges.ravel())
    rows, columns = graph.shape
    row, column = np.divmod(np.arange(len(graph)), columns)
    inner = (row > 0) & (row < rows - 1) & (column > 0) & (column < columns - 1)
    return set(degrees[inner].tolist())


class TestSheets:
    @pytest.mark.parametrize(
        ("asked", "sides"), [(60, (6, 10)), (100, (10, 10)), (58, (7, 8)), (37, (6, 6)), (3, (2, 2))]
    )
    def test_a_grid_is_nearly_square(self, asked: int, sides: tuple[int, int]) -> None:
        graph = lattice("grid", asked)
        assert graph.shape == sides
        assert (other_number(graph, asked) is None) == (prod(sides) == asked)

    @pytest.mark.parametrize("name", ["grid", "hexagonal", "cylinder", "torus", "ring", "sphere"])
    def test_print_in_one_line(self, name: str) -> None:
        told = repr(lattice(name, 42))
        assert "\n" not in told
        assert f"{name} of" in told
        assert "42 neurons" in told

    @pytest.mark.parametrize(("name", "degree"), [("grid", 4), ("hexagonal", 6), ("cylinder", 4), ("torus", 4)])
    def test_have_their_neighbors(self, name: str, degree: int) -> None:
        assert inner_degrees(lattice(name, 0, shape=(6, 7))) == {degree}

    def test_joined_sides_have_no_border(self) -> None:
        assert set(np.bincount(lattice("torus", 0, shape=(5, 8)).edges.ravel()).tolist()) == {4}
        assert sorted(set(np.bincount(lattice("cylinder", 0, shape=(5, 8)).edges.ravel()).tolist())) == [3, 4]

    def test_hexagonal_neighbors_lie_at_one_distance(self) -> None:
        graph = lattice("hexagonal", 0, shape=(5, 6))
        row, column = np.divmod(np.arange(30), 6)
        places = np.stack([column + 0.5 * (row % 2), row * np.sqrt(0.75)], axis=1)
        apart = np.linalg.norm(places[:, None] - places, axis=2)
        np.testing.assert_array_equal(graph.hops == 1, np.isclose(apart, 1))

    @pytest.mark.parametrize(("name", "shape"), [("torus", (2, 9)), ("cylinder", (5, 2)), ("hexagonal", (1, 5))])
    def test_refuse_sides_that_they_cannot_have(self, name: str, shape: tuple[int, int]) -> None:
        with pytest.raises(UsageError, match="sides"):
            lattice(name, 0, shape=shape)

    def test_others_have_no_sides(self) -> None:
        with pytest.raises(UsageError, match="sides"):
            lattice("ring", 6, shape=(2, 3))


class TestClosed:
    @pytest.mark.parametrize("frequency", range(1, 8))
    def test_a_sphere_is_one(self, frequency: int) -> None:
        graph = lattice("sphere", 10 * frequency**2 + 2)
        found = topology(TriMesh(graph.places, graph.faces))
        assert len(graph) == 10 * frequency**2 + 2
        assert len(graph.faces) == 20 * frequency**2
        assert found.sound
        assert (found.genus, found.components, found.inward_components) == (0, 1, 0)
        radius = np.linalg.norm(graph.places, axis=1)
        np.testing.assert_allclose(radius, np.sqrt(3), rtol=1e-9)
        assert np.bincount(np.bincount(graph.edges.ravel()))[5] == 12

    @pytest.mark.parametrize("shape", list(product([3, 4, 7], [3, 8])))
    def test_a_torus_is_one(self, shape: tuple[int, int]) -> None:
        graph = lattice("torus", 0, shape=shape)
        found = topology(TriMesh(graph.places, graph.faces))
        assert found.sound
        assert (found.genus, found.components, found.inward_components) == (1, 1, 0)
        sides = np.concatenate([graph.faces[:, [0, 1]], graph.faces[:, [1, 2]], graph.faces[:, [2, 0]]])
        assert {frozenset(edge) for edge in graph.edges.tolist()} <= {frozenset(side) for side in sides.tolist()}

    @pytest.mark.parametrize("name", ["chain", "ring", "grid", "hexagonal", "cylinder"])
    def test_open_networks_have_no_faces(self, name: str) -> None:
        assert lattice(name, 20).faces.shape == (0, 3)


class TestGraph:
    @law(40)
    @given(seed=seeds, neurons=st.integers(1, 25))
    def test_hops_are_the_shortest_paths(self, seed: int, neurons: int) -> None:
        rng = np.random.default_rng(seed)
        tree = np.array([(node, rng.integers(node)) for node in range(1, neurons)]).reshape(-1, 2)
        edges = np.concatenate([tree, rng.integers(neurons, size=(neurons // 2, 2))]).astype(int)
        graph = lattice_of(edges, neurons)
        np.testing.assert_array_equal(graph.hops, hops_by_force(edges, neurons))
        wanted = {frozenset(edge) for edge in edges.tolist() if edge[0] != edge[1]}
        assert {frozenset(edge) for edge in graph.edges.tolist()} == wanted
        assert len(graph.edges) == len(wanted)

    def test_a_graph_may_be_a_named_network(self) -> None:
        ring = lattice("ring", 12)
        graph = lattice_of(ring.edges, 12)
        np.testing.assert_array_equal(graph.hops, ring.hops)
        radius = np.linalg.norm(graph.places[:, :2], axis=1)
        np.testing.assert_allclose(radius, radius[0], rtol=1e-9)

    @pytest.mark.parametrize(
        ("edges", "neurons"), [([[0, 3]], 3), ([[-1, 0]], 3), ([[0.5, 1]], 2), ([0, 1], 2), ([[0, 1]], 3), ([], 0)]
    )
    def test_refuses_what_is_none(self, edges: list[list[int]], neurons: int) -> None:
        with pytest.raises(UsageError):
            lattice_of(edges, neurons)


def test_refuses_what_there_is_not() -> None:
    with pytest.raises(UsageError, match="chain"):
        lattice("moebius", 5)
