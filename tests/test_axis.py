"""Contours in planes about one axis: found from the positions alone, and closed along the angle, not by chords."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from conftest import COMPILED, law
from tomomesh import reconstruct_points
from tomomesh.contours.axis import half_planes
from tomomesh.contours.turning import between_half_planes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

RADII = np.array([30.0, 22.0, 45.0])
VOLUME = 4 / 3 * np.pi * float(RADII.prod())


def evenly(curve: Floats, apart: float) -> Floats:
    """Draw a closed curve (c, 3) with points so far apart."""
    closed = np.concatenate([curve, curve[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.linspace(0, along[-1], max(int(along[-1] / apart), 6), endpoint=False)
    return np.stack([np.interp(at, along, column) for column in closed.T], axis=1)


def ellipse(angle: float, aside: Floats, apart: float = 2.4) -> Floats:
    """Cut the ellipsoid around `aside` by the plane through the z axis."""
    ahead, up = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([0.0, 0.0, 1.0])
    basis = np.stack([ahead, up]) / RADII
    form, linear = basis @ basis.T, -basis @ (aside / RADII)
    middle = -np.linalg.solve(form, linear)
    left = 1 - ((aside / RADII) ** 2).sum() - linear @ middle
    values, vectors = np.linalg.eigh(form)
    turn = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    flat = middle[:, None] + vectors @ (np.sqrt(left / values)[:, None] * np.array([np.cos(turn), np.sin(turn)]))
    return evenly(flat.T @ np.stack([ahead, up]), apart)


def ellipsoid(planes: int, aside: tuple[float, float, float] = (0, 0, 0), apart: float = 2.4) -> Floats:
    return np.concatenate([ellipse(angle, np.array(aside), apart) for angle in np.pi * np.arange(planes) / planes])


def torus(planes: int) -> Floats:
    turn = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    loop = np.stack([20 + 6 * np.cos(turn), np.zeros(2000), 6 * np.sin(turn)], axis=1)
    angles = np.pi * np.arange(2 * planes) / planes
    return np.concatenate([evenly(loop @ Rotation.from_euler("z", angle).as_matrix().T, 1.6) for angle in angles])


def volume_of(points: Floats) -> tuple[float, int]:
    report = reconstruct_points(points).report
    assert report["quality"]["sound"]
    assert any("about one axis" in note for note in report["points"]["notes"])
    return report["quality"]["volume_mm3"], report["quality"]["genus"]


@law(30)
@given(
    planes=st.integers(4, 14), turn=st.tuples(*[st.floats(-3, 3)] * 3), aside=st.tuples(*[st.floats(-8, 8)] * 3),
    moved=st.tuples(*[st.floats(-300, 300)] * 3), seed=st.integers(0, 9),
)  # fmt: skip
def test_what_is_between_lies_on_the_ellipsoid_wherever_the_axis_is(
    planes: int, turn: tuple[float, ...], aside: tuple[float, float, float], moved: tuple[float, ...], seed: int
) -> None:
    points = ellipsoid(planes, aside, apart=1.2)
    placed = Rotation.from_euler("xyz", turn).apply(np.random.default_rng(seed).permutation(points)) + moved
    found = half_planes(placed)
    assert found is not None
    assert len(found.angles) == 2 * planes
    back = Rotation.from_euler("xyz", turn).inv().apply(between_half_planes(found) - moved)
    off = np.linalg.norm((back - aside) / RADII, axis=1) - 1
    # a cubic is off by the third power of the angle; chords by 1 - cos(angle / 2): 7.6 % at four planes, 3.4 % at six
    assert np.abs(off).max() < 0.014 * (6 / planes) ** 3
    assert np.abs(off).mean() < 0.003 * (6 / planes) ** 3.5


def test_the_order_of_the_points_changes_nothing() -> None:
    points = ellipsoid(7)
    one, other = half_planes(points), half_planes(points[np.random.default_rng(1).permutation(len(points))])
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(between_half_planes(one), between_half_planes(other))


@pytest.mark.parametrize("kind", ["sphere", "stack", "helix", "few"])
def test_other_clouds_are_none(kind: str) -> None:
    rng = np.random.default_rng(2)
    ball = rng.normal(size=(4000, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    turn = np.linspace(0, 44 * np.pi, 2600)
    height = np.linspace(-0.98, 0.98, 2600)
    wide = np.sqrt(1 - height**2)
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    rings = [np.column_stack([20 * np.cos(angle), 20 * np.sin(angle), np.full(60, z)]) for z in range(0, 50, 8)]
    clouds = {
        "sphere": ball, "stack": np.concatenate(rings), "few": ball[:15],
        "helix": np.column_stack([wide * np.cos(turn), wide * np.sin(turn), height]),
    }  # fmt: skip
    assert half_planes(clouds[kind]) is None


@pytest.mark.skipif(not COMPILED, reason="surfaces take minutes without the compiler")
class TestVolume:
    @pytest.mark.parametrize("planes", [4, 6, 9, 14])
    def test_of_an_ellipsoid(self, planes: int) -> None:
        volume, genus = volume_of(ellipsoid(planes))
        assert volume == pytest.approx(VOLUME, rel=0.003)
        assert genus == 0

    def test_with_the_axis_aside_and_numbers_rounded(self) -> None:
        assert volume_of(np.round(ellipsoid(6, (15, 0, 3)), 1))[0] == pytest.approx(VOLUME, rel=0.005)

    def test_with_noise(self) -> None:
        points = ellipsoid(8)
        noisy = points + np.random.default_rng(3).normal(0, 0.1, points.shape)
        assert volume_of(noisy)[0] == pytest.approx(VOLUME, rel=0.005)

    def test_of_a_torus_around_the_axis(self) -> None:
        volume, genus = volume_of(torus(6))
        assert volume == pytest.approx(2 * np.pi**2 * 20 * 36, rel=0.005)
        assert genus == 1

    def test_what_is_interpolated_is_marked_as_filled(self) -> None:
        found = reconstruct_points(ellipsoid(6, apart=1.2))
        assert found.filled is not None
        centers = found.mesh.corners.mean(axis=1)[~found.filled]
        angle = np.arctan2(centers[:, 1], centers[:, 0]) % (np.pi / 6)
        away = np.minimum(angle, np.pi / 6 - angle) * np.hypot(centers[:, 0], centers[:, 1])
        assert away.max() < 1.5
        assert 0.8 < found.filled.mean() < 0.95
        assert found.report["points"]["interpolated"] > 5000

    def test_stacks_none_takes_the_points_alone(self) -> None:
        report = reconstruct_points(ellipsoid(9, apart=1.2), stacks="none").report
        assert report["points"]["interpolated"] == 0
        assert report["quality"]["volume_mm3"] < 0.97 * VOLUME


def half_ellipsoid(planes: int, aside: tuple[float, float, float]) -> Floats:
    """Cut the ellipsoid by half planes about the z axis: what one side of each plane shows."""
    angles = 2 * np.pi * np.arange(planes) / planes
    cuts = [(ellipse(angle, np.array(aside)), np.array([np.cos(angle), np.sin(angle), 0])) for angle in angles]
    return np.concatenate([points[points @ ahead >= 0] for points, ahead in cuts])


@pytest.mark.skipif(not COMPILED, reason="surfaces take minutes without the compiler")
@pytest.mark.parametrize("aside", [(0.0, 0.0, 0.0), (5.0, -4.0, 8.0)])
@pytest.mark.parametrize("planes", [7, 8, 9, 11, 13, 15, 20])
def test_half_planes_need_no_other_half(planes: int, aside: tuple[float, float, float]) -> None:
    points = half_ellipsoid(planes, aside)
    found = half_planes(points)
    assert found is not None
    assert len(found.angles) == planes
    volume, genus = volume_of(points)
    assert volume == pytest.approx(VOLUME, rel=0.02)
    assert genus == 0


@pytest.mark.skipif(not COMPILED, reason="surfaces take minutes without the compiler")
@pytest.mark.parametrize("planes", [11, 15, 24])
def test_loops_about_an_axis_are_a_torus_and_a_part_of_one_is_not_closed(planes: int) -> None:
    turn = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    loop = np.stack([20 + 6 * np.cos(turn), np.zeros(2000), 6 * np.sin(turn)], axis=1)
    ways = [Rotation.from_euler("z", angle).as_matrix().T for angle in 2 * np.pi * np.arange(planes) / planes]
    drawn = [evenly(loop @ way, 1.6) for way in ways]
    volume, genus = volume_of(np.concatenate(drawn))
    assert volume == pytest.approx(2 * np.pi**2 * 20 * 36, rel=0.01)
    assert genus == 1
    for left_out in (planes // 3, planes // 2):
        assert half_planes(np.concatenate(drawn[left_out:])) is None
