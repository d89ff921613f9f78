"""Walls and gaps on shapes whose widths are known, and how the error falls as the faces get smaller."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from conftest import size
from tomomesh.measure.thickness import walls_and_gaps, walls_of
from tomomesh.model.mesh import TriMesh

CLOSE = 1.006
"""What the search may be too wide by, and rounding."""


def mesh_of(found: trimesh.Trimesh) -> TriMesh:
    return TriMesh(np.array(found.vertices, np.float64), np.array(found.faces, np.int64))


def ring(minor: int) -> TriMesh:
    """A torus of 20 around a tube of 5."""
    return mesh_of(trimesh.creation.torus(20.0, 5.0, major_sections=2 * minor, minor_sections=minor))


class TestKnownWidths:
    def test_of_a_box_it_is_the_least_side(self) -> None:
        walls, gaps = walls_and_gaps(mesh_of(trimesh.creation.box((20, 30, 4))))
        assert walls.least[0] == pytest.approx(4)
        assert np.isinf(gaps.widths).all()
        assert walls.areas.sum() == pytest.approx(2 * (600 + 80 + 120))

    def test_of_a_hollow_box_they_are_its_wall_and_its_cavity(self) -> None:
        inner = trimesh.creation.box((16, 16, 16))
        inner.invert()
        hollow = trimesh.util.concatenate([trimesh.creation.box((20, 20, 20)), inner])
        walls, gaps = walls_and_gaps(mesh_of(hollow))
        assert (walls.least[0], walls.percentile(1)) == pytest.approx((2, 2))
        assert gaps.least[0] == pytest.approx(16)

    def test_between_two_plates_it_is_their_distance(self) -> None:
        above = trimesh.creation.box((20, 20, 3))
        above.apply_translation((0, 0, 2.4))
        walls, gaps = walls_and_gaps(mesh_of(trimesh.util.concatenate([trimesh.creation.box((20, 20, 1)), above])))
        assert walls.least[0] == pytest.approx(1)
        assert (gaps.least[0], gaps.percentile(10)) == pytest.approx((0.4, 0.4))
        assert abs(gaps.least[1][2]) == pytest.approx(0.7, abs=0.21)

    @pytest.mark.parametrize("apex", [20, 50])
    def test_of_a_cone_it_falls_to_nothing_at_its_tip(self, apex: float) -> None:
        radius = 20 * np.tan(np.radians(apex / 2))
        coarse = trimesh.creation.cone(radius, 20.0, sections=64).subdivide()
        tips = [walls_and_gaps(mesh_of(one))[0] for one in (coarse, coarse.subdivide())]
        assert tips[1].least[0] < 0.6 * tips[0].least[0]
        assert tips[1].least[1][2] > 17

    def test_wide_gaps_are_not_looked_for_but_the_one_wide_wall_is(self) -> None:
        walls, gaps = walls_and_gaps(ring(16), near=3.0)
        assert 8.8 < walls.least[0] < 10 * CLOSE
        assert np.isinf(gaps.widths).all()
        assert walls_of(ring(16), near=3.0).widths.tobytes() == walls.widths.tobytes()


class TestConvergence:
    def test_of_a_tube_it_comes_to_its_diameter(self) -> None:
        errors = [abs(walls_and_gaps(ring(n))[0].least[0] - 10) for n in (8, 16, size(32, 16))]
        assert errors[0] > 1.5 * errors[1]
        assert errors[2] <= errors[1]
        assert errors[2] < size(0.7, 1.2)

    def test_of_a_ball_no_width_is_over_its_diameter(self) -> None:
        walls, _ = walls_and_gaps(mesh_of(trimesh.creation.icosphere(size(3, 2), 20.0)))
        assert (walls.widths < 40 * CLOSE).all()
        assert walls.least[0] > size(37.5, 33.0)


def test_threads_change_nothing() -> None:
    one, many = (walls_and_gaps(ring(12), threads=threads) for threads in (1, 5))
    for a, b in zip(one, many, strict=True):
        assert a.widths.tobytes() == b.widths.tobytes()
