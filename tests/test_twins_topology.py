"""What is counted on a mesh: trimesh agrees on good ones, and every fault that is put in is found."""

from __future__ import annotations

from dataclasses import fields
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage
from skimage import measure

from conftest import law, seeds, size
from tomomesh.errors import InternalCheckError
from tomomesh.measure.links import Links
from tomomesh.measure.shape import areas_and_volumes
from tomomesh.measure.topology import Topology, check_promise, distinct_positions, face_components, topology, welded
from tomomesh.model.mesh import TriMesh

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable

FAULTS = ("boundary_edges", "nonmanifold_edges", "nonmanifold_vertices", "misoriented_edges", "inward_components")


def of(made: trimesh.Trimesh) -> TriMesh:
    return TriMesh(np.array(made.vertices, np.float64), np.array(made.faces, np.int64))


def ball() -> TriMesh:
    return of(trimesh.creation.icosphere(subdivisions=1))


def ring() -> TriMesh:
    return of(trimesh.creation.torus(4.0, 1.0, major_sections=size(24, 12), minor_sections=8))


def beside(mesh: TriMesh, other: TriMesh) -> TriMesh:
    """Put two meshes into one, without joining them."""
    faces = np.concatenate([mesh.faces, other.faces + len(mesh.vertices)])
    return TriMesh(np.concatenate([mesh.vertices, other.vertices]), faces)


def isosurface(seed: int, share: float) -> TriMesh:
    """Wrap the part of a random smooth field that is largest: many pieces, many handles, some cavities."""
    field = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(size(14, 8),) * 3), 1.0)
    field = np.pad(field - np.quantile(field, 1 - share), 1, constant_values=-1.0)
    vertices, faces, _, _ = measure.marching_cubes(field, 0.0)
    return TriMesh(vertices.astype(np.float64), faces.astype(np.int64))


def faults(mesh: TriMesh) -> dict[str, int]:
    """Return the faults that were found, and how many."""
    found = topology(mesh)
    assert tuple(found.faults) == FAULTS
    assert found.sound == (not any(found.faults.values()))
    return {name: count for name, count in found.faults.items() if count}


def groups(members: Iterable[Hashable], links: Iterable[tuple[Hashable, Hashable]]) -> int:
    """Count the sets of members that are joined by links."""
    parent = {one: one for one in members}

    def root(one: Hashable) -> Hashable:
        while parent[one] != one:
            one = parent[one]
        return one

    for a, b in links:
        parent[root(a)] = root(b)
    return len({root(one) for one in parent})


def by_definition(mesh: TriMesh) -> dict[str, int]:
    """Count what makes up a topology, edge by edge."""
    half: dict[frozenset[int], list[tuple[int, int, int]]] = {}
    for face, (a, b, c) in enumerate(mesh.faces.tolist()):
        for start, end in ((a, b), (b, c), (c, a)):
            half.setdefault(frozenset((start, end)), []).append((face, start, end))
    used = set(mesh.faces.ravel().tolist())
    across = [
        ((one[0], vertex), (other[0], vertex))
        for around in half.values()
        for one, other in pairwise(around)
        for vertex in one[1:]
    ]
    corners = [(face, vertex) for face, own in enumerate(mesh.faces.tolist()) for vertex in own]
    borders = [((face, a), (face, b)) for (face, a, b), *others in half.values() if not others]
    touched = [corner for ends in borders for corner in ends]
    return {
        "components": groups(used, [(a, b) for around in half.values() for _, a, b in around[:1]]),
        "euler_number": len(used) - len(half) + len(mesh.faces),
        "boundary_edges": len(borders),
        "nonmanifold_edges": sum(len(around) > 2 for around in half.values()),
        "nonmanifold_vertices": groups(corners, across) - len(used),
        "misoriented_edges": sum(len(around) == 2 and around[0][1] == around[1][1] for around in half.values()),
        "boundary_loops": groups(corners, across + borders)
        - groups(corners, [*across, *borders, *pairwise(touched)])
        + bool(borders),
    }


class TestDefinition:
    @law(100)
    @given(seed=seeds, n=st.integers(3, 12), m=st.integers(1, 25))
    def test_any_faces_are_counted_by_it(self, seed: int, n: int, m: int) -> None:
        rng = np.random.default_rng(seed)
        mesh = TriMesh(rng.normal(size=(n, 3)), np.array([rng.choice(n, 3, replace=False) for _ in range(m)], np.int64))
        found, wanted = topology(mesh), by_definition(mesh)
        assert {name: getattr(found, name) for name in wanted} == wanted

    @law(30)
    @given(seed=seeds, left=st.floats(0.3, 1))
    def test_so_is_a_ring_with_holes(self, seed: int, left: float) -> None:
        mesh = ring()
        kept = np.random.default_rng(seed).random(len(mesh.faces)) < left
        holey = TriMesh(mesh.vertices, mesh.faces[kept])
        found, wanted = topology(holey), by_definition(holey)
        assert {name: getattr(found, name) for name in wanted} == wanted


class TestOpen:
    @pytest.mark.parametrize(("dropped", "loops"), [([0], 1), ([0, 40], 2), ([0, 40, 77], 3)])
    def test_every_hole_is_a_loop(self, dropped: list[int], loops: int) -> None:
        mesh = ring()
        holey = TriMesh(mesh.vertices, np.delete(mesh.faces, dropped, axis=0))
        found = topology(holey)
        assert (found.boundary_edges, found.boundary_loops) == (3 * loops, loops)
        assert (found.genus, found.inward_components) == (1, 0)
        check_promise(holey, open_=True)
        with pytest.raises(InternalCheckError, match="boundary_edges"):
            check_promise(holey)

    def test_two_holes_that_touch_at_a_vertex_are_told(self) -> None:
        mesh = ring()
        around = np.flatnonzero((mesh.faces == mesh.faces[0, 0]).any(axis=1))
        shared = [n for n in around.tolist() if np.isin(mesh.faces[n], mesh.faces[0]).sum() == 1]
        holey = TriMesh(mesh.vertices, np.delete(mesh.faces, np.array([0, shared[0]]), axis=0))
        assert faults(holey) == {"boundary_edges": 6, "nonmanifold_vertices": 1}
        with pytest.raises(InternalCheckError, match="nonmanifold_vertices = 1"):
            check_promise(holey, open_=True)

    def test_an_open_piece_is_never_inward_but_a_flipped_face_is_seen(self) -> None:
        mesh = ball()
        cup = TriMesh(mesh.vertices, mesh.faces[:40, ::-1])
        check_promise(cup, open_=True)
        faces = cup.faces.copy()
        faces[7] = faces[7, ::-1]
        with pytest.raises(InternalCheckError, match="misoriented_edges"):
            check_promise(TriMesh(cup.vertices, faces), open_=True)

    def test_a_closed_piece_must_still_look_outward(self) -> None:
        mesh = ball()
        with pytest.raises(InternalCheckError, match="inward_components"):
            check_promise(TriMesh(mesh.vertices, mesh.faces[:, ::-1]), open_=True)


class TestGood:
    @pytest.mark.parametrize(
        ("mesh", "components", "genus"),
        [
            (ball(), 1, 0),
            (ring(), 1, 1),
            (beside(ball(), ring()), 2, 1),
            (beside(ring(), ring().moved(ring().vertices + 20)), 2, 2),
        ],
    )
    def test_is_sound(self, mesh: TriMesh, components: int, genus: int) -> None:
        judge = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        found = topology(mesh)
        assert faults(mesh) == {}
        assert (found.components, found.genus) == (components, genus)
        assert found.euler_number == judge.euler_number == 2 * components - 2 * genus
        assert judge.is_watertight
        assert judge.is_winding_consistent
        assert mesh.face_volumes.sum() == pytest.approx(judge.volume)
        assert mesh.face_areas.sum() == pytest.approx(judge.area)
        np.testing.assert_array_equal(np.sort(mesh.edges, axis=0), np.sort(judge.edges_unique, axis=0))
        check_promise(mesh)

    @law(40)
    @given(seed=seeds, share=st.floats(0.05, 0.6))
    def test_trimesh_says_the_same_of_an_isosurface(self, seed: int, share: float) -> None:
        mesh = isosurface(seed, share)
        judge = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        found = topology(mesh)
        assert found.euler_number == judge.euler_number
        assert found.components == judge.body_count
        assert judge.is_watertight == (found.boundary_edges == found.nonmanifold_edges == 0)
        assert judge.is_winding_consistent == (found.misoriented_edges == 0)
        areas, volumes = areas_and_volumes(Links(mesh))
        assert volumes.sum() == pytest.approx(judge.volume)
        np.testing.assert_allclose(areas, judge.area_faces, atol=1e-12)
        assert found.genus == found.components - judge.euler_number // 2

    @law(40)
    @given(seed=seeds, share=st.floats(0.05, 0.6))
    def test_knows_no_order(self, seed: int, share: float) -> None:
        mesh = isosurface(seed, share)
        rng = np.random.default_rng(seed)
        number = rng.permutation(len(mesh.vertices))
        vertices = np.empty_like(mesh.vertices)
        vertices[number] = mesh.vertices
        faces = np.roll(number[rng.permutation(mesh.faces)], 1, axis=1)
        assert topology(TriMesh(vertices, faces)) == topology(mesh)

    def test_vertices_without_a_face_do_not_count(self) -> None:
        mesh = ball()
        assert topology(mesh.moved(np.vstack([mesh.vertices, [[9.0, 9, 9]]]))) == topology(mesh)

    def test_of_nothing_is_nothing(self) -> None:
        nothing = TriMesh(np.empty((0, 3)), np.empty((0, 3), np.int64))
        assert topology(nothing) == Topology(**{entry.name: 0 for entry in fields(Topology)})


class TestBroken:
    def test_a_missing_face_opens_three_edges(self) -> None:
        mesh = ball()
        assert faults(TriMesh(mesh.vertices, mesh.faces[1:])) == {"boundary_edges": 3}

    def test_a_duplicated_face_makes_three_edges_of_three_faces(self) -> None:
        mesh = ball()
        found = faults(TriMesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[:1]])))
        assert found["nonmanifold_edges"] == 3

    def test_a_flipped_face_makes_three_edges_of_one_direction(self) -> None:
        mesh = ball()
        faces = mesh.faces.copy()
        faces[5] = faces[5, ::-1]
        assert faults(TriMesh(mesh.vertices, faces)) == {"misoriented_edges": 3}

    def test_two_balls_that_share_a_vertex_make_a_bow_tie(self) -> None:
        one = ball()
        other = one.moved(2 * one.vertices[0] - one.vertices)
        other = TriMesh(other.vertices, other.faces[:, ::-1])
        pair = beside(one, other)
        faces = np.where(pair.faces == len(one.vertices), 0, pair.faces)
        assert faults(TriMesh(pair.vertices, faces)) == {"nonmanifold_vertices": 1}

    def test_two_balls_that_share_an_edge_make_an_edge_of_four_faces(self) -> None:
        one = ball()
        a, b = one.faces[0, :2]
        pair = beside(one, one)
        faces = pair.faces.copy()
        for vertex in (a, b):
            faces[faces == vertex + len(one.vertices)] = vertex
        assert faults(TriMesh(pair.vertices, faces))["nonmanifold_edges"] == 1

    @pytest.mark.parametrize("which", ["one", "both"])
    def test_an_inside_out_component_is_inward(self, which: str) -> None:
        mesh = ball()
        inner = TriMesh(mesh.vertices, mesh.faces[:, ::-1])
        pair = beside(inner, mesh.moved(mesh.vertices + 5) if which == "one" else inner.moved(mesh.vertices + 5))
        assert faults(pair) == {"inward_components": 1 if which == "one" else 2}

    @law(60)
    @given(seed=seeds, kind=st.sampled_from(["drop", "double", "flip"]))
    def test_any_single_fault_is_found_far_away_too(self, seed: int, kind: str) -> None:
        rng = np.random.default_rng(seed)
        mesh = ring()
        faces = mesh.faces.copy()
        n = int(rng.integers(len(faces)))
        if kind == "drop":
            faces = np.delete(faces, n, axis=0)
        elif kind == "double":
            faces = np.insert(faces, n, faces[n], axis=0)
        else:
            faces[n] = faces[n, [1, 0, 2]]
        broken = TriMesh(mesh.vertices + rng.choice([0.0, 1e9]), faces)
        assert not topology(broken).sound
        assert not trimesh.Trimesh(mesh.vertices, faces, process=False).is_volume
        with pytest.raises(InternalCheckError):
            check_promise(broken)


class TestPromise:
    def test_refuses_coincident_vertices(self) -> None:
        mesh = ball()
        vertices = mesh.vertices.copy()
        far = int(np.argmax(np.linalg.norm(vertices - vertices[0], axis=1)))
        vertices[far] = vertices[0]
        assert topology(mesh.moved(vertices)).boundary_edges == 0
        with pytest.raises(InternalCheckError) as refused:
            check_promise(mesh.moved(vertices))
        assert refused.value.exit_code == 9

    def test_refuses_an_edge_of_no_length(self) -> None:
        mesh = ball()
        vertices = mesh.vertices.copy()
        vertices[mesh.faces[0, 1]] = vertices[mesh.faces[0, 0]]
        with pytest.raises(InternalCheckError, match="position of another"):
            check_promise(mesh.moved(vertices))

    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
    def test_refuses_coordinates_that_are_not_finite(self, value: float) -> None:
        mesh = ball()
        vertices = mesh.vertices.copy()
        vertices[3, 1] = value
        with pytest.raises(InternalCheckError, match="finite"):
            check_promise(mesh.moved(vertices))

    def test_refuses_two_cubes_that_share_an_edge(self) -> None:
        """The smallest case of a surface that encloses a solid and is not manifold."""
        one = of(trimesh.creation.box())
        mesh = welded(beside(one, one.moved(one.vertices + np.array([1.0, 1.0, 0.0]))))
        assert faults(mesh)["nonmanifold_edges"] == 1
        with pytest.raises(InternalCheckError, match="nonmanifold_edges = 1"):
            check_promise(mesh)


class TestWelded:
    @law(30)
    @given(seed=seeds)
    def test_a_soup_of_triangles_becomes_the_mesh_again(self, seed: int) -> None:
        mesh = ring()
        faces = np.random.default_rng(seed).permutation(mesh.faces)
        soup = TriMesh(mesh.vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3))
        assert topology(soup).components == len(faces)
        assert topology(welded(soup)) == topology(mesh)
        assert len(welded(soup).vertices) == len(mesh.vertices)

    @law(40)
    @given(seed=seeds, n=st.integers(1, 40), spread=st.sampled_from([1, 3, 2**40]))
    def test_positions_are_told_apart_as_rows_are(self, seed: int, n: int, spread: int) -> None:
        rng = np.random.default_rng(seed)
        positions = rng.integers(-1, 2, (n, 3)) * rng.choice([0.5, 1.0], (n, 3)) * spread
        mesh = TriMesh(positions, np.empty((0, 3), np.int64))
        assert distinct_positions(mesh, np.float64) == len(np.unique(positions, axis=0))
        joined = welded(TriMesh(positions, np.zeros((1, 3), np.int64)), np.float64).vertices
        np.testing.assert_array_equal(np.unique(joined, axis=0), np.unique(positions, axis=0))
        assert len(joined) == distinct_positions(mesh, np.float64)

    def test_faces_that_lose_a_corner_are_dropped(self) -> None:
        vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1 + 1e-12, 0, 0]])
        assert len(welded(TriMesh(vertices, np.array([[0, 1, 2], [1, 3, 2]]))).faces) == 1


class TestMesh:
    def test_components_are_numbered_by_their_lowest_vertex(self) -> None:
        pair = beside(ball(), ring())
        label = face_components(pair)
        np.testing.assert_array_equal(label, np.repeat([0, 1], [len(ball().faces), len(ring().faces)]))
