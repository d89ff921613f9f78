"""Nearest points and exact distances against brute force and trimesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage
from scipy.optimize import LinearConstraint, minimize
from scipy.spatial import cKDTree

from conftest import law, seeds, size, sphere
from tomomesh.cuberille.neighbors import neighbor_table
from tomomesh.cuberille.partition import partition
from tomomesh.kernels.cuberille.cells import label_components, nearest_points
from tomomesh.kernels.measure.triangles import squared_distance
from tomomesh.kernels.threads import in_blocks
from tomomesh.measure.distance import distance_to_surface, spread_of
from tomomesh.measure.report import area_samples, compare
from tomomesh.measure.tree import Tree
from tomomesh.model.cubes import cells_of
from tomomesh.model.mesh import TriMesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


pytestmark = pytest.mark.usefixtures("fewer_samples")


def icosphere(radius: float = 1.0, center: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> TriMesh:
    made = trimesh.creation.icosphere(subdivisions=size(3, 1), radius=radius)
    return TriMesh(np.array(made.vertices) + center, np.array(made.faces, np.int64))


@st.composite
def soups(draw: st.DrawFn) -> TriMesh:
    """Draw triangles of very different sizes, some of them flat."""
    rng = np.random.default_rng(draw(seeds))
    m = draw(st.integers(1, 25))
    corners = rng.normal(size=(m, 1, 3)) * 3 + rng.normal(size=(m, 3, 3)) * 10 ** rng.uniform(-2, 1, (m, 1, 1))
    flat = rng.random(m) < 0.2
    corners[flat, 2] = (corners[flat, 0] + corners[flat, 1]) / 2
    return TriMesh(corners.reshape(-1, 3), np.arange(3 * m).reshape(m, 3))


class TestNearestPoints:
    @law(60)
    @given(seed=seeds, whole=st.booleans(), cell=st.floats(0.7, 3))
    def test_are_those_of_a_search_in_twenty_seven_cubes(self, seed: int, whole: bool, cell: float) -> None:
        rng = np.random.default_rng(seed)
        points = rng.uniform(0, 6, (rng.integers(1, 50), 3))
        points = np.round(points) if whole else points
        grid = partition(points, np.full(3, cell))
        vertices = np.round(rng.uniform(-1, 7, (20, 3)) * 2) / 2
        home = rng.integers(len(grid.keys), size=20).astype(np.int32)
        nearest = np.full(20, -7, np.int32)
        nearest_points(vertices, points, neighbor_table(grid.keys), grid.order, grid.start, home.copy(), nearest, 0, 20)
        of_point = np.empty((len(points), 3), np.int64)
        of_point[grid.order] = np.repeat(grid.cells, np.diff(grid.start), axis=0)
        for vertex, cube, found in zip(vertices, grid.cells[home], nearest, strict=True):
            near = np.flatnonzero(np.abs(of_point - cube).max(axis=1) <= 1)
            squared = ((points[near] - vertex) ** 2).sum(axis=1)
            assert found in near
            assert ((points[found] - vertex) ** 2).sum() == squared.min()
            tied = [n for n in grid.order.tolist() if n in near[squared == squared.min()]]
            assert found == tied[0]

    def test_leaves_other_vertices_alone_and_says_where_there_is_no_point(self) -> None:
        grid = partition(np.zeros((1, 3)), np.ones(3))
        table = np.full((1, 27), -1, np.int32)
        nearest = np.full(3, -7, np.int32)
        nearest_points(
            np.zeros((3, 3)), np.zeros((1, 3)), table, grid.order, grid.start, np.zeros(3, np.int32), nearest, 1, 2
        )
        np.testing.assert_array_equal(nearest, [-7, -1, -7])


class TestComponents:
    @law(60)
    @given(seed=seeds)
    def test_are_scipy_s(self, seed: int) -> None:
        solid = np.random.default_rng(seed).random((6, 5, 4)) < 0.2
        solid[0, 0, 0] = True
        wanted, count = ndimage.label(np.transpose(solid), np.ones((3, 3, 3)))
        points = np.argwhere(solid).astype(float)
        keys = partition(points, np.ones(3)).keys
        labels = np.full(len(keys), -1, np.int32)
        assert label_components(neighbor_table(keys), np.ones(len(keys), bool), labels) == count
        x, y, z = cells_of(keys).T
        np.testing.assert_array_equal(labels + 1, wanted[z, y, x])


def squared(point: Floats, corners: Floats) -> float:
    return float(squared_distance(point[None], 0, np.ascontiguousarray(corners), np.arange(3, dtype=np.int32)[None], 0))


class TestSquaredDistance:
    @law(80)
    @given(mesh=soups(), seed=seeds)
    def test_is_the_least_over_the_triangle(self, mesh: TriMesh, seed: int) -> None:
        point = np.random.default_rng(seed).normal(size=3) * 4
        corners = mesh.corners[0]
        found = squared(point, corners)

        def off(weights: Floats) -> float:
            return float(((np.append(weights, 1 - weights.sum()) @ corners - point) ** 2).sum())

        inside = LinearConstraint(np.ones((1, 2)), -np.inf, 1)
        best = minimize(off, [0.3, 0.3], bounds=[(0, 1)] * 2, constraints=[inside], tol=1e-14, method="SLSQP")
        assert found <= best.fun + 1e-9
        share = np.sort(np.random.default_rng(seed).random((400, 2)), axis=1)
        weights = np.column_stack([share[:, 0], share[:, 1] - share[:, 0], 1 - share[:, 1]])
        assert found <= ((weights @ corners - point) ** 2).sum(axis=1).min() + 1e-12
        assert found == pytest.approx(best.fun, rel=1e-3, abs=1e-6)

    @law(80)
    @given(mesh=soups(), seed=seeds)
    def test_does_not_depend_on_the_order_of_the_corners(self, mesh: TriMesh, seed: int) -> None:
        point = np.random.default_rng(seed).normal(size=3) * 4
        turned = [squared(point, mesh.corners[0][list(o)]) for o in ((0, 1, 2), (1, 2, 0), (2, 1, 0))]
        np.testing.assert_allclose(turned, turned[0], rtol=1e-9, atol=1e-12)


class TestDistance:
    @law(60)
    @given(mesh=soups(), seed=seeds, far=st.sampled_from([0.5, 6, 1e4]))
    def test_is_exact(self, mesh: TriMesh, seed: int, far: float) -> None:
        points = np.random.default_rng(seed).normal(size=(15, 3)) * far
        brute = np.array([[squared(p, c) for c in mesh.corners] for p in points])
        distance, face = Tree.of_faces(mesh).nearest(points)
        np.testing.assert_allclose(distance, np.sqrt(brute.min(axis=1)), rtol=1e-12)
        np.testing.assert_allclose(brute[np.arange(15), face], brute.min(axis=1), rtol=1e-12)
        assert distance_to_surface(points, mesh).tobytes() == distance.tobytes()

    @law(30)
    @given(seed=seeds, enough=st.floats(0, 0.5))
    def test_what_is_near_enough_is_not_bettered(self, seed: int, enough: float) -> None:
        """Distances over what is enough are exact, and no other is."""
        rng = np.random.default_rng(seed)
        points, asked = rng.random((40, 3)), rng.random((30, 3))
        exact, found = (Tree.of_points(points).nearest(asked, enough=one)[0] for one in (0.0, enough))
        np.testing.assert_array_equal(found[exact > enough], exact[exact > enough])
        assert (found[exact <= enough] <= enough).all()
        assert (found >= exact).all()

    @law(40)
    @given(seed=seeds, count=st.integers(1, 60), whole=st.booleans())
    def test_of_points_is_scipy_s(self, seed: int, count: int, whole: bool) -> None:
        rng = np.random.default_rng(seed)
        points, asked = rng.normal(size=(count, 3)), rng.normal(size=(30, 3)) * 2
        points = np.round(points) if whole else points
        distance, number = Tree.of_points(points).nearest(asked)
        np.testing.assert_allclose(distance, cKDTree(points).query(asked)[0], rtol=1e-12)
        np.testing.assert_allclose(distance, np.linalg.norm(points[number] - asked, axis=1), rtol=1e-12)

    @law(20)
    @given(seed=seeds)
    def test_a_tree_holds_every_face_once_and_boxes_hold_their_own(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        m = int(rng.integers(1, 300))
        mesh = TriMesh(rng.normal(size=(40, 3)) * 10 ** rng.uniform(-3, 3, (40, 1)), rng.integers(0, 40, (m, 3)))
        tree = Tree.of_faces(mesh)
        np.testing.assert_array_equal(np.sort(tree.order), np.arange(m))
        np.testing.assert_array_equal(tree.simplices, mesh.faces[tree.order])
        low, high = tree.boxes[2::2], tree.boxes[3::2]
        assert (low[0] == mesh.corners.min(axis=(0, 1))).all()
        assert (high[0] == mesh.corners.max(axis=(0, 1))).all()
        parent = (np.arange(2, 2 * tree.leaves) // 2) - 1
        assert (low[parent] <= low[1:]).all()
        assert (high[parent] >= high[1:]).all()
        begin = np.arange(tree.leaves + 1) * m // tree.leaves
        leaf = np.searchsorted(begin, np.arange(m), side="right") - 2 + tree.leaves
        corners = mesh.corners[tree.order]
        assert (low[leaf] <= corners.min(axis=1)).all()
        assert (high[leaf] >= corners.max(axis=1)).all()

    @law(20)
    @given(seed=seeds)
    def test_is_trimesh_s(self, seed: int) -> None:
        points = np.random.default_rng(seed).normal(size=(40, 3)) * 2
        mesh = icosphere()
        _, wanted, _ = trimesh.proximity.closest_point_naive(trimesh.Trimesh(mesh.vertices, mesh.faces), points)
        np.testing.assert_allclose(distance_to_surface(points, mesh), wanted, atol=1e-9)

    def test_is_the_same_on_any_number_of_threads_and_nearly_so_in_other_blocks(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        points, mesh = sphere(100, 2.0), icosphere()
        whole = distance_to_surface(points, mesh)
        monkeypatch.setattr("tomomesh.measure.tree.BLOCK", 70)
        one, three = (distance_to_surface(points, mesh, threads=threads) for threads in (1, 3))
        assert one.tobytes() == three.tobytes()
        np.testing.assert_allclose(one, whole, rtol=1e-12)

    def test_tells_how_far_it_is_and_may_be_stopped(self) -> None:
        told = []
        distance_to_surface(sphere(100), icosphere(), progress=lambda *now: told.append(now))
        assert told[-1] == ("distances", 100, 100)

        def stop(_stage: str, _done: int, _total: int) -> None:
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            distance_to_surface(sphere(100), icosphere(), progress=stop)

    def test_of_no_points_is_nothing(self) -> None:
        assert distance_to_surface(np.empty((0, 3)), icosphere()).shape == (0,)
        assert spread_of(np.empty(0), "") == {}

    @pytest.mark.parametrize("offset", [0.0, 0.25])
    def test_between_two_spheres_is_the_difference_of_their_radii(self, offset: float) -> None:
        found = compare(icosphere(), icosphere(1 + offset))
        slack = size(0.02, 0.2)
        assert found["mean_mm"] == pytest.approx(offset, abs=slack)
        assert found["back_mean_mm"] == pytest.approx(offset, abs=slack)
        assert found["mean_mm"] <= found["p95_mm"] <= found["max_mm"]

    def test_leaves_out_the_faces_it_is_told_to(self) -> None:
        mesh = icosphere()
        above = mesh.corners[:, :, 2].mean(axis=1) > 0
        assert (area_samples(mesh, leave_out=above)[:, 2] < 0.4).all()
        assert area_samples(mesh, leave_out=np.ones(len(mesh.faces), bool)).shape == (0, 3)


class TestSamples:
    def test_are_uniform_by_area(self) -> None:
        big = TriMesh(
            np.array([[0.0, 0, 0], [3, 0, 0], [0, 3, 0], [10, 0, 0], [11, 0, 0], [10, 1, 0]]),
            np.array([[0, 1, 2], [3, 4, 5]]),
        )
        samples = area_samples(big, 20_000)
        assert (samples[:, 0] < 5).mean() == pytest.approx(0.9, abs=0.01)
        np.testing.assert_allclose(samples[samples[:, 0] < 5].mean(axis=0), [1, 1, 0], atol=0.03)
        assert area_samples(big).tobytes() == area_samples(big).tobytes()


class TestBlocks:
    @law(40)
    @given(total=st.integers(0, 50), block=st.integers(1, 60), threads=st.integers(0, 4))
    def test_cover_all_of_the_work_once(self, total: int, block: int, threads: int) -> None:
        count, told = np.zeros(total, int), [0]

        def work(start: int, stop: int) -> None:
            count[start:stop] += 1

        in_blocks(work, total, block=block, threads=threads, done=told.append)
        assert (count == 1).all()
        assert told[-1] == total
        assert told == sorted(told)

    @pytest.mark.parametrize("threads", [1, 3])
    def test_hand_on_whatever_stops_them(self, threads: int) -> None:
        def stop(_count: int) -> None:
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            in_blocks(lambda start, end: None, 10, block=1, threads=threads, done=stop)

    @pytest.mark.parametrize("threads", [1, 3])
    def test_hand_on_a_fault_in_the_work(self, threads: int) -> None:
        def fail(start: int, _stop: int) -> None:
            if start == 3:
                raise ZeroDivisionError

        with pytest.raises(ZeroDivisionError):
            in_blocks(fail, 10, block=1, threads=threads)
