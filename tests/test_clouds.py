"""From any unoriented points to a closed surface, at defaults: shapes whose truth is known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tomomesh import reconstruct_points
from tomomesh.errors import GeometryError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.results import Surface

    Floats = NDArray[np.float64]


def on_sphere(
    count: int, radius: float = 10.0, center: tuple[float, float, float] = (0, 0, 0), seed: int = 0
) -> Floats:
    x = np.random.default_rng(seed).normal(size=(count, 3))
    return np.asarray(radius * x / np.linalg.norm(x, axis=1, keepdims=True) + np.array(center))


def on_torus(count: int, seed: int = 0) -> Floats:
    """Points on a torus of radii 10 and 4, uniform by area."""
    rng = np.random.default_rng(seed)
    u, v, keep = 2 * np.pi * rng.random((3, 2 * count))
    near = keep / (2 * np.pi) < (10 + 4 * np.cos(v)) / 14
    u, v = u[near][:count], v[near][:count]
    ring = 10 + 4 * np.cos(v)
    return np.column_stack([ring * np.cos(u), ring * np.sin(u), 4 * np.sin(v)])


def off_torus(places: Floats) -> Floats:
    return np.asarray(np.hypot(np.hypot(places[:, 0], places[:, 1]) - 10, places[:, 2]) - 4)


def on_box(count: int, seed: int = 0) -> Floats:
    """Points on the cube of side 2 about the origin."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-1, 1, (count, 3))
    axis = rng.integers(0, 3, count)
    places[np.arange(count), axis] = np.sign(places[np.arange(count), axis])
    return np.asarray(places)


def assert_sound(surface: Surface, *, genus: int = 0, components: int = 1) -> dict[str, Any]:
    quality: dict[str, Any] = surface.report["quality"]
    assert quality["sound"]
    assert quality["sound_after_welding"]
    assert quality["self_intersections"] == 0
    assert (quality["components"], quality["genus"]) == (components, genus)
    return quality


@pytest.fixture(scope="module")
def torus() -> Surface:
    return reconstruct_points(on_torus(20_000))


class TestCleanClouds:
    def test_a_sphere_keeps_its_radius(self) -> None:
        surface = reconstruct_points(on_sphere(50_000))
        quality = assert_sound(surface)
        radius = np.linalg.norm(surface.mesh.vertices, axis=1)
        assert abs(radius.mean() / 10 - 1) < 1e-3
        assert radius.std() / 10 < 1e-3
        assert quality["volume_mm3"] == pytest.approx(4 / 3 * np.pi * 1000, rel=1e-3)

    def test_a_torus_is_a_torus(self, torus: Surface) -> None:
        quality = assert_sound(torus, genus=1)
        assert np.abs(off_torus(torus.mesh.vertices)).mean() < 0.02 * torus.report["points"]["spacing_mm"]
        assert quality["volume_mm3"] == pytest.approx(2 * np.pi**2 * 10 * 16, rel=2e-3)

    def test_the_error_falls_with_the_square_of_the_spacing(self) -> None:
        error = [np.abs(off_torus(reconstruct_points(on_torus(n)).mesh.vertices)).mean() for n in (4_000, 16_000)]
        assert np.log2(error[0] / error[1]) > 1.5  # four times the points are half the spacing

    def test_a_large_straight_cloud_gets_larger_cubes(self, monkeypatch: pytest.MonkeyPatch) -> None:
        cells = []
        for many in (32_000, 10_000):
            monkeypatch.setattr("tomomesh.ways.clouds.samples.MANY", many)
            surface = reconstruct_points(on_torus(32_000))
            assert_sound(surface, genus=1)
            cells.append(surface.report["cubes"]["cell_mm"][0] / surface.report["points"]["spacing_mm"])
        assert cells[0] == pytest.approx(0.95, rel=0.01)
        assert 1.3 < cells[1] < 1.51

    def test_edges_of_a_box_are_sharp_within_a_sampling_distance(self) -> None:
        surface = reconstruct_points(on_box(20_000))
        assert_sound(surface)
        reach = np.abs(surface.mesh.vertices).max(axis=1)
        spacing = surface.report["points"]["spacing_mm"]
        assert np.abs(reach - 1).max() < spacing
        assert np.abs(reach - 1).mean() < 0.03 * spacing

    def test_vertices_are_evenly_spread(self, torus: Surface) -> None:
        edges = torus.report["quality"]
        assert edges["p95_edge_mm"] < 3 * edges["p5_edge_mm"]

    def test_density_may_vary(self) -> None:
        dense = on_sphere(30_000)
        sparse = on_sphere(30_000, seed=1)[::8]
        surface = reconstruct_points(np.concatenate([dense[dense[:, 2] > 0], sparse[sparse[:, 2] <= 0]]))
        assert_sound(surface)
        assert np.abs(np.linalg.norm(surface.mesh.vertices, axis=1) - 10).mean() < 0.02


class TestNoisyClouds:
    @pytest.mark.parametrize("noise", [0.05, 0.1])
    def test_noise_is_seen_and_averaged_out(self, noise: float) -> None:
        cloud = on_torus(20_000) + noise * np.random.default_rng(3).normal(size=(20_000, 3))
        surface = reconstruct_points(cloud)
        assert_sound(surface, genus=1)
        assert surface.report["points"]["noise_mm"] == pytest.approx(noise, rel=0.25)
        assert np.abs(off_torus(surface.mesh.vertices)).mean() < noise / 2.5

    def test_noise_far_above_the_spacing_is_merged(self) -> None:
        cloud = on_sphere(40_000) * (1 + 0.05 * np.random.default_rng(4).normal(size=(40_000, 1)))
        surface = reconstruct_points(cloud)
        assert_sound(surface)
        assert np.abs(np.linalg.norm(surface.mesh.vertices, axis=1) - 10).mean() < 0.5 / 4

    def test_strays_neither_make_nor_bend_surface(self, torus: Surface) -> None:
        cloud = on_torus(20_000)
        strays = np.random.default_rng(5).uniform(cloud.min(axis=0), cloud.max(axis=0), (400, 3))
        surface = reconstruct_points(np.concatenate([cloud, strays]))
        assert_sound(surface, genus=1)
        assert surface.report["points"]["strays"] > 100
        before, after = (np.abs(off_torus(found.mesh.vertices)).mean() for found in (torus, surface))
        assert after < 2.5 * before


class TestSameBytes:
    @pytest.mark.parametrize("change", ["threads", "shuffled", "repeated"])
    def test_whatever_the(self, torus: Surface, change: str) -> None:
        cloud, threads = on_torus(20_000), 0
        if change == "threads":
            threads = 1
        elif change == "shuffled":
            cloud = cloud[np.random.default_rng(6).permutation(len(cloud))]
        else:
            cloud = np.concatenate([cloud, cloud[::3], cloud[:5]])
        again = reconstruct_points(cloud, threads=threads).mesh
        assert again.vertices.tobytes() == torus.mesh.vertices.tobytes()
        assert again.faces.tobytes() == torus.mesh.faces.tobytes()

    def test_far_from_the_origin_as_near_it(self) -> None:
        near = np.round(on_torus(4_000) * 2**10) / 2**10
        here, there = (reconstruct_points(near + shift, remesh=False).mesh for shift in (0.0, 2.0**30))
        assert np.array_equal(here.faces, there.faces)
        assert np.abs(there.vertices - 2.0**30 - here.vertices).max() < 2.0**-20


class TestSeveralObjects:
    CLOUD = np.concatenate([on_sphere(8_000), on_sphere(2_000, 4, seed=1), on_sphere(6_000, 6, (30, 0, 0), seed=2)])

    def test_outer_surfaces_are_taken_by_themselves(self) -> None:
        quality = assert_sound(reconstruct_points(self.CLOUD, surface="outer"), components=2)
        assert quality["volume_mm3"] == pytest.approx(4 / 3 * np.pi * (10**3 + 6**3), rel=5e-3)

    def test_what_lies_inside_is_a_cavity(self) -> None:
        quality = assert_sound(reconstruct_points(self.CLOUD), components=3)
        assert quality["volume_mm3"] == pytest.approx(4 / 3 * np.pi * (10**3 - 4**3 + 6**3), rel=5e-3)

    def test_the_largest_alone(self) -> None:
        quality = assert_sound(reconstruct_points(self.CLOUD, largest=True))
        assert quality["volume_mm3"] == pytest.approx(4 / 3 * np.pi * 10**3, rel=5e-3)

    def test_crumbs_are_left_out(self) -> None:
        crumbs = on_sphere(60, 0.3, (20, 20, 20), seed=3)
        surface = reconstruct_points(np.concatenate([on_sphere(8_000), crumbs]))
        assert_sound(surface)


class TestLeaks:
    def test_half_a_sphere_is_refused_and_its_gap_named(self) -> None:
        cloud = on_sphere(8_000)
        with pytest.raises(GeometryError, match="two walls") as refused:
            reconstruct_points(cloud[cloud[:, 2] > 0])
        assert "a gap of" in str(refused.value)

    def test_a_leaking_shell_is_given_where_that_is_allowed(self) -> None:
        cloud = on_sphere(8_000)
        surface = reconstruct_points(cloud[cloud[:, 2] > 0], allow_leaks=True)
        assert surface.report["quality"]["sound"]
        assert any("two walls" in warning for warning in surface.report["warnings"])

    def test_a_hole_of_ten_spacings_is_closed_and_marked(self) -> None:
        cloud = on_sphere(20_000)
        surface = reconstruct_points(cloud[np.linalg.norm(cloud - [0, 0, 10], axis=1) > 1.25])
        assert_sound(surface)
        centers = surface.mesh.corners.mean(axis=1)
        assert surface.filled is not None
        assert surface.filled[np.linalg.norm(centers - [0, 0, 10], axis=1) < 0.6].all()
        assert not surface.filled[np.linalg.norm(centers - [0, 0, 10], axis=1) > 2].any()


class TestFlatClouds:
    @pytest.mark.parametrize(
        "cloud",
        [
            np.zeros((1, 3)),
            np.eye(3)[:2],
            np.ones((500, 3)),
            np.outer(np.arange(50.0), [1, 2, 3]),
            np.column_stack([np.random.default_rng(0).random((2_000, 2)), np.zeros(2_000)]),
            np.random.default_rng(0).random((2_000, 2)) @ np.array([[1.0, 2, 3], [3, -1, 1]]),
        ],
        ids=["one", "two", "same", "line", "plane", "oblique"],
    )
    def test_give_a_smoothed_shell_and_a_warning(self, cloud: Floats) -> None:
        surface = reconstruct_points(cloud)
        assert surface.report["quality"]["sound"]
        assert any("not fitted" in warning for warning in surface.report["warnings"])
        assert surface.mesh is not None
        again = reconstruct_points(np.concatenate([cloud, cloud[::2]]))
        assert again.mesh.vertices.tobytes() == surface.mesh.vertices.tobytes()
