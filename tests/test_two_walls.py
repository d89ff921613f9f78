"""No mesh with two walls is written: what encloses too little of what its rings or samples do is refused."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import COMPILED, law, seeds
from tomomesh import Volume, phantom, read_volume, reconstruct, reconstruct_points
from tomomesh.cli import main
from tomomesh.errors import GeometryError
from tomomesh.finish import finish
from tomomesh.measure.intersections import self_intersections
from tomomesh.progress import silent
from tomomesh.results import Enclosed
from tomomesh.settings import Settings

if TYPE_CHECKING:
    from numpy.typing import NDArray

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
HALF = 0.5
"""The share that is promised."""


@cache
def head() -> tuple[Volume, dict[str, Any]]:
    found = phantom()
    return found.volume, {"lower": found.lower, "upper": found.upper}


def share_or_refusal(volume: Volume, settings: Settings) -> float | None:
    """Return what share of its rings' volume a mesh encloses, or None where it is refused with exit code 5."""
    try:
        made = reconstruct(volume, settings)
    except GeometryError:
        return None
    assert made.encloses is not None
    assert not self_intersections(made.mesh).any()
    return float(made.mesh.face_volumes.sum()) / made.encloses.volume


@pytest.mark.skipif(not COMPILED, reason="the built-in head, minutes without the compiler")
class TestHead:
    @pytest.mark.parametrize(
        ("changes", "written"),
        [
            ({"caps": False}, False),
            ({"caps": False, "cell_factor": 1.5}, False),
            ({"caps": False, "cell_factor": 2.0}, False),
            ({"caps": False, "cell_factor": 3.0}, False),
            ({"caps": True, "cell_factor": 2.0}, True),
            ({"caps": True, "contours": "loops"}, True),
            ({"caps": True, "network": "sphere"}, True),
        ],
    )
    def test_it_is_whole_or_refused(self, changes: dict[str, Any], written: bool) -> None:
        volume, window = head()
        share = share_or_refusal(volume, Settings().replace(**window, **changes))
        assert (share is not None) == written
        assert share is None or share >= HALF

    @pytest.mark.parametrize("factor", [0.7, 1.0, 1.5, 2.0, 3.0])
    def test_so_it_is_under_paper(self, factor: float) -> None:
        volume, window = head()
        share = share_or_refusal(volume, Settings.for_paper().replace(**window, caps=False, cell_factor=factor))
        assert share is None or share >= HALF
        assert share_or_refusal(volume, Settings.for_paper().replace(**window)) == pytest.approx(1, abs=0.02)

    def test_twice_the_cell_is_refused_in_one_line(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        folder = tmp_path / "demo"
        assert main(["demo", "-o", str(folder), "--no-caps", "--cell-factor", "2"]) == 5
        assert "two walls" in capsys.readouterr().err
        assert not folder.exists()

    def test_what_is_allowed_is_told_and_not_fitted(self) -> None:
        volume, window = head()
        made = reconstruct(volume, **window, caps=False, cell_factor=2.0, allow_leaks=True)
        assert made.report["cubes"]["walls"] == 2
        assert made.report["fit"]["converged"] is None
        assert any("two walls" in warning for warning in made.report["warnings"])

    def test_a_sound_one_has_one_wall(self) -> None:
        volume, window = head()
        made = reconstruct(volume, **window)
        assert (made.report["cubes"]["walls"], made.report["quality"]["self_intersections"]) == (1, 0)
        assert made.report["quality"]["volume_over_rings"] == pytest.approx(1, abs=0.01)


@pytest.mark.skipif(not COMPILED, reason="rings on many slices, minutes without the compiler")
class TestSolids:
    """Rings, chains and grids that lie inside of a solid do not bound it."""

    @pytest.mark.parametrize(
        ("changes", "written"),
        [
            ({}, True),
            ({"signal": "region"}, False),
            ({"contours": "components", "signal": "region"}, False),
            ({"contours": "loops"}, True),
            ({"network": "chain"}, False),
            ({"network": "sphere", "neurons": 162}, True),
            ({"network": "sphere", "neurons": 162, "signal": "region"}, False),
        ],
    )
    def test_half_of_the_window_is_enclosed_or_it_is_refused(self, changes: dict[str, Any], written: bool) -> None:
        away = np.sqrt(((np.indices((32, 32, 32)) - 15.5) ** 2).sum(axis=0))
        volume = Volume.from_stored((100 * np.clip(13.5 - away, 0, 1)).astype(np.float32), np.eye(4))
        settings = Settings().replace(lower=50.0, **changes)
        share = share_or_refusal(volume, settings)
        assert (share is not None) == written
        if written:
            mesh = reconstruct(volume, settings).mesh
            assert mesh.face_volumes.sum() == pytest.approx(4 / 3 * np.pi * 13**3, rel=0.06)

    def test_one_slice_may_be_flat(self) -> None:
        disk = np.zeros((5, 24, 24), np.float32)
        disk[2] = 100 * (np.hypot(*(np.indices((24, 24)) - 11.5)) < 9)
        made = reconstruct(Volume.from_stored(disk, np.eye(4)), lower=50.0, way="ring", signal="region", neurons=24)
        assert made.report["fit"]["converged"] is None
        assert any("lie in a plane" in warning for warning in made.report["warnings"])


class TestClouds:
    @law(20)
    @given(seed=seeds, hole=st.floats(0.0, 1.2), attraction=st.sampled_from(["auto", "nearest"]))
    def test_a_ball_with_a_hole_is_whole_or_refused(self, seed: int, hole: float, attraction: str) -> None:
        rng = np.random.default_rng(seed)
        points = rng.normal(size=(900, 3))
        points /= np.sqrt((points**2).sum(axis=1))[:, None]
        points = points[np.arccos(points[:, 2]) > hole]
        try:
            made = reconstruct_points(points, attraction=attraction, stacks="none")
        except GeometryError:
            return
        assert made.mesh.face_volumes.sum() >= HALF * 4 / 3 * np.pi


def ball(count: int, seed: int) -> NDArray[np.float64]:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return np.asarray(points / np.sqrt((points**2).sum(axis=1))[:, None])


class TestUnfitted:
    """A shell that is only smoothed may pass through itself before any fit: it is taken back to its cubes there."""

    @law(25)
    @given(
        seed=seeds, passes=st.integers(0, 100), factor=st.floats(0.5, 1.5), closing=st.integers(0, 1),
        attraction=st.sampled_from(["auto", "nearest"]),
    )  # fmt: skip
    def test_no_face_passes_through_another(
        self, seed: int, passes: int, factor: float, closing: int, attraction: str
    ) -> None:
        asked: dict[str, Any] = {"low_pass": passes, "cell_factor": factor, "closing": closing}
        stretched = ball(400, seed) * np.random.default_rng(seed).uniform(0.3, 3, 3)
        made = reconstruct_points(stretched, attraction=attraction, stacks="none", allow_leaks=True, **asked)
        assert not self_intersections(made.mesh).any()


class TestStacks:
    def test_a_stack_must_enclose_what_lies_between_its_slices(self) -> None:
        angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
        rings = [[(10 - z) * np.cos(angle), (10 - z) * np.sin(angle), np.full(60, 2.0 * z)] for z in range(6)]
        made = reconstruct_points(np.concatenate([np.stack(ring, axis=1) for ring in rings]))
        assert made.report["way"]["name"] == "stack"
        assert made.encloses is not None
        height = np.linspace(-1, 11, 1000)  # half a slice goes on at both ends
        truth = np.trapezoid(np.pi * (10 - height / 2) ** 2, height)
        assert made.encloses.volume == pytest.approx(truth, rel=0.01)


class TestCoarser:
    def test_few_faces_are_no_second_wall(self) -> None:
        made = reconstruct_points(ball(800, 1), target_faces=8)
        assert len(made.mesh.faces) <= 8


class TestPromise:
    def test_the_limit_is_the_stated_share(self) -> None:
        made = reconstruct_points(np.random.default_rng(0).normal(size=(800, 3)) @ np.diag([1, 1, 0.0]))
        assert made.encloses is None
        rng = np.random.default_rng(1)
        ball = rng.normal(size=(800, 3))
        ball /= np.sqrt((ball**2).sum(axis=1))[:, None]
        sound = reconstruct_points(ball)
        volume = float(sound.mesh.face_volumes.sum())
        assert sound.encloses is not None
        assert 0 < sound.encloses.volume < volume
        for over, refused in ((0.49, True), (0.51, False)):
            judged = replace(sound, encloses=Enclosed("samples", volume / over))
            if refused:
                with pytest.raises(GeometryError, match=r"49\.0%"):
                    finish(judged, Settings(), silent)
            else:
                finish(judged, Settings(), silent)


@pytest.mark.skipif(not SHARED.exists(), reason="no folder `shared` beside the project")
@pytest.mark.skipif(not COMPILED, reason="a real study, minutes without the compiler")
def test_a_real_head_without_caps_is_refused() -> None:
    volume = read_volume(SHARED / "derived" / "dev54_t1" / "dev54_t1.nii.gz")
    assert share_or_refusal(volume, Settings().replace(way="ring", caps=False)) is None
