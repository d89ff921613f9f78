"""Open surfaces: where samples end, which side is kept, how a mesh is cut, and what comes of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from conftest import COMPILED, law, seeds, size
from tomomesh import reconstruct_points
from tomomesh.errors import GeometryError
from tomomesh.kernels.pointcloud.linear_algebra import tangents
from tomomesh.kernels.pointcloud.sheet import unfold
from tomomesh.measure.topology import check_promise
from tomomesh.model.mesh import TriMesh
from tomomesh.opensurface.borders import borders
from tomomesh.opensurface.trimming import rim, trimmed
from tomomesh.pointcloud.samples import settle_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

DATA = Path(__file__).parents[2] / "shared" / "data" / "odedstein"
SIDE = 12
"""Squares along the side of a grid."""


def on_square(count: int, seed: int = 0) -> Floats:
    """Points in a square of side 1, a sampling distance of 1 / sqrt(count)."""
    return np.column_stack([np.random.default_rng(seed).random((count, 2)), np.zeros(count)])


def on_open_box(count: int) -> Floats:
    """Points on the faces of a cube (-1, 1) without its bottom."""
    rng = np.random.default_rng(5)
    axis, sign = np.array([(0, -1), (0, 1), (1, -1), (1, 1), (2, 1)])[rng.integers(0, 5, count)].T
    points = rng.uniform(-1, 1, (count, 3))
    points[np.arange(count), axis] = sign
    return points


def grid() -> TriMesh:
    """A flat grid of triangles, facing up."""
    x, y = np.meshgrid(np.arange(SIDE + 1.0), np.arange(SIDE + 1.0), indexing="ij")
    n = np.arange((SIDE + 1) ** 2).reshape(SIDE + 1, SIDE + 1)
    a, b, c, d = (part.ravel() for part in (n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return TriMesh(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), faces)


def flattened(step: tuple[float, ...], here: tuple[float, ...], there: tuple[float, ...]) -> tuple[bool, Floats]:
    """Lay a neighbor into the plane of a sample; return whether it belongs there, and where it comes to lie."""
    axes, room, flat = np.empty((2, 3)), np.empty((2, 3)), np.empty(2)
    way, normal, other = (np.array(vector, np.float64) for vector in (step, here, there))
    tangents(normal, axes)
    same = unfold(way, normal, other, axes, room, flat)
    return bool(same), flat @ axes


class TestUnfolding:
    @pytest.mark.parametrize("angle", [35, 60, 90, 120, 145])
    @pytest.mark.parametrize("sign", [-1, 1])
    def test_lays_the_far_flank_of_a_crease_flat(self, angle: float, sign: int) -> None:
        turn = np.radians(angle)
        step = (0.3 + 0.5 * np.cos(turn), 0.2, -0.5 * np.sin(turn))
        same, flat = flattened(step, (0, 0, 1), (sign * np.sin(turn), 0, sign * np.cos(turn)))
        assert same
        np.testing.assert_allclose(flat, [0.8, 0.2, 0], atol=1e-12)

    @pytest.mark.parametrize("angle", [10, 25, 40, 70])
    def test_is_the_way_along_a_cylinder(self, angle: float) -> None:
        turn = np.radians(angle)
        _, flat = flattened((np.sin(turn), 0, np.cos(turn) - 1), (0, 0, 1), (np.sin(turn), 0, np.cos(turn)))
        np.testing.assert_allclose(flat, [turn, 0, 0], atol=0.2 * turn**3 + 1e-12)

    def test_leaves_out_a_sheet_that_lies_over_another(self) -> None:
        assert not flattened((0.1, 0, 1), (0, 0, 1), (0, 0, -1))[0]


class TestBorders:
    def test_run_all_around_a_square(self) -> None:
        count = size(2_500, 400)
        apart = 1 / np.sqrt(count)
        found, _ = borders(settle_points(on_square(count)), apart)
        x, y = found.samples[:, 0], found.samples[:, 1]
        assert found.count == 1
        assert np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y)).max() < 2 * apart
        walk = np.linspace(0, 1, 50)
        frame = np.concatenate([np.column_stack([walk, 0 * walk + n]) for n in (0, 1)])
        frame = np.concatenate([frame, frame[:, ::-1]])
        assert np.max(cKDTree(found.samples[:, :2]).query(frame)[0]) < 4 * apart

    def test_are_none_on_a_closed_surface(self) -> None:
        x = np.random.default_rng(1).normal(size=(size(4_000, 600), 3))
        samples = settle_points(x / np.linalg.norm(x, axis=1, keepdims=True))
        found, same = borders(samples, float(np.median(samples.spacing)))
        assert found.count == 0
        assert same is samples
        assert np.isinf(found.depths(samples.positions)).all()

    def test_tell_wide_holes_from_narrow_ones(self) -> None:
        count = size(4_900, 1_600)
        apart, cloud = 1 / np.sqrt(count), on_square(count, seed=4)
        for wide, expected in ((3, 1), (9, 2)):
            away = np.hypot(*(cloud[:, :2] - 0.5).T) > 0.5 * wide * apart
            assert borders(settle_points(cloud[away]), apart)[0].count == expected

    def test_lie_between_the_samples_and_what_is_beyond(self) -> None:
        apart = 1 / np.sqrt(900)
        found, _ = borders(settle_points(on_square(900)), apart)
        places, share = found.apron(0.7, 0.5 * apart)
        depth = found.depths(places)
        assert (depth < 1e-9).all()
        assert (depth[share == 1] < -0.5 * apart).all()
        assert (found.depths(np.ascontiguousarray(found.samples[:, :3])) > -1e-9).all()


class TestTrimming:
    @given(seeds, st.sampled_from([0.02, 0.1, 0.3]))
    @law(60)
    def test_any_cut_leaves_a_manifold(self, seed: int, near: float) -> None:
        rng = np.random.default_rng(seed)
        mesh, height = grid(), rng.normal(size=(SIDE + 1) ** 2)
        height[rng.integers(len(height))] = 5
        part, source = trimmed(mesh, height, near)
        check_promise(part, open_=True)
        assert len(source) == len(part.faces)

    @given(seeds)
    @law(40)
    def test_a_straight_cut_is_exact(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        turn, off, mesh = rng.uniform(0, 2 * np.pi), rng.uniform(-3, 3), grid()
        way = np.array([np.cos(turn), np.sin(turn)])
        part, _ = trimmed(mesh, (mesh.vertices[:, :2] - SIDE / 2) @ way - off, 0.0)
        height = (part.vertices[:, :2] - SIDE / 2) @ way - off
        assert height.min() > -1e-12
        assert (part.face_vectors[:, 2] > 0).all()
        sides = rim(part.faces)
        on_frame = (np.abs(part.vertices[:, :2] - SIDE / 2) > SIDE / 2 - 1e-9).any(axis=1)
        assert ((np.abs(height) < 1e-9) | on_frame)[sides].all()

    def test_a_vertex_moves_to_the_nearest_place_of_the_cut(self) -> None:
        """Nearest by length, whichever way it lies: here 1 / 11 to the right, and 10 / 11 to the left."""
        vertices = np.array([[0.0, 0, 0], [-10.0, 0, 0], [1.0, 0, 0], [0.0, 5.0, 0]])
        mesh = TriMesh(vertices, np.array([[0, 3, 1], [0, 2, 3]]))
        part, _ = trimmed(mesh, np.array([0.1, -1.0, -1.0, 50.0]), 0.3)
        assert np.abs(part.vertices - [1 / 11, 0, 0]).max(axis=1).min() < 1e-12

    def test_nothing_is_cut_where_all_lies_above(self) -> None:
        mesh = grid()
        part, source = trimmed(mesh, np.ones(len(mesh.vertices)), 0.3)
        np.testing.assert_array_equal(part.faces, mesh.faces)
        np.testing.assert_array_equal(source, np.arange(len(mesh.faces)))


def rim_distance(mesh: trimesh.Trimesh, other: trimesh.Trimesh) -> float:
    """Return the mean distance of places along the border of one mesh from that of another."""
    walk = np.linspace(0, 1, 30)[:, None, None]
    ends = [one.vertices[rim(one.faces)] for one in (mesh, other)]
    places, others = (((1 - walk) * end[:, 0] + walk * end[:, 1]).reshape(-1, 3) for end in ends)
    return float(np.mean(cKDTree(others).query(places)[0]))


def distances(mesh: trimesh.Trimesh, places: Floats) -> Floats:
    """Return the distance of each place from a mesh: from all faces whose sphere may reach as near as a corner does."""
    centers = mesh.triangles.mean(axis=1)
    widest = np.linalg.norm(mesh.triangles - centers[:, None], axis=2).max()
    corner = cKDTree(mesh.triangles.reshape(-1, 3)).query(places)[0]
    near = cKDTree(centers).query_ball_point(places, corner + widest)
    place, face = np.repeat(np.arange(len(places)), [len(one) for one in near]), np.concatenate(near).astype(int)
    found = np.linalg.norm(trimesh.triangles.closest_point(mesh.triangles[face], places[place]) - places[place], axis=1)
    least = np.full(len(places), np.inf)
    np.minimum.at(least, place, found)
    return least


def open_box() -> trimesh.Trimesh:
    box = trimesh.creation.box((2, 2, 2))
    box.update_faces(box.face_normals[:, 2] > -0.5)
    return box


@pytest.mark.skipif(not COMPILED, reason="slow without compiled kernels")
class TestSheets:
    def test_an_open_box_is_a_disk_that_faces_outward(self) -> None:
        surface = reconstruct_points(on_open_box(5_000), open=True)
        mesh = trimesh.Trimesh(surface.mesh.vertices, surface.mesh.faces, process=False)
        apart = np.sqrt(20 / 5_000)
        assert (surface.report["quality"]["boundary_loops"], mesh.euler_number) == (1, 1)
        assert mesh.is_winding_consistent
        outward = (mesh.face_normals * (mesh.triangles_center - [0, 0, -0.5])).sum(axis=1) > 0
        assert mesh.area_faces[outward].sum() > 0.99 * mesh.area
        assert max(rim_distance(mesh, open_box()), rim_distance(open_box(), mesh)) < 0.8 * apart
        assert mesh.area == pytest.approx(20, rel=0.03)

    def test_neither_the_order_of_the_points_nor_the_threads_matter(self) -> None:
        cloud = on_open_box(2_000)
        one = reconstruct_points(cloud, open=True, threads=2).mesh
        other = reconstruct_points(cloud[::-1], open=True, threads=1).mesh
        np.testing.assert_array_equal(one.vertices, other.vertices)
        np.testing.assert_array_equal(one.faces, other.faces)

    def test_two_sheets_are_both_kept_or_the_largest_alone(self) -> None:
        cloud = np.concatenate([on_square(3_000), 0.6 * on_square(1_080, seed=1) + [0.1, 0.1, 1]])
        for largest, expected in ((False, 2), (True, 1)):
            quality = reconstruct_points(cloud, open=True, largest=largest).report["quality"]
            assert (quality["components"], quality["boundary_loops"]) == (expected, expected)

    def test_the_refusal_counts_the_borders(self) -> None:
        turn, height = np.random.default_rng(6).random((2, 6_000))
        cloud = np.column_stack([np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn), 4 * height])
        with pytest.raises(GeometryError, match="open surface") as refused:
            reconstruct_points(cloud)
        assert "2 border(s)" in str(refused.value)


@pytest.mark.skipif(not COMPILED, reason="slow without compiled kernels")
class TestSharedSurfaces:
    @pytest.mark.parametrize(
        ("name", "count", "noise"),
        [
            ("hand/hand_lowres", 5_000, 0.0),
            ("hand/hand_lowres", 5_000, 1e-3),
            ("cube/cube_no_bottom", 5_000, 0.0),
            ("cube/cube_no_bottom", 5_000, 1e-3),
            ("plane/plane_holes", 30_000, 0.0),
        ],
    )
    def test_have_the_borders_of_the_reference(self, name: str, count: int, noise: float) -> None:
        path = DATA / f"{name}.obj"
        if not path.exists():
            pytest.skip("the shared surfaces are not here")
        truth: Any = trimesh.load(path, process=False)
        truth.merge_vertices(merge_tex=True, merge_norm=True)
        cloud = np.asarray(trimesh.sample.sample_surface(truth, count, seed=7)[0])
        cloud = cloud + np.random.default_rng(7).normal(0, noise * np.linalg.norm(truth.extents), cloud.shape)
        surface = reconstruct_points(cloud, open=True)
        mesh = trimesh.Trimesh(surface.mesh.vertices, surface.mesh.faces, process=False)
        quality, apart = surface.report["quality"], float(np.sqrt(truth.area / count))
        assert (mesh.body_count, mesh.euler_number) == (truth.body_count, truth.euler_number)
        assert quality["boundary_loops"] == 2 - truth.euler_number
        assert quality["self_intersections"] == 0
        assert max(rim_distance(mesh, truth), rim_distance(truth, mesh)) < 0.8 * apart
        places = trimesh.sample.sample_surface(mesh, 1_000, seed=1)[0]
        assert distances(truth, places).mean() < 0.1 * apart
