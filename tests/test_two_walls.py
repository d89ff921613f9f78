"""No mesh with two walls is written: what encloses too little of what its rings or samples do is refused."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

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
from tomomesh.settings import Settings

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
    assert made.segmentation is not None
    assert not self_intersections(made.mesh).any()
    return float(made.mesh.face_volumes.sum()) / made.segmentation.sampling.volume_mm3


@pytest.mark.skipif(not COMPILED, reason="the built-in head, minutes without the compiler")
class TestHead:
    @pytest.mark.parametrize("paper", [False, True])
    @pytest.mark.parametrize("factor", [0.7, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0])
    def test_without_caps_it_is_whole_or_refused(self, factor: float, paper: bool) -> None:
        volume, window = head()
        base = Settings.for_paper() if paper else Settings()
        share = share_or_refusal(volume, base.replace(**window, caps=False, cell_factor=factor))
        assert share is None or share >= HALF

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


class TestPromise:
    def test_the_limit_is_the_stated_share(self) -> None:
        made = reconstruct_points(np.random.default_rng(0).normal(size=(800, 3)) @ np.diag([1, 1, 0.0]))
        assert made.encloses_mm3 == 0
        rng = np.random.default_rng(1)
        ball = rng.normal(size=(800, 3))
        ball /= np.sqrt((ball**2).sum(axis=1))[:, None]
        sound = reconstruct_points(ball)
        volume = float(sound.mesh.face_volumes.sum())
        assert 0 < sound.encloses_mm3 < volume
        silent: Any = lambda *_: None  # noqa: E731
        for over, refused in ((0.49, True), (0.51, False)):
            judged = replace(sound, encloses_mm3=volume / over)
            if refused:
                with pytest.raises(GeometryError, match=r"49\.0%"):
                    finish(judged, Settings(), silent)
            else:
                finish(judged, Settings(), silent)


@pytest.mark.skipif(not SHARED.exists(), reason="no folder `shared` beside the project")
@pytest.mark.skipif(not COMPILED, reason="a real study, minutes without the compiler")
def test_a_real_head_without_caps_is_refused() -> None:
    volume = read_volume(SHARED / "derived" / "dev54_t1" / "dev54_t1.nii.gz")
    assert share_or_refusal(volume, Settings().replace(caps=False)) is None
