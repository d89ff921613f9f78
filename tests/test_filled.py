"""Clouds that fill a solid are told from those on a surface, and closed where that is asked for."""

from __future__ import annotations

import numpy as np
import pytest

from conftest import COMPILED
from tomomesh import reconstruct_points
from tomomesh.errors import GeometryError
from tomomesh.pointcloud.solid import depths, distance_within, fills_solid

RNG = np.random.default_rng(4)
CUBE = RNG.uniform(-1, 1, (16000, 3))
BALL = 10 * CUBE[(CUBE**2).sum(axis=1) < 1]
RING = np.hypot(CUBE[:, 0], CUBE[:, 1])
TORUS = 10 * CUBE[(RING - 0.65) ** 2 + CUBE[:, 2] ** 2 < 0.3**2]
LATTICE = np.stack(np.meshgrid(*[np.arange(-8.0, 9)] * 3), axis=-1).reshape(-1, 3)
SPHERE = 10 * CUBE / np.linalg.norm(CUBE, axis=1)[:, None]


@pytest.mark.parametrize("points", [BALL, TORUS, LATTICE, LATTICE[(LATTICE**2).sum(axis=1) < 64]])
def test_solids_are_found(points: np.ndarray) -> None:
    assert fills_solid(points)


@pytest.mark.parametrize("points", [
    SPHERE, SPHERE + RNG.normal(0, 0.06, SPHERE.shape), SPHERE * [1, 1, 0], SPHERE * [1, 0, 0], BALL[:20],
    np.zeros((100, 3)),
])  # fmt: skip
def test_surfaces_are_none(points: np.ndarray) -> None:
    assert not fills_solid(points)


def test_each_point_owns_the_cube_of_their_distance() -> None:
    assert distance_within(BALL) == pytest.approx((4 / 3 * np.pi * 1000 / len(BALL)) ** (1 / 3), rel=0.06)
    assert distance_within(LATTICE) == pytest.approx(1, rel=0.15)


def test_depth_is_over_0_at_every_point_and_far_from_none() -> None:
    apart = distance_within(BALL)
    levels, low = depths(BALL, apart, apart / 2)
    z, y, x = np.rint((BALL - low)[:, ::-1] / (apart / 2)).astype(int).T
    assert (levels[z, y, x] > -apart / 2).all()
    inside = low + np.argwhere(levels > 0)[:, ::-1] * (apart / 2)
    assert np.linalg.norm(inside, axis=1).max() < 10 + apart


@pytest.mark.skipif(not COMPILED, reason="surfaces take minutes without the compiler")
class TestSurface:
    def test_a_filled_cloud_is_told_so(self) -> None:
        with pytest.raises(GeometryError, match=r"fill a solid.*--filled"):
            reconstruct_points(BALL)

    @pytest.mark.parametrize(("points", "volume", "genus"), [
        (BALL, 4 / 3 * np.pi * 1000, 0), (TORUS, 2 * np.pi**2 * 6.5 * 9, 1), (LATTICE, 17.0**3, 0),
    ])  # fmt: skip
    def test_its_boundary_is_closed(self, points: np.ndarray, volume: float, genus: int) -> None:
        quality = reconstruct_points(points, filled=True).report["quality"]
        assert quality["sound"]
        assert (quality["components"], quality["genus"]) == (1, genus)
        assert quality["volume_mm3"] == pytest.approx(volume, rel=0.1)

    def test_the_order_of_the_points_changes_nothing(self) -> None:
        one, other = (reconstruct_points(cloud, filled=True).mesh for cloud in (BALL, BALL[::-1]))
        np.testing.assert_array_equal(one.vertices, other.vertices)
        np.testing.assert_array_equal(one.faces, other.faces)
