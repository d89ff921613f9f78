"""Faces that pass through each other, against exact fractions."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds, size
from tomomesh.kernels.measure.beside import only_touch
from tomomesh.measure.intersections import intersecting_pairs, self_intersections
from tomomesh.measure.topology import welded
from tomomesh.model.mesh import TriMesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

Vector = list[Fraction]
Triangle = list[Vector]


def minus(u: Vector, v: Vector) -> Vector:
    return [a - b for a, b in zip(u, v, strict=True)]


def dot(u: Vector, v: Vector) -> Fraction:
    return sum((a * b for a, b in zip(u, v, strict=True)), Fraction(0))


def cross(u: Vector, v: Vector) -> Vector:
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]


def normal(one: Triangle) -> Vector:
    return cross(minus(one[1], one[0]), minus(one[2], one[0]))


def clipped(polygon: list[Vector], toward: Vector, foot: Vector) -> list[Vector]:
    """Keep what lies on one side of a plane."""
    kept = []
    for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        a, b = dot(toward, minus(p, foot)), dot(toward, minus(q, foot))
        if a >= 0:
            kept.append(p)
        if a * b < 0:
            kept.append([x + (y - x) * a / (a - b) for x, y in zip(p, q, strict=True)])
    return kept


def walls(one: Triangle) -> list[tuple[Vector, Vector]]:
    """Return the directions into a triangle from its sides, and a corner on each."""
    up = normal(one)
    return [(cross(up, minus(one[(k + 1) % 3], one[k])), one[k]) for k in range(3)]


def cross_exactly(one: Triangle, other: Triangle) -> bool:
    """Tell from the definition whether two triangles have a point in common that is inside of one of them.

    What they have in common is convex: if it holds such a point, then the mean of its corners is one.
    """
    up = normal(other)
    if not any(normal(one)) or not any(up):
        return False
    common = clipped(clipped(one, up, other[0]), [-x for x in up], other[0])
    for inward, foot in walls(other):
        common = clipped(common, inward, foot)
    if not common:
        return False
    middle = [sum(x, Fraction(0)) / len(common) for x in zip(*common, strict=True)]
    return any(all(dot(inward, minus(middle, foot)) > 0 for inward, foot in walls(t)) for t in (one, other))


def pairs_exactly(mesh: TriMesh) -> list[tuple[int, int]]:
    exact = [[[Fraction(x) for x in corner] for corner in face] for face in mesh.corners.tolist()]
    low, high = mesh.corners.min(axis=1), mesh.corners.max(axis=1)
    return [
        (i, j)
        for i, j in combinations(range(len(exact)), 2)
        if (low[i] <= high[j]).all() and (low[j] <= high[i]).all() and cross_exactly(exact[i], exact[j])
    ]


def marks(pairs: list[tuple[int, int]], count: int) -> NDArray[np.bool_]:
    marked = np.zeros(count, bool)
    marked[[i for pair in pairs for i in pair]] = True
    return marked


def ball(subdivisions: int = 2, radius: float = 1.0) -> TriMesh:
    made = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return TriMesh(np.array(made.vertices), np.array(made.faces, np.int64))


def beside(mesh: TriMesh, other: TriMesh) -> TriMesh:
    faces = np.concatenate([mesh.faces, other.faces + len(mesh.vertices)])
    return TriMesh(np.concatenate([mesh.vertices, other.vertices]), faces)


def pushed() -> TriMesh:
    """Push the top of a ball through its bottom."""
    mesh = ball(size(2, 1))
    x, y, z = mesh.vertices.T
    z = np.where(z > 0.3, 0.31 - 2.1 * (z - 0.3), z) + 0.01 * x
    return short(mesh.moved(np.column_stack([x, y, z])))


def short(mesh: TriMesh) -> TriMesh:
    """Round to 16 bits behind the point, or the fractions grow long."""
    return mesh.moved(np.round(mesh.vertices * 2**16) / 2**16)


@st.composite
def tangles(draw: st.DrawFn) -> TriMesh:
    """Draw faces over few vertices: on a small lattice, or anywhere; of one size, or of very different ones."""
    rng = np.random.default_rng(draw(seeds))
    n, m = draw(st.integers(3, size(20, 10))), draw(st.integers(1, size(16, 8)))
    vertices = rng.normal(size=(n, 3))
    if draw(st.booleans()):
        vertices = rng.integers(0, draw(st.integers(2, 4)), (n, 3)).astype(float)
    elif draw(st.booleans()):
        vertices *= 10 ** rng.uniform(-3, 0, (n, 1))
    return short(TriMesh(vertices, np.array([rng.choice(n, 3, replace=False) for _ in range(m)], np.int64)))


def surely_touch(mesh: TriMesh) -> list[tuple[int, int]]:
    """Return the pairs of faces that are told to have only corners in common without a closer look."""
    faces, rows = mesh.faces.astype(np.int32), np.ascontiguousarray(mesh.corners.reshape(-1, 3))
    pairs = combinations(range(len(faces)), 2)
    return [(i, j) for i, j in pairs if only_touch(faces, i, j, rows, 3 * i, 3 * j)]


class TestSharedCorners:
    @law(100)
    @given(mesh=tangles())
    def test_faces_that_surely_touch_do_not_cross(self, mesh: TriMesh) -> None:
        assert not set(surely_touch(mesh)) & set(pairs_exactly(mesh))

    def test_neighbors_on_a_ball_need_no_closer_look(self) -> None:
        mesh = ball(2)
        shared = [
            (i, j) for i, j in combinations(range(len(mesh.faces)), 2) if {*mesh.faces[i]} & {*mesh.faces[j]}
        ]  # fmt: skip
        assert surely_touch(mesh) == shared

    def test_a_face_folded_onto_its_neighbor_does(self) -> None:
        corners = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 3, 0], [3, 0, 1]], float)
        folded = TriMesh(corners, np.array([[0, 1, 2], [1, 0, 3]]))
        assert surely_touch(folded) == []
        assert intersecting_pairs(folded).tolist() == [[0, 1]]


class TestAgainstFractions:
    @law(100)
    @given(mesh=tangles())
    def test_pairs_are_those_of_the_definition(self, mesh: TriMesh) -> None:
        wanted = pairs_exactly(mesh)
        assert [tuple(pair) for pair in intersecting_pairs(mesh).tolist()] == wanted
        np.testing.assert_array_equal(self_intersections(mesh), marks(wanted, len(mesh.faces)))

    def test_a_ball_pushed_through_itself(self) -> None:
        mesh = pushed()
        wanted = marks(pairs_exactly(mesh), len(mesh.faces))
        assert wanted.any()
        assert not wanted.all()
        np.testing.assert_array_equal(self_intersections(mesh), wanted)

    @law(8)
    @given(seed=seeds)
    def test_a_rough_ball(self, seed: int) -> None:
        mesh = ball(1)
        rough = np.random.default_rng(seed).uniform(0.4, 1.6, (len(mesh.vertices), 1))
        mesh = short(mesh.moved(mesh.vertices * rough))
        np.testing.assert_array_equal(self_intersections(mesh), marks(pairs_exactly(mesh), len(mesh.faces)))


class TestInvariance:
    @law(60)
    @given(mesh=tangles(), seed=seeds)
    def test_numbers_do_not_matter(self, mesh: TriMesh, seed: int) -> None:
        rng = np.random.default_rng(seed)
        number, order = rng.permutation(len(mesh.vertices)), rng.permutation(len(mesh.faces))
        vertices = np.empty_like(mesh.vertices)
        vertices[number] = mesh.vertices
        faces = np.array([rng.permutation(face) for face in number[mesh.faces[order]]])
        found = self_intersections(TriMesh(vertices, faces))
        np.testing.assert_array_equal(found, self_intersections(mesh)[order])

    def test_far_from_the_origin_it_is_the_same(self) -> None:
        mesh = pushed()
        far = mesh.moved(mesh.vertices + np.array([1e9, -1e9, 1e9]))
        np.testing.assert_array_equal(self_intersections(far), self_intersections(mesh))

    def test_threads_and_blocks_do_not_matter(self, monkeypatch: pytest.MonkeyPatch) -> None:
        mesh = pushed()
        whole = self_intersections(mesh, threads=1)
        monkeypatch.setattr("tomomesh.measure.intersections.BLOCK", 3)
        np.testing.assert_array_equal(self_intersections(mesh, threads=3), whole)


class TestKnown:
    def test_of_nothing_there_are_none(self) -> None:
        nothing = TriMesh(np.empty((0, 3)), np.empty((0, 3), np.int64))
        assert self_intersections(nothing).shape == (0,)
        assert intersecting_pairs(nothing).shape == (0, 2)

    @pytest.mark.parametrize("offset", [0.0, 2.5])
    def test_balls_in_or_beside_each_other_have_none(self, offset: float) -> None:
        other = ball(2, 0.8)
        assert not self_intersections(beside(ball(), other.moved(other.vertices + offset))).any()

    def test_balls_that_overlap_cross_where_each_passes_the_other(self) -> None:
        one = ball(size(4, 2))
        found = self_intersections(beside(one, one.moved(one.vertices + np.array([1.013, 0.171, 0.059]))))
        assert found[: len(one.faces)].any()
        assert found[len(one.faces) :].any()
        middle = one.corners.mean(axis=1)[found[: len(one.faces)]]
        away = np.linalg.norm(middle - [1.013, 0.171, 0.059], axis=1)
        np.testing.assert_allclose(away, 1, atol=size(0.1, 0.3))

    def test_a_face_that_is_there_twice_counts(self) -> None:
        mesh = ball(0)
        assert self_intersections(TriMesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[4:5]]))).sum() == 2

    def test_faces_that_touch_along_their_sides_do_not_count(self) -> None:
        mesh = ball()
        soup = TriMesh(mesh.corners.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
        assert not self_intersections(soup).any()
        assert len(welded(soup).vertices) == len(mesh.vertices)

    @pytest.mark.parametrize(
        ("apex", "counts"),
        [
            ((0.3, 0.3, 0.0), True),  # folded onto its neighbor
            ((0.6, -0.5, 0.0), False),  # beside it in the same plane
            ((0.3, 0.3, 1e-9), False),  # folded, but not quite
            ((3.0, 3.0, 0.0), True),  # folded far beyond it
        ],
    )
    def test_a_neighbor_counts_where_it_lies_on_the_other(self, apex: tuple[float, float, float], counts: bool) -> None:
        vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], apex])
        assert self_intersections(TriMesh(vertices, np.array([[0, 1, 2], [1, 0, 3]]))).tolist() == [counts] * 2

    @pytest.mark.parametrize(
        ("foot", "counts"),
        [((0.25, 0.25, 0.0), True), ((0.5, 0.0, 0.0), False), ((0.0, 0.0, 0.0), False), ((0.25, 0.25, 1e-6), False)],
    )
    def test_a_corner_counts_where_it_rests_inside_a_face(self, foot: tuple[float, float, float], counts: bool) -> None:
        vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], foot, [0.2, 0.3, 1], [0.4, 0.1, 1]])
        assert self_intersections(TriMesh(vertices, np.arange(6).reshape(2, 3))).tolist() == [counts] * 2

    def test_a_large_face_is_compared_with_all_that_it_passes(self) -> None:
        mesh = ball(size(4, 2))
        blade = TriMesh(np.array([[-90.0, -80, 0.013], [90, -80, 0.021], [1, 170, 0.017]]), np.array([[0, 1, 2]]))
        found = self_intersections(beside(mesh, blade))
        height = mesh.corners @ [-8e-3 / 180, 0, 1] - 0.017
        assert found[-1]
        np.testing.assert_array_equal(found[:-1], (height.min(axis=1) < 0) & (height.max(axis=1) > 0))


class TestProgress:
    def test_is_told_to_the_end_and_may_stop_the_work(self) -> None:
        told = []
        self_intersections(ball(), progress=lambda *now: told.append(now))
        assert told[-1][0] == "intersections"
        assert told[-1][1] == told[-1][2]

        def stop(_stage: str, _done: int, _total: int) -> None:
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            self_intersections(ball(), progress=stop)
