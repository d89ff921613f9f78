"""Smoothing: detail shorter than the length goes, the rest and the volume stay, and it says what it moved."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from conftest import law, seeds
from studies import write_nifti
from tomomesh import TriMesh, Volume, reconstruct, reconstruct_points, write_mesh
from tomomesh.cli import main
from tomomesh.dynamics.fairing import fair
from tomomesh.measure.intersections import self_intersections

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

RADIUS = 8.0


def gray_ball(radius: float = RADIUS, size: int = 24) -> Volume:
    away = np.sqrt(((np.indices((size,) * 3) - (size - 1) / 2) ** 2).sum(axis=0))
    return Volume.from_stored((100 - 10 * (away - radius)).astype(np.float32), np.eye(4))


@cache
def ball() -> TriMesh:
    return reconstruct(gray_ball(), lower=100.0, network="none").mesh


def sheet(height: NDArray[np.float64], step: float) -> TriMesh:
    """Return a square of heights over a lattice."""
    n = len(height)
    x, y = step * np.indices((n, n))
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack(each, axis=-1).reshape(-1, 3) for each in ((a, b, c), (a, c, d))])
    return TriMesh(np.stack([x, y, height], axis=-1).reshape(-1, 3), faces)


def cloud(seed: int = 0) -> NDArray[np.float64]:
    points = np.random.default_rng(seed).normal(size=(900, 3))
    return np.asarray(RADIUS * points / np.sqrt((points**2).sum(axis=1))[:, None])


class TestLaws:
    @law(20)
    @given(share=st.floats(0.02, 1.0))
    def test_a_ball_keeps_its_volume_and_its_shape(self, share: float) -> None:
        mesh, found = ball(), fair(ball(), share * RADIUS)
        made = mesh.moved(found.vertices)
        assert (found.left, found.pieces) == (0, 1)
        assert made.face_volumes.sum() == pytest.approx(mesh.face_volumes.sum(), rel=1e-3)
        np.testing.assert_allclose(
            np.sqrt(((made.vertices - made.vertices.mean(axis=0)) ** 2).sum(axis=1)), RADIUS, atol=0.1
        )

    @pytest.mark.parametrize("wavelength", [3.0, 5.0])
    @pytest.mark.parametrize("share", [0.25, 0.5, 1.0, 2.0])
    def test_a_ripple_keeps_what_is_stated(self, wavelength: float, share: float) -> None:
        step, n = wavelength / 16, 121
        wave = np.broadcast_to(np.cos(2 * np.pi * step * np.arange(n) / wavelength)[:, None], (n, n))
        height = fair(sheet(0.02 * wave, step), share * wavelength).vertices[:, 2].reshape(n, n)
        inner = slice(28, 92)  # four whole waves, away from the borders
        kept = 2 * float((height * wave)[inner, inner].mean()) / 0.02
        assert kept == pytest.approx(1 / (1 + (2 * share) ** 4), abs=0.04)
        assert kept > 0.9 if share == 0.25 else kept < 0.1 or share == 0.5

    @law(10)
    @given(seed=seeds, share=st.floats(0.1, 1.0), scale=st.floats(0.1, 10.0))
    def test_it_turns_and_grows_with_the_mesh(self, seed: int, share: float, scale: float) -> None:
        rng = np.random.default_rng(seed)
        turn, away = Rotation.random(random_state=seed).as_matrix(), 100 * rng.normal(size=3)
        mesh = ball()
        rough = mesh.moved(mesh.vertices + 0.1 * rng.normal(size=mesh.vertices.shape))
        one = fair(rough, share * RADIUS).vertices
        other = fair(rough.moved(scale * rough.vertices @ turn.T + away), scale * share * RADIUS).vertices
        np.testing.assert_allclose(other, scale * one @ turn.T + away, atol=1e-3 * scale)

    @law(10)
    @given(seed=seeds, length=st.floats(0.5, 8.0))
    def test_borders_stay(self, seed: int, length: float) -> None:
        mesh = sheet(0.2 * np.random.default_rng(seed).normal(size=(15, 15)), 1.0)
        before, after = (v.reshape(15, 15, 3) for v in (mesh.vertices, fair(mesh, length).vertices))
        rim = np.ones((15, 15), bool)
        rim[1:-1, 1:-1] = False
        np.testing.assert_array_equal(before[rim], after[rim])
        assert np.abs(after[~rim]).max() <= np.abs(before[~rim]).max() * 1.2

    def test_a_piece_that_is_thinner_than_the_length_is_left(self) -> None:
        mesh = ball()
        small = 0.2 * mesh.vertices + 50
        both = TriMesh(np.concatenate([mesh.vertices, small]), np.concatenate([mesh.faces, mesh.faces + len(small)]))
        found = fair(both, RADIUS)
        assert (found.left, found.pieces) == (1, 2)
        np.testing.assert_array_equal(found.vertices[len(small) :], small)
        assert np.abs(found.vertices[: len(small)] - mesh.vertices).max() > 0


WAYS: dict[str, dict[str, Any]] = {
    "voxels": {"network": "none"}, "rings": {"neurons": 40}, "loops": {"contours": "loops"},
    "sphere": {"network": "sphere", "neurons": 162},
}  # fmt: skip


class TestEveryWay:
    @pytest.mark.parametrize("way", WAYS)
    def test_a_study_is_smoothed_and_told_of(self, way: str) -> None:
        self.judged(
            reconstruct(gray_ball(), lower=100.0, remesh=False, smooth=4.0, **WAYS[way]),
            reconstruct(gray_ball(), lower=100.0, remesh=False, **WAYS[way]),
        )

    @pytest.mark.parametrize("asked", [{}, {"attraction": "nearest"}])
    def test_so_is_a_cloud(self, asked: dict[str, Any]) -> None:
        made, before = (reconstruct_points(cloud(), remesh=False, smooth=length, **asked) for length in (4.0, 0.0))
        self.judged(made, before)

    def test_so_is_a_stack(self) -> None:
        angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        points = np.concatenate([np.column_stack([(12 - z) * ring, np.full(60, 2.0 * z)]) for z in range(8)])
        self.judged(*(reconstruct_points(points, remesh=False, smooth=length) for length in (4.0, 0.0)))

    def test_triangles_are_even_after_it(self) -> None:
        smoothed, even = (
            reconstruct(gray_ball(), lower=100.0, network="none", remesh=remesh, smooth=8.0) for remesh in (False, True)
        )
        quality = even.report["quality"]
        assert quality["p1_smallest_angle_deg"] >= 30
        assert quality["median_smallest_angle_deg"] >= 45
        assert quality["self_intersections"] == 0
        assert quality["volume_mm3"] == pytest.approx(smoothed.report["quality"]["volume_mm3"], rel=1e-3)

    def judged(self, made: Any, before: Any) -> None:
        told = made.report["smooth"]
        moved = np.sqrt(((made.mesh.vertices - before.mesh.vertices) ** 2).sum(axis=1))
        assert told["moved_mean_mm"] == pytest.approx(moved.mean())
        assert told["moved_p95_mm"] == pytest.approx(np.percentile(moved, 95))
        assert told["moved_max_mm"] == pytest.approx(moved.max())
        assert moved.max() > 0
        assert made.mesh.face_volumes.sum() == pytest.approx(before.mesh.face_volumes.sum(), rel=1e-3)
        assert told["volume_change"] == pytest.approx(0, abs=1e-3)
        assert not self_intersections(made.mesh).any()
        turns = [one.report["quality"]["mean_turn_deg"] for one in (made, before)]
        assert turns[0] < turns[1]

    def test_none_changes_no_byte(self, tmp_path: Path) -> None:
        cases: dict[str, dict[str, Any]] = {"as it is": {}, "none": {"smooth": 0.0}}
        for name, asked in cases.items():
            made = reconstruct(gray_ball(), lower=100.0, network="none", **asked)
            assert "smooth" not in made.report
            write_mesh(made.mesh, tmp_path / f"{name}.ply")
        assert (tmp_path / "as it is.ply").read_bytes() == (tmp_path / "none.ply").read_bytes()

    def test_no_byte_depends_on_threads(self) -> None:
        meshes = [reconstruct(gray_ball(), lower=100.0, network="none", smooth=5.0, threads=n).mesh for n in (1, 3)]
        assert meshes[0].vertices.tobytes() == meshes[1].vertices.tobytes()

    def test_the_summary_says_what_moved(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        study = tmp_path / "ball.nii"
        write_nifti(study, gray_ball().voxels, np.eye(4))
        line = ["reconstruct", str(study), "-o", str(tmp_path / "m.ply"), "--lower", "100", "--network", "none"]
        assert main([*line, "--smooth", "4"]) == 0
        assert "\nsmooth    vertices moved by " in capsys.readouterr().out
