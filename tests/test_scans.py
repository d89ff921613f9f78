"""Clouds that no shell of cubes holds: few points, thin parts, noise of several spacings, gaps and open bottoms."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tomomesh import reconstruct_points
from tomomesh.cuberille.bitmasks import Blocks
from tomomesh.cuberille.closing import shell_around
from tomomesh.cuberille.faces import exposed_faces
from tomomesh.dynamics.membrane import capped, carried_on
from tomomesh.errors import GeometryError
from tomomesh.measure.topology import check_promise
from tomomesh.model.icosphere import icosphere
from tomomesh.model.mesh import TriMesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh import Surface

    Floats = NDArray[np.float64]


def on_sphere(count: int, radius: float = 1.0, seed: int = 1) -> Floats:
    x = np.random.default_rng(seed).normal(size=(count, 3))
    return np.asarray(radius * x / np.linalg.norm(x, axis=1, keepdims=True))


def on_torus(count: int, wide: float, tube: float, seed: int = 1) -> Floats:
    """Draw points of a torus around z, evenly by area."""
    u, v, w = np.random.default_rng(seed).random((3, 4 * count))
    u, v = 2 * np.pi * u, 2 * np.pi * v
    out = wide + tube * np.cos(v)
    kept = np.flatnonzero(w < out / (wide + tube))[:count]
    return np.column_stack([out * np.cos(u), out * np.sin(u), tube * np.sin(v)])[kept]


def on_box(count: int, sides: tuple[float, float, float], seed: int = 1) -> Floats:
    """Draw points of the six sides of a box from the origin, evenly by area."""
    rng, lengths = np.random.default_rng(seed), np.array(sides)
    areas = np.repeat(lengths.prod() / lengths, 2)
    side = rng.choice(6, count, p=areas / areas.sum())
    points = rng.random((count, 3))
    points[np.arange(count), side // 2] = side % 2
    return np.asarray(points * lengths)


def quality_of(surface: Surface, genus: int = 0, components: int = 1) -> dict[str, Any]:
    quality: dict[str, Any] = surface.report["quality"]
    check_promise(surface.mesh, cavities=surface.cavities)
    assert (quality["components"], quality["genus"]) == (components, genus)
    assert quality["self_intersections"] == 0
    return quality


def warned(surface: Surface, words: str) -> bool:
    return any(words in warning for warning in surface.report["warnings"])


class TestFewPoints:
    @pytest.mark.parametrize(("count", "seed"), [(60, 1), (60, 2), (100, 3)])
    def test_of_a_sphere_close(self, count: int, seed: int) -> None:
        surface = reconstruct_points(on_sphere(count, seed=seed))
        assert quality_of(surface)["volume_mm3"] == pytest.approx(4 / 3 * np.pi, rel=0.15)

    @pytest.mark.parametrize("count", [300, 400])
    def test_of_a_torus_keep_its_hole(self, count: int) -> None:
        surface = reconstruct_points(on_torus(count, 1.0, 0.4))
        assert quality_of(surface, genus=1)["volume_mm3"] == pytest.approx(2 * np.pi**2 * 0.16, rel=0.15)
        assert warned(surface, "the normals tell inside from outside, least surely around (")

    def test_in_any_order_and_on_any_threads_give_the_same(self) -> None:
        points = on_torus(300, 1.0, 0.4)
        one = reconstruct_points(points, threads=1).mesh
        other = reconstruct_points(np.random.default_rng(0).permutation(points), threads=3).mesh
        assert np.array_equal(one.vertices, other.vertices)
        assert np.array_equal(one.faces, other.faces)


class TestThinParts:
    @pytest.mark.parametrize("sides", [(1.0, 1.0, 0.06), (0.05, 1.0, 0.5)])
    def test_of_three_spacings_close(self, sides: tuple[float, float, float]) -> None:
        surface = reconstruct_points(on_box(5_000, sides))
        assert quality_of(surface)["volume_mm3"] == pytest.approx(np.prod(sides), rel=0.05)


class TestNoisyScans:
    def test_with_a_gap_are_closed_and_told_of(self) -> None:
        rng = np.random.default_rng(4)
        points = on_torus(12_000, 1.0, 0.4) + 0.05 * rng.normal(size=(12_000, 3))
        points = points[~((points[:, 0] > 0.9) & (np.abs(points[:, 1]) < 0.3) & (points[:, 2] > 0))]
        surface = reconstruct_points(points)
        assert quality_of(surface, genus=1)["volume_mm3"] == pytest.approx(2 * np.pi**2 * 0.16, rel=0.1)

    def test_of_a_box_that_lacks_a_side_are_closed_and_told_of(self) -> None:
        points = on_box(20_000, (1.0, 1.0, 1.0))
        points = points[points[:, 2] > 0] + 0.02 * np.random.default_rng(5).normal(size=((points[:, 2] > 0).sum(), 3))
        surface = reconstruct_points(points)
        assert quality_of(surface)["volume_mm3"] == pytest.approx(1, rel=0.1)
        assert warned(surface, "of the faces lie where there are no points")


class TestThinPlates:
    BALL = TriMesh(*icosphere(16))

    @pytest.mark.parametrize("height", [0.3, 0.5, 0.8])
    def test_end_a_ball_nearer_to_a_ball_than_a_membrane(self, height: float) -> None:
        free = self.BALL.vertices[:, 2] > height
        cut = self.BALL.vertices.copy()
        cut[free, 2] = height
        plate, flat = (np.linalg.norm(way(self.BALL.moved(cut), free)[free], axis=1) for way in (carried_on, capped))
        assert np.abs(plate - 1).mean() < 0.25 * np.abs(flat - 1).mean()

    def test_of_what_is_flat_are_flat_and_leave_the_rest(self) -> None:
        flat = np.minimum(self.BALL.vertices, [2, 2, 0.2])
        free = np.hypot(flat[:, 0], flat[:, 1]) < 0.6
        free &= flat[:, 2] == 0.2
        rough = flat + free[:, None] * np.random.default_rng(1).normal(scale=0.02, size=flat.shape)
        found = carried_on(self.BALL.moved(rough), free)
        assert np.abs(found[free, 2] - 0.2).max() < 1e-9
        assert np.array_equal(found[~free], flat[~free])

    def test_turn_and_grow_with_the_mesh(self) -> None:
        free, turn = self.BALL.vertices[:, 2] > 0.4, np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        moved = 7 * self.BALL.vertices @ turn + [1, 2, 3]
        wanted = 7 * carried_on(self.BALL, free) @ turn + [1, 2, 3]
        assert np.allclose(carried_on(self.BALL.moved(moved), free), wanted, rtol=0, atol=1e-7)

    def test_without_a_border_keep_their_place(self) -> None:
        assert np.array_equal(carried_on(self.BALL, np.ones(len(self.BALL.vertices), bool)), self.BALL.vertices)


class TestHoles:
    BOWL = on_sphere(6_000)

    def test_are_capped_along_their_borders_and_marked(self) -> None:
        surface = reconstruct_points(self.BOWL[self.BOWL[:, 2] < 0.3], fill_holes=True)
        volume = np.pi * 1.3**2 * (3 - 1.3) / 3
        assert quality_of(surface)["volume_mm3"] == pytest.approx(volume, rel=0.03)
        assert surface.filled is not None
        middles = surface.mesh.corners.mean(axis=1)[surface.filled]
        assert len(middles)
        assert np.ptp(middles[:, 2]) < 0.15
        assert warned(surface, "of the faces lie where there are no points")

    def test_as_wide_as_the_object_are_refused_unless_asked_for(self) -> None:
        with pytest.raises(GeometryError, match="--fill-holes"):
            reconstruct_points(self.BOWL[self.BOWL[:, 2] < 0])

    def test_of_a_plane_enclose_nothing(self) -> None:
        flat = np.random.default_rng(0).random((2_000, 2))
        surface = reconstruct_points(np.column_stack([flat, np.zeros(2_000)]), fill_holes=True)
        assert warned(surface, "lie in a plane")


class TestNearSheets:
    @pytest.mark.parametrize("gap", [1.0, 1.5, 2.0, 3.0])
    @pytest.mark.parametrize("radius", [1.0, 0.25])
    def test_are_two_objects_or_told_of_with_the_place(self, radius: float, gap: float) -> None:
        spacing = np.sqrt(4 * np.pi / 15_000)
        other = on_sphere(int(15_000 * radius**2), radius, seed=2) + np.array([1 + gap * spacing + radius, 0, 0])
        surface = reconstruct_points(np.concatenate([on_sphere(15_000), other]))
        if surface.report["quality"]["components"] == 2:
            assert quality_of(surface, components=2)["volume_mm3"] == pytest.approx(
                4 / 3 * np.pi * (1 + radius**3), rel=1e-3
            )
            return
        assert gap < 2
        said = ("nearer than the cubes can part", "may be two objects")
        told = next(one for one in surface.report["warnings"] if any(word in one for word in said))
        place = json.loads("[" + told.split("(")[1].split(")")[0] + "]")
        assert np.abs(np.array(place) - [1 + gap * spacing / 2, 0, 0]).max() < 0.3

    def test_of_boxes_three_spacings_apart_stay_apart(self) -> None:
        gap = 3 * np.sqrt(6 / 10_000)
        other = on_box(10_000, (1.0, 1.0, 1.0), seed=2) + np.array([1 + gap, 0.3, 0.2])
        surface = reconstruct_points(np.concatenate([on_box(10_000, (1.0, 1.0, 1.0)), other]))
        assert quality_of(surface, components=2)["volume_mm3"] == pytest.approx(2, rel=0.01)

    def test_that_were_parted_are_the_same_on_any_threads(self) -> None:
        gap = 2.5 * np.sqrt(4 * np.pi / 4_000)
        points = np.concatenate([on_sphere(4_000), on_sphere(4_000, seed=2) + np.array([2 + gap, 0, 0])])
        one = reconstruct_points(points, threads=1).mesh
        other = reconstruct_points(np.random.default_rng(0).permutation(points), threads=3).mesh
        assert np.array_equal(one.vertices, other.vertices)
        assert np.array_equal(one.faces, other.faces)

    def test_one_inside_the_other_is_a_cavity(self) -> None:
        surface = reconstruct_points(np.concatenate([on_sphere(10_000), on_sphere(8_000, 0.8, seed=2)]))
        assert surface.cavities == 1
        assert quality_of(surface, components=2)["volume_mm3"] == pytest.approx(4 / 3 * np.pi * (1 - 0.8**3), rel=0.02)


class TestCubesTooWide:
    @pytest.mark.parametrize("cell", [0.6, 1.0, 10.0])
    def test_are_refused_before_any_work(self, cell: float) -> None:
        with pytest.raises(GeometryError, match=r"wider than the parts.*at most 0\.[45]"):
            reconstruct_points(on_sphere(20_000), cell_mm=(cell,))

    def test_for_a_part_are_refused_too(self) -> None:
        with pytest.raises(GeometryError, match="wider than the parts"):
            reconstruct_points(on_torus(80_000, 1.0, 0.1), cell_mm=(0.049,), closing=1)

    def test_for_a_sheet_are_refused(self) -> None:
        flat = np.random.default_rng(0).random((5_000, 2))
        with pytest.raises(GeometryError, match="wider than the parts"):
            reconstruct_points(np.column_stack([flat, np.zeros(5_000)]), cell_mm=(0.5,), open=True)


class TestShellAround:
    def test_known_cubes_is_theirs_alone(self) -> None:
        inside = np.argwhere(np.ones((9, 12, 17), bool)) + 30
        faces = exposed_faces(shell_around(inside, inside))
        assert faces.volumes.tolist() == [len(inside)]
        assert len(faces.quads) == 2 * (9 * 12 + 12 * 17 + 17 * 9)

    def test_fills_pockets(self) -> None:
        solid = np.ones((40, 40, 40), bool)
        solid[5:30, 5:30, 5:30] = False
        assert exposed_faces(shell_around(np.argwhere(solid), np.argwhere(solid))).volumes.tolist() == [40**3]


class TestMembrane:
    def test_of_a_flat_border_is_flat_and_all_else_stays(self) -> None:
        ball = TriMesh(*icosphere(12))
        free = ball.vertices[:, 2] > 0.3
        z = capped(ball, free)[:, 2]
        rim = np.unique(ball.faces[free[ball.faces].any(axis=1) & ~free[ball.faces].all(axis=1)])
        held = rim[~free[rim]]
        assert np.array_equal(z[~free], ball.vertices[~free, 2])
        assert z[free].max() <= z[held].max() + 1e-9
        assert z[free].min() >= z[held].min() - 1e-9

    def test_of_nothing_measured_stays(self) -> None:
        ball = TriMesh(*icosphere(2))
        assert np.array_equal(capped(ball, np.ones(len(ball.vertices), bool)), ball.vertices)

    def test_leaves_a_mesh_without_holes(self) -> None:
        tetrahedron = TriMesh(np.eye(4, 3), np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]))
        assert np.array_equal(capped(tetrahedron, np.zeros(4, bool)), tetrahedron.vertices)


def test_flooding_in_shares_reaches_all(monkeypatch: pytest.MonkeyPatch) -> None:
    cells = np.argwhere(np.ones((40, 3, 3), bool))
    blocks = Blocks.around(cells, 2)
    whole, shares = blocks.beyond(), blocks.beyond()
    blocks.flood(~blocks.bitmask_of(cells), whole)
    monkeypatch.setattr("tomomesh.cuberille.bitmasks.SHARE", 1)
    blocks.flood(~blocks.bitmask_of(cells), shares)
    assert np.array_equal(whole, shares)
