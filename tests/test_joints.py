"""What lies near something else is parted from it: two objects, and two sheets of one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial import Delaunay

from conftest import law, seeds
from test_clouds import assert_sound, on_box, on_sphere, on_torus
from tomomesh import reconstruct_points
from tomomesh.kernels.pointcloud.stars import beside, fill_triangle, spread_out
from tomomesh.model.cubes import cells_of
from tomomesh.pointcloud.bridges import bridges
from tomomesh.pointcloud.facing import ACROSS, facing_pairs
from tomomesh.pointcloud.samples import Samples, settle_points
from tomomesh.pointcloud.stars import keys_between

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def spacing_of(area: float, count: int) -> float:
    return float(np.sqrt(area / count))


def beside_another(cloud: Floats, apart: float) -> Floats:
    """Points of an object, and of the same one beside it along x."""
    return np.concatenate([cloud, cloud + np.array([np.ptp(cloud[:, 0]) + apart, 0, 0])])


def on_coil(count: int, apart: float, radius: float = 0.15, turns: int = 3) -> Floats:
    """Points on a tube about a helix of radius 1, whose turns are sampling distances apart, and on its round ends."""
    s = spacing_of(turns * 2 * np.pi * 2 * np.pi * radius, count)
    rise = (2 * radius + apart * s) / (2 * np.pi)
    rng = np.random.default_rng(1)
    t, around, kept = rng.random((3, 2 * count)) * 2 * np.pi
    near = kept / (2 * np.pi) < (1 + radius * np.cos(around)) / (1 + radius)
    t, around = turns * t[near][:count], around[near][:count]
    out = np.column_stack([np.cos(t), np.sin(t), 0 * t])
    along = np.column_stack([-np.sin(t), np.cos(t), np.full(len(t), rise)]) / np.hypot(1, rise)
    up = np.cross(out, along)
    axis = np.column_stack([np.cos(t), np.sin(t), rise * t])
    tube = axis + radius * (np.cos(around)[:, None] * out + np.sin(around)[:, None] * up)
    end = 2 * np.pi * turns
    caps = []
    for place, way in (((1, 0, 0), (0, -1, -rise)), ((1, 0, rise * end), (0, 1, rise))):
        ball = on_sphere(int(4 * np.pi * radius**2 / s**2), radius)
        caps.append(ball[ball @ np.array(way) > 0] + np.array(place))
    return np.concatenate([tube, *caps])


def crossing_rods(count: int, apart: float, seed: int, radius: float = 0.3) -> Floats:
    """Points on two round-ended rods, of length 4 between the ends' middles, that cross sampling distances apart."""
    rng = np.random.default_rng(seed)
    s = spacing_of(2 * 2 * np.pi * radius * (4 + 2 * radius), count)
    rods = []
    for _ in range(2):
        along = rng.uniform(-2 - radius, 2 + radius, count // 2)  # equal areas: Archimedes
        beyond = np.abs(along) - 2
        width = np.sqrt(radius**2 - np.maximum(beyond, 0) ** 2)
        around = rng.uniform(0, 2 * np.pi, count // 2)
        rods.append(np.column_stack([along, width * np.cos(around), width * np.sin(around)]))
    return np.concatenate([rods[0], rods[1][:, [1, 0, 2]] + np.array([0, 0, 2 * radius + apart * s])])


class TestObjects:
    @pytest.mark.parametrize("apart", [3.0, 4.0])
    def test_boxes_are_two(self, apart: float) -> None:
        cloud = beside_another(on_box(5_000), apart * spacing_of(24, 5_000))
        quality = assert_sound(reconstruct_points(cloud), components=2)
        assert quality["volume_mm3"] == pytest.approx(16, rel=0.01)

    @pytest.mark.parametrize("apart", [2.0, 3.0])
    def test_spheres_are_two(self, apart: float) -> None:
        cloud = beside_another(on_sphere(5_000), apart * spacing_of(400 * np.pi, 5_000))
        assert_sound(reconstruct_points(cloud), components=2)

    @pytest.mark.parametrize("apart", [0.5, 1.0])
    def test_nearer_boxes_are_told_of_by_their_place(self, apart: float) -> None:
        cloud = beside_another(on_box(1_500), apart * spacing_of(24, 1_500))
        surface = reconstruct_points(cloud)
        assert surface.report["quality"]["components"] == 2 or any(
            "around (" in one for one in surface.report["warnings"]
        )

    @pytest.mark.parametrize("seed", range(3))
    def test_rods_that_cross_are_told_of_though_they_touch_at_one_place(self, seed: int) -> None:
        surface = reconstruct_points(crossing_rods(6_000, 1.0, seed))
        assert surface.report["quality"]["components"] == 2 or any(
            "around (" in one for one in surface.report["warnings"]
        )

    @pytest.mark.parametrize("apart", [2.0, 3.0])
    def test_rods_that_cross_farther_apart_are_two(self, apart: float) -> None:
        surface = reconstruct_points(crossing_rods(6_000, apart, 0))
        assert_sound(surface, components=2)
        assert not surface.report["warnings"]


class TestSheetsOfOneObject:
    @pytest.mark.parametrize("apart", [2.0, 3.0])
    def test_the_turns_of_a_coil_stay_apart(self, apart: float) -> None:
        quality = assert_sound(reconstruct_points(on_coil(4_000, apart)))
        tube, ends = np.pi * 0.15**2 * 3 * 2 * np.pi, 4 / 3 * np.pi * 0.15**3
        assert quality["volume_mm3"] == pytest.approx(tube + ends, rel=0.03)

    def test_a_shell_of_two_walls_keeps_both(self) -> None:
        cloud = np.concatenate([on_sphere(6_100, 10), on_sphere(3_900, 8)])
        surface = reconstruct_points(cloud)
        assert surface.report["quality"]["components"] == 2
        assert surface.report["quality"]["volume_mm3"] == pytest.approx(4 / 3 * np.pi * (1000 - 512), rel=0.01)


class TestBridges:
    def test_none_leads_over_a_slot(self) -> None:
        """Two boxes with coplanar tops: what lies flat at both ends may still not be a hole."""
        apart = 3 * spacing_of(24, 5_000)
        samples = settle_points(beside_another(on_box(5_000), apart))
        x = bridges(samples, 0.05)[:, 0]
        assert not ((x > 1 + 0.3 * apart) & (x < 1 + 0.7 * apart)).any()

    def test_one_leads_over_a_hole(self) -> None:
        cloud = on_sphere(5_000)
        samples = settle_points(cloud[np.hypot(cloud[:, 0], cloud[:, 1]) + 100 * (cloud[:, 2] < 0) > 1.0])
        places = bridges(samples, 0.25)
        assert ((np.hypot(places[:, 0], places[:, 1]) < 0.5) & (places[:, 2] > 0)).any()


class TestFacing:
    @given(seeds)
    @law(30)
    def test_are_all_pairs_whose_step_runs_along_both_normals(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        places, reach = rng.uniform(0, 5, (150, 3)), 1.5
        normals = rng.normal(size=places.shape)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        level = np.ones(len(places))
        samples = Samples(places, normals, level, 0 * level, level, 0, 1.0)
        steps = places[:, None] - places
        away = np.linalg.norm(steps, axis=2)
        along = np.abs(np.einsum("ijk,ik->ij", steps, normals)) > ACROSS * away
        facing = along & along.T & (away <= reach) & (away > 0)
        found = facing_pairs(samples, reach)
        assert {frozenset(pair) for pair in found.tolist()} == {
            frozenset(pair) for pair in np.argwhere(facing).tolist()
        }
        assert 2 * len(found) == facing.sum()
        asked = rng.random(len(places)) < 0.2
        kept = found[asked[found].any(axis=1)]
        assert (np.unique(facing_pairs(samples, reach, asked), axis=0) == np.unique(kept, axis=0)).all()

    def test_room_is_made_for_more(self, monkeypatch: pytest.MonkeyPatch) -> None:
        samples = settle_points(beside_another(on_box(3_000), spacing_of(24, 3_000)))
        plenty = facing_pairs(samples, 1.5 * float(np.median(samples.spacing)))
        monkeypatch.setattr("tomomesh.pointcloud.facing.ROOM", 1)
        assert len(plenty) > 1
        assert (facing_pairs(samples, 1.5 * float(np.median(samples.spacing))) == plenty).all()

    def test_nothing_is_looked_at_again_where_none_do(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """A ring has a handle, and no part of it lies near another; two rings that touch do."""
        looked_at: list[int] = []

        def counted(*args: Any, **options: Any) -> NDArray[np.int64]:
            looked_at.append(1)
            return keys_between(*args, **options)

        monkeypatch.setattr("tomomesh.ways.clouds.joints.keys_between", counted)
        reconstruct_points(on_torus(5_000))
        assert not looked_at
        reconstruct_points(beside_another(on_torus(5_000), 0.0))
        assert looked_at


class TestStars:
    @pytest.mark.parametrize("name", ["ROOM", "CUBES"])
    def test_room_is_made_for_more(self, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
        samples, cell = settle_points(on_sphere(500)), np.full(3, 0.2)
        plenty = keys_between(samples, np.full(3, -11.0), cell)
        monkeypatch.setattr(f"tomomesh.pointcloud.stars.{name}", 8)
        assert (keys_between(samples, np.full(3, -11.0), cell) == plenty).all()

    @given(seeds)
    @law(60)
    def test_are_the_triangles_of_delaunay(self, seed: int) -> None:
        places = np.random.default_rng(seed).uniform(-1, 1, (24, 2))
        places[0] = 0
        corners, neighbors = Delaunay(places).vertex_neighbor_vertices
        hull = np.unique(Delaunay(places).convex_hull)
        if 0 in hull:
            return
        known = set(neighbors[corners[0] : corners[1]].tolist())
        others = np.ascontiguousarray(places[1:])
        first = one = int(np.argmin((others**2).sum(axis=1)))
        found: list[int] = []
        while one >= 0 and len(found) < len(others):
            found.append(one + 1)
            one = beside(others, len(others), one, 1.0)
            if one == first:
                break
        assert len(found) == len(set(found))
        assert set(found) == known

    def test_lays_no_neighbor_of_the_sheet_across(self) -> None:
        flat = [(x, y, z, 0, 0, 1, 1) for z in (0.0, 2.0) for x in range(-2, 3) for y in range(-2, 3)]
        rows = np.array(flat, float)
        found, places = np.arange(len(rows)), np.empty((len(rows), 2))
        count = spread_out(rows, 12, found, len(rows), places)
        assert sorted(found[:count]) == [n for n in range(25) if n != 12]
        assert np.allclose(np.abs(places[:count]), np.abs(rows[found[:count], :2][:, ::-1]))

    def test_places_on_a_triangle_leave_no_gap(self) -> None:
        rows = np.zeros((3, 7))
        rows[1, 0], rows[2, 1] = 3.0, 2.0
        places = np.empty((500, 3))
        count = fill_triangle(rows, 0, 1, 2, 0.2, places, 0)
        inside = np.random.default_rng(0).dirichlet((1, 1, 1), 300) @ rows[:, :3]
        away = np.linalg.norm(inside[:, None] - places[:count], axis=2).min(axis=1)
        assert away.max() < 0.2
        assert places[:count].min() >= 0
        assert (places[:count, 0] / 3 + places[:count, 1] / 2).max() < 1 + 1e-12

    def test_cubes_of_a_plane_are_all_of_them(self) -> None:
        rng = np.random.default_rng(0)
        flat = np.column_stack([rng.uniform(0, 40, (1_600, 2)), np.full(1_600, 0.5)])
        cells = cells_of(keys_between(settle_points(flat), np.zeros(3), np.full(3, 0.5)))
        inner = cells[((cells[:, :2] >= 6) & (cells[:, :2] < 74)).all(axis=1)]
        assert set(cells[:, 2]) <= {0, 1}  # the plane is where they meet
        assert len(np.unique(inner[:, :2], axis=0)) >= 0.999 * 68 * 68  # but for corners that are grazed
