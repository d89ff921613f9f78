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

from conftest import law, seeds, size, sphere
from tomomesh.kernels.cells import label_components, nearest_points
from tomomesh.kernels.threads import in_blocks
from tomomesh.kernels.triangles import squared_distance
from tomomesh.measure.distance import distance_to_surface, spread_of
from tomomesh.measure.report import area_samples, assess, compare
from tomomesh.measure.shape import triangle_shapes
from tomomesh.model.cubes import cells_of
from tomomesh.model.mesh import TriMesh
from tomomesh.surface.neighbors import neighbor_table
from tomomesh.surface.partition import partition

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


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


class TestSquaredDistance:
    @law(80)
    @given(mesh=soups(), seed=seeds)
    def test_is_the_least_over_the_triangle(self, mesh: TriMesh, seed: int) -> None:
        point = np.random.default_rng(seed).normal(size=3) * 4
        corners = np.ascontiguousarray(mesh.corners[0])
        found = squared_distance(point, corners)

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
        corners = mesh.corners[0]
        turned = [squared_distance(point, corners[list(o)].copy()) for o in ((0, 1, 2), (1, 2, 0), (2, 1, 0))]
        np.testing.assert_allclose(turned, turned[0], rtol=1e-9, atol=1e-12)


class TestDistance:
    @law(60)
    @given(mesh=soups(), seed=seeds)
    def test_is_exact(self, mesh: TriMesh, seed: int) -> None:
        points = np.random.default_rng(seed).normal(size=(15, 3)) * 6
        brute = [min(squared_distance(p, np.ascontiguousarray(c)) for c in mesh.corners) for p in points]
        np.testing.assert_allclose(distance_to_surface(points, mesh), np.sqrt(brute), rtol=1e-12)

    @law(20)
    @given(seed=seeds)
    def test_is_trimesh_s(self, seed: int) -> None:
        points = np.random.default_rng(seed).normal(size=(40, 3)) * 2
        mesh = icosphere()
        _, wanted, _ = trimesh.proximity.closest_point_naive(trimesh.Trimesh(mesh.vertices, mesh.faces), points)
        np.testing.assert_allclose(distance_to_surface(points, mesh), wanted, atol=1e-9)

    def test_is_the_same_in_blocks(self, monkeypatch: pytest.MonkeyPatch) -> None:
        points, mesh = sphere(100, 2.0), icosphere()
        whole = distance_to_surface(points, mesh)
        monkeypatch.setattr("tomomesh.measure.distance.BLOCK", 7)
        assert distance_to_surface(points, mesh).tobytes() == whole.tobytes()

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


class TestShapes:
    @law(40)
    @given(mesh=soups())
    def test_are_trimesh_s(self, mesh: TriMesh) -> None:
        judge = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        found = triangle_shapes(mesh)
        lengths = np.linalg.norm(mesh.corners - np.roll(mesh.corners, 1, axis=1), axis=2)
        assert found["shortest_edge_mm"] == pytest.approx(lengths.min())
        assert found["median_edge_mm"] == pytest.approx(np.median(lengths))
        assert found["longest_edge_mm"] == pytest.approx(lengths.max())
        thick = judge.area_faces > 1e-9
        if thick.all():
            smallest = np.degrees(judge.face_angles.min(axis=1))
            assert found["smallest_angle_deg"] == pytest.approx(smallest.min(), abs=1e-3)
            assert found["mean_smallest_angle_deg"] == pytest.approx(smallest.mean(), abs=1e-3)
        assert 0 <= found["mean_aspect"] <= 1

    def test_of_an_equilateral_triangle_are_perfect(self) -> None:
        one = TriMesh(np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2]]))
        found = triangle_shapes(one)
        assert found["mean_aspect"] == pytest.approx(1)
        assert found["smallest_angle_deg"] == pytest.approx(60)


class TestAssess:
    def test_agrees_with_trimesh(self) -> None:
        mesh = icosphere(10.0, (100.0, -50.0, 7.0))
        found = assess(mesh, points=sphere(200) + np.array([100, -50, 7]), against=icosphere(11.0, (100.0, -50.0, 7.0)))
        judge = trimesh.Trimesh(mesh.vertices, mesh.faces)
        assert found["area_mm2"] == pytest.approx(judge.area)
        assert found["volume_mm3"] == pytest.approx(judge.volume)
        assert found["euler_number"] == judge.euler_number == 2
        assert found["closed"] == judge.is_watertight
        assert found["sound"]
        assert found["sound_after_welding"]
        assert found["points_to_surface_mean_mm"] < size(0.1, 1.0)
        assert found["vertices_to_points_max_mm"] < 3
        assert found["mean_mm"] == pytest.approx(1, abs=size(0.05, 0.5))


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
