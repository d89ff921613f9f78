"""Stacks of contours: told from other clouds, and closed between slices that lie far apart."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh
from scipy import ndimage

from conftest import sphere, torus
from studies import shared
from tomomesh.contours.slices import find_slices
from tomomesh.contours.stack import ContourSurface, contour_surface
from tomomesh.errors import EmptyError, GeometryError
from tomomesh.measure.intersections import self_intersections
from tomomesh.measure.topology import check_promise, topology

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def circle(x: float, y: float, radius: float, height: float, count: int = 0) -> Floats:
    """Return points on a circle, a millimeter apart where their number is not given."""
    count = count or max(round(2 * np.pi * radius), 6)
    turn = 2 * np.pi * np.arange(count) / count
    return np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn), np.full(count, height)])


def ball(heights: Floats, radius: float = 25.0, count: int = 0) -> list[Floats]:
    return [circle(0, 0, np.sqrt(radius**2 - z**2), z, count) for z in heights]


def legs(slope: float, step: float = 6.0) -> Floats:
    """Return two slanted legs, 10 mm thick and 3 mm apart."""
    slices = range(12)
    return np.concatenate([circle(x + slope * step * k, 0, 5, step * k) for k in slices for x in (0, 13)])


def turned(points: Floats, seed: int) -> Floats:
    rng = np.random.default_rng(seed)
    moved: Floats = points @ np.linalg.qr(rng.normal(size=(3, 3)))[0].T + rng.uniform(-500, 500, 3)
    return moved


def closed(points: Floats, *, allow_leaks: bool = False) -> ContourSurface:
    """Close a stack whose points come in any order, and let the strongest judges look at it."""
    points = np.random.default_rng(0).permutation(points)
    slices = find_slices(points)
    assert slices is not None
    made = contour_surface(points, slices, allow_leaks=allow_leaks)
    check_promise(made.mesh, cavities=made.boundary.cavities)
    assert not self_intersections(made.mesh).any()
    return made


def volume(made: ContourSurface) -> float:
    return float(made.mesh.face_volumes.sum())


class TestFound:
    """Which clouds are stacks of contours."""

    @pytest.mark.parametrize("noise", [0.0, 0.2])
    def test_an_oblique_stack_is_found_with_its_planes(self, noise: float) -> None:
        stack = legs(0.5)
        noisy = stack + np.random.default_rng(1).normal(0, noise, stack.shape)
        slices = find_slices(turned(noisy, 2))
        assert slices is not None
        normal = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0][:, 2]
        assert abs(slices.normal @ normal) > np.cos(0.1 * noise + 1e-6)
        np.testing.assert_allclose(np.diff(slices.heights), 6, atol=noise + 1e-6)
        upward = np.sign(slices.normal @ normal)
        true = np.rint(stack[:, 2] / 6)
        np.testing.assert_array_equal(slices.labels, true if upward > 0 else 11 - true)
        np.testing.assert_allclose(slices.axes @ slices.axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(slices.axes) == pytest.approx(1)

    def test_two_slices_are_too_few(self) -> None:
        assert find_slices(np.concatenate(ball(np.array([-3.0, 3.0])))) is None

    def test_slices_as_near_as_the_points_are_none(self) -> None:
        assert find_slices(np.concatenate(ball(np.arange(-20, 20, 1.5)))) is None

    @pytest.mark.parametrize("thick", [1, 2, 3])
    def test_voxels_are_none(self, thick: int) -> None:
        grid = np.stack(np.meshgrid(*[np.arange(-30, 31)] * 2, np.arange(-30, 31, thick), indexing="ij"), axis=-1)
        solid = (grid**2).sum(axis=-1) < 28**2
        skin = solid & ~ndimage.binary_erosion(solid)
        assert find_slices(grid[skin].astype(float)) is None
        assert find_slices(grid[solid].astype(float)) is None

    @pytest.mark.parametrize("lines", [1.0, 5.0])
    @pytest.mark.parametrize("relief", [0.1, 3.0, 20.0])
    def test_scans_of_a_landscape_are_none(self, lines: float, relief: float) -> None:
        x, y = np.meshgrid(np.arange(0, 100.0), np.arange(0, 100, lines))
        z = relief * np.sin(x / 20) * np.cos(y / 30)
        for heights in (z, np.round(z)):
            assert find_slices(np.column_stack([x.ravel(), y.ravel(), heights.ravel()])) is None

    def test_a_depth_image_is_none(self) -> None:
        x, y = np.meshgrid(np.arange(-50, 51.0), np.arange(-50, 51.0))
        seen = x**2 + y**2 < 2400
        depth = np.sqrt(2500 - x[seen] ** 2 - y[seen] ** 2)
        assert find_slices(np.column_stack([x[seen], y[seen], depth])) is None

    @pytest.mark.parametrize("height", [100, 20, 5])
    def test_the_faces_of_a_box_are_none(self, height: int) -> None:
        extents = (100, 100, height)
        box = trimesh.creation.box(extents)
        assert find_slices(trimesh.sample.sample_surface(box, 10_000, seed=1)[0]) is None
        grid = np.stack(np.meshgrid(*(np.arange(n + 1.0) for n in extents), indexing="ij"), axis=-1).reshape(-1, 3)
        assert find_slices(grid[((grid == 0) | (grid == extents)).any(axis=1)]) is None

    def test_ordinary_clouds_are_none(self) -> None:
        drawn = np.random.default_rng(0).normal(size=(5000, 3))
        for cloud in (sphere(5000), torus(5000), drawn, drawn * [1, 1, 0], drawn * [1, 0, 0], drawn[:10]):
            assert find_slices(cloud) is None
        arm = trimesh.load(shared("common3d/rocker-arm.obj"), force="mesh")
        assert find_slices(np.asarray(arm.vertices)) is None

    def test_a_helix_and_lines_are_none(self) -> None:
        turn = np.linspace(0, 40 * np.pi, 2600)
        assert find_slices(np.column_stack([20 * np.cos(turn), 20 * np.sin(turn), 0.8 * turn])) is None
        rays = np.stack(np.meshgrid(np.arange(50.0), 5 * np.arange(8.0), 5 * np.arange(8.0)), axis=-1).reshape(-1, 3)
        assert find_slices(rays) is None


class TestSurface:
    """Closed, smooth, the right pieces and handles, the right volume."""

    @pytest.mark.parametrize("change", ["none", "noise", "oblique"])
    def test_a_torus_and_a_sphere_on_slices_five_apart(self, change: str) -> None:
        points = np.loadtxt(shared("clouds/contours/torus_sphere_5to1.xyz"))[:, :3]
        if change == "noise":
            points = points + np.random.default_rng(0).normal(0, 0.2, points.shape)
        made = closed(turned(points, 5) if change == "oblique" else points)
        found = topology(made.mesh)
        assert (found.components, found.genus) == (2, 1)
        assert volume(made) == pytest.approx(243_103, rel=0.0125)
        assert (made.slices, made.contours, made.open) == (22, 42, 0)
        if change != "oblique":
            x, y, z = made.mesh.vertices[np.unique(made.mesh.faces[~made.filled])].T
            ring = np.hypot(np.hypot(x, z) - 40, y) - 15
            away = np.where(x > 75, np.sqrt((x - 120) ** 2 + y**2 + z**2) - 25, ring)
            assert np.sqrt((away**2).mean()) < 0.2
            assert abs(away.mean()) < 0.05

    @pytest.mark.parametrize("slope", [0.0, 0.5, 0.8, 1.0, 1.3])
    def test_slanted_legs_stay_two_and_keep_their_width(self, slope: float) -> None:
        made = closed(legs(slope))
        found = topology(made.mesh)
        assert (found.components, found.genus) == (2, 0)
        assert volume(made) == pytest.approx(2 * np.pi * 25 * 72, rel=0.02)

    @pytest.mark.parametrize("seed", [0, 1])
    def test_noise_joins_no_legs(self, seed: int) -> None:
        points = legs(0.8)
        made = closed(points + np.random.default_rng(seed).normal(0, 0.2, points.shape))
        assert topology(made.mesh).components == 2

    def test_a_leg_that_ends_beside_another_does_not_join_it(self) -> None:
        long = [circle(4.8 * k, 0, 5, 6 * k) for k in range(12)]
        short = [circle(13 + 4.8 * k, 0, 5, 6 * k) for k in range(7)]
        assert topology(closed(np.concatenate([*long, *short])).mesh).components == 2

    def test_a_trunk_branches(self) -> None:
        branches = [circle(side * (6.5 + 4.8 * k), 0, 5, 6 * k) for k in range(8) for side in (-1, 1)]
        trunk = [circle(0, 0, 10, -6 * k) * [1, 0.6, 1] for k in range(1, 6)]
        made = closed(np.concatenate([*branches, *trunk]))
        found = topology(made.mesh)
        assert (found.components, found.genus) == (1, 0)

    def test_a_tube_has_its_hole(self) -> None:
        rings = [circle(x, 0, r, 5 * k) for k in range(10) for x, r in ((0, 20), (2, 8))]
        made = closed(np.concatenate(rings))
        assert (topology(made.mesh).components, topology(made.mesh).genus) == (1, 1)
        assert volume(made) == pytest.approx(np.pi * (400 - 64) * 50, rel=0.02)

    def test_a_core_in_a_shell(self) -> None:
        heights = np.arange(-23, 24, 5.0)
        rings = [circle(0, 0, np.sqrt(r**2 - z**2), z) for z in heights for r in (30, 20, 10) if abs(z) < r]
        made = closed(np.concatenate(rings))
        assert topology(made.mesh, cavities=1).sound
        assert (topology(made.mesh).components, made.boundary.cavities) == (3, 1)

    @pytest.mark.parametrize("offset", [0.1, 1.0, 2.0, 3.0, 4.0])
    def test_a_ball_is_rounded_off_wherever_it_is_cut(self, offset: float) -> None:
        made = closed(np.concatenate(ball(np.arange(-25 + offset, 25, 5))))
        assert volume(made) == pytest.approx(4 / 3 * np.pi * 25**3, rel=0.02)
        assert np.abs(made.mesh.vertices[:, 2]).max() < 25.7
        assert 0.03 < made.filled.mean() < 0.12

    @pytest.mark.parametrize("kind", ["missing", "uneven", "gaps", "sampling", "dense"])
    def test_a_ball_of_irregular_slices(self, kind: str) -> None:
        rng = np.random.default_rng(3)
        heights = np.arange(-22.5, 24, 5)
        if kind == "missing":
            heights = np.delete(heights, 4)
        if kind == "uneven":
            heights = heights + rng.uniform(-1, 1, len(heights))
        rings = ball(heights, count=300 if kind == "dense" else 0)
        if kind == "gaps":
            rings = [np.delete(ring, np.arange(3) + rng.integers(len(ring) - 3), axis=0) for ring in rings]
        if kind == "sampling":
            rings = [
                circle(0, 0, np.sqrt(625 - z**2), z, int(n))
                for z, n in zip(heights, np.geomspace(30, 300, 10), strict=True)
            ]
        made = closed(np.concatenate(rings))
        assert (topology(made.mesh).components, topology(made.mesh).genus) == (1, 0)
        assert volume(made) == pytest.approx(4 / 3 * np.pi * 25**3, rel=0.015)

    def test_there_are_no_terraces(self) -> None:
        made = closed(np.concatenate([circle(0, 0, 20 + 0.2 * 5 * k, 5 * k) for k in range(10)]))
        center, normal = made.mesh.corners.mean(axis=1), made.mesh.face_vectors
        wall = (center[:, 2] > 5) & (center[:, 2] < 40)
        rise = normal[wall, 2] / np.hypot(normal[wall, 0], normal[wall, 1])
        assert rise.mean() == pytest.approx(-0.2, abs=0.01)
        assert rise.std() < 0.06

    def test_an_open_contour_is_refused_by_its_height(self) -> None:
        rings = ball(np.arange(-22.5, 24, 5))
        rings[3] = rings[3][:90]
        points = np.concatenate(rings)
        slices = find_slices(points)
        assert slices is not None
        with pytest.raises(GeometryError, match=r"does not close.*slice at -7\.5 along \(0, 0, 1\)") as refused:
            contour_surface(points, slices)
        assert refused.value.exit_code == 5
        made = closed(points, allow_leaks=True)
        assert (topology(made.mesh).components, made.open) == (1, 1)

    def test_memory_is_bounded(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("tomomesh.contours.stack.MOST_VOXELS", 50_000)
        made = closed(np.concatenate(ball(np.arange(-22.5, 24, 5))))
        assert made.edge > made.asked_edge
        assert made.voxels <= 50_000
        assert topology(made.mesh).components == 1

    def test_one_closed_slice_is_too_few(self) -> None:
        points = np.concatenate(ball(np.array([-5.0, 0.0, 5.0])))
        slices = find_slices(points)
        assert slices is not None
        kept = points[(points[:, 2] == 0) | (np.arange(len(points)) % 40 == 0)]
        labels = slices.labels[(points[:, 2] == 0) | (np.arange(len(points)) % 40 == 0)]
        with pytest.raises(EmptyError):
            contour_surface(kept, replace(slices, labels=labels))
