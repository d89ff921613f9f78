"""Slices in color: a window a layer, joined by AND or OR; inputs once each, or once a layer (eq. 3, 4)."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from tomomesh import Settings, Volume, reconstruct, window
from tomomesh.cli import main
from tomomesh.errors import EmptyError, UsageError
from tomomesh.isosurface.voxels import boundary
from tomomesh.segmentation.networks.training import train_study
from tomomesh.segmentation.otsu import otsu_threshold
from tomomesh.segmentation.survey import survey
from tomomesh.segmentation.window import by_layer, choose_window
from tomomesh.settings import NetworkSettings, WindowSettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

SHAPE = (14, 40, 40)
RADIUS = 11.0
SPACING = ("--spacing", "1", "1", "2")


def ball(red: float = 200, green: float = 120, blue: float = 30) -> NDArray[np.uint8]:
    """Paint a ball of one color, (K, J, I, 3), before another one; borders are blurred over a voxel."""
    k, j, i = np.indices(SHAPE)
    away = np.sqrt((i - 19.5) ** 2 + (j - 19.5) ** 2 + 4 * (k - 6.5) ** 2)
    inside = np.clip(0.5 + RADIUS - away, 0, 1)[..., None]
    painted = inside * np.array([red, green, blue]) + (1 - inside) * np.array([20, 20, 90])
    return np.asarray(np.rint(painted), np.uint8)


def volume_of(voxels: NDArray[Any]) -> Volume:
    return Volume.from_stored(voxels, np.diag([1.0, 1.0, 2.0, 1.0]))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Write the ball as a stack of PNG slices."""
    slices = tmp_path / "slices"
    slices.mkdir()
    for k, plane in enumerate(ball()):
        Image.fromarray(plane).save(slices / f"{k:02}.png")
    return slices


limits = st.tuples(*[st.integers(-1, 9)] * 3)


class TestWindow:
    @given(seed=st.integers(0, 99), lower=limits, wide=st.tuples(*[st.integers(1, 9)] * 3))
    def test_is_the_and_or_the_or_of_its_layers(self, seed: int, lower: Any, wide: Any) -> None:
        voxels = np.random.default_rng(seed).integers(0, 10, (3, 4, 5, 3), np.uint8)
        low, high = np.array(lower, float), np.array(lower, float) + wide
        kept = [(voxels[..., n] > low[n]) & (voxels[..., n] <= high[n]) for n in range(3)]
        for layers, joined in (("all", kept[0] & kept[1] & kept[2]), ("any", kept[0] | kept[1] | kept[2])):
            if joined.any():
                found = window(volume_of(voxels), lower=low, upper=high, layers=layers)
                np.testing.assert_array_equal(found, joined)
            else:
                with pytest.raises(EmptyError):
                    window(volume_of(voxels), lower=low, upper=high, layers=layers)

    def test_of_one_number_limits_every_layer(self) -> None:
        volume = volume_of(ball())
        np.testing.assert_array_equal(window(volume, lower=25.0), window(volume, lower=np.full(3, 25.0)))

    def test_is_otsus_in_each_layer_where_none_is_given(self) -> None:
        voxels = ball()
        voxels[..., 1] = 7
        lower, upper = choose_window(volume_of(voxels), WindowSettings())
        np.testing.assert_array_equal(
            np.asarray(lower), [otsu_threshold(voxels[..., 0]), -np.inf, otsu_threshold(voxels[..., 2])]
        )
        assert upper == np.inf

    @pytest.mark.parametrize(("voxels", "count"), [(ball()[..., 0], 3), (ball(), 2)])
    def test_refuses_limits_for_other_layers(self, voxels: NDArray[Any], count: int) -> None:
        with pytest.raises(UsageError, match=rf"do not fit the layers of the study\. Found: \[{count} limits"):
            by_layer(volume_of(voxels), lower=np.linspace(0.0, 20.0, count, dtype=np.float64))


class TestSettings:
    def test_take_one_limit_or_one_a_layer(self) -> None:
        assert Settings().replace(lower=(5.0,)).window.lower == 5.0
        assert Settings().replace(lower=[1, 2, 3]).window.lower == (1, 2, 3)
        again = Settings.from_dict(Settings().replace(lower=(1.0, 2.0, 3.0), layers="any").to_dict())
        assert again.window == WindowSettings(lower=(1.0, 2.0, 3.0), layers="any")

    @pytest.mark.parametrize(
        ("lower", "upper", "told"),
        [
            ((1, 2, 3), 2.5, "window is empty"),
            ((1, 2, 3), (4, 2, 6), "window is empty"),
            ((1, 2, 3), (4, 5), "each other"),
        ],
    )
    def test_refuse_limits_that_cannot_be(self, lower: Any, upper: Any, told: str) -> None:
        with pytest.raises(UsageError, match=told):
            WindowSettings(lower=lower, upper=upper)

    def test_of_the_paper_present_every_layer(self) -> None:
        paper = Settings.for_paper()
        assert (paper.network.inputs, paper.window.layers) == ("layers", "any")


class TestInputs:
    def test_are_pixels_once_each_or_once_a_layer(self) -> None:
        layered = np.zeros((1, 20, 20, 3), bool)
        layered[0, 4:16, 4:16, 0] = layered[0, 6:16, 4:16, 2] = True
        mask = np.asarray(layered.any(axis=3))
        settings = NetworkSettings(neurons=12, signal="region")
        once = train_study(mask, settings)
        each = train_study(mask, settings, layers=layered)
        assert (int(once.pixels[0]), int(each.pixels[0])) == (144, 264)
        assert each.codebooks.shape == (1, 12, 2)

    def test_of_equal_layers_give_the_ring_of_one(self) -> None:
        _, j, i = np.indices((1, 60, 60))
        away = np.hypot(i - 29.5, j - 29.5)
        band = np.asarray((away > 18) & (away < 24))
        settings = NetworkSettings(neurons=40, signal="region", radius=(10.0, 1.0))
        one = train_study(band, settings).codebooks[0] - 29.5
        three = train_study(band, settings, layers=np.repeat(band[..., None], 3, axis=3)).codebooks[0] - 29.5
        np.testing.assert_allclose(np.hypot(*three.T), np.hypot(*one.T), atol=0.15)


class TestBoundary:
    @pytest.mark.parametrize("layers", ["all", "any"])
    def test_of_layers_that_agree_is_that_of_one(self, layers: str) -> None:
        gray = ball()[..., 0]
        mask = gray > 100
        alone = boundary(volume_of(gray), mask, lower=100.0)
        color = boundary(volume_of(np.stack([gray, gray, gray], axis=3)), mask, lower=np.full(3, 100.0), layers=layers)
        np.testing.assert_array_equal(alone.points.positions, color.points.positions)

    def test_follows_the_last_layer_where_any_is_enough(self) -> None:
        gray = ball()[..., 0].astype(float)
        voxels = np.stack([gray, gray - 60.0, np.zeros(gray.shape)], axis=3)
        mask = window(volume_of(voxels), lower=100.0, layers="any")
        found = boundary(volume_of(voxels), mask, lower=100.0, layers="any")
        alone = boundary(volume_of(gray), gray > 100, lower=100.0)
        np.testing.assert_allclose(found.points.positions, alone.points.positions, atol=1e-12)


class TestEndToEnd:
    @pytest.mark.parametrize("network", ["ring", "none", "sphere"])
    def test_a_ball_in_color_has_its_volume(self, network: str) -> None:
        made = reconstruct(
            volume_of(ball()), lower=(110.0, 70.0, -1.0), upper=(255.0, 255.0, 60.0), network=network,
            neurons=642 if network == "sphere" else 40,
        )  # fmt: skip
        mesh = trimesh.Trimesh(made.mesh.vertices, made.mesh.faces, process=False)
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        few = 0.12 if network == "ring" else 0.02  # rings of 7 slices end flat, and lose the ball's poles
        assert mesh.volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=few)
        told = made.report["window"]
        assert (told["lower"], told["upper"]) == ([110, 70, -1], [255, 255, 60])
        assert (told["layers"], told["joined_by"]) == (3, "all")

    def test_otsu_finds_it_alone(self) -> None:
        made = reconstruct(volume_of(ball(blue=240)), network="none")
        assert made.report["window"]["chosen_by"] == "otsu"
        assert len(made.report["window"]["lower"]) == 3
        assert made.report["quality"]["volume_mm3"] == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.02)

    def test_inspect_tells_the_window_of_each_layer(self) -> None:
        voxels = ball()
        voxels[..., 1] = 7
        windows = survey(volume_of(voxels))["windows"]["otsu"]["lower"]
        assert windows == [otsu_threshold(voxels[..., 0]), None, otsu_threshold(voxels[..., 2])]


class TestCommandLine:
    def test_takes_a_stack_in_color_the_whole_way(self, folder: Path, tmp_path: Path, capsys: Any) -> None:
        mesh, report, labels = (tmp_path / name for name in ("m.stl", "r.json", "l.nii.gz"))
        arguments = ["reconstruct", str(folder), *SPACING, "-o", str(mesh), "--lower", "110,70,-1", "--neurons", "40"]
        assert main([*arguments, "--report", str(report), "--labels", str(labels)]) == 0
        assert "110, 70, -1 < k <= any (as given, in all of 3 layers)" in capsys.readouterr().out
        assert trimesh.load(mesh).is_watertight
        assert json.loads(report.read_text())["window"]["lower"] == [110, 70, -1]
        import nibabel

        assert int(np.count_nonzero(np.asarray(nibabel.load(labels).dataobj))) > 0

    def test_takes_a_list_that_begins_with_a_minus(self, folder: Path, tmp_path: Path) -> None:
        arguments = ["segment", str(folder), *SPACING, "-o", str(tmp_path / "p.ply"), "--quiet", "--neurons", "30"]
        assert main([*arguments, "--lower", "-1,70,-1", "--layers", "all"]) == 0

    @pytest.mark.parametrize("paper", [(), ("--paper",)])
    def test_trains_on_a_picture(self, folder: Path, tmp_path: Path, capsys: Any, paper: tuple[str, ...]) -> None:
        where = tmp_path / "out"
        arguments = ["network", str(folder / "07.png"), "-o", str(where), "--lower", "110,70,-1", "--json", *paper]
        assert main(arguments) == 0
        plane = ball()[7]
        kept = plane > np.array([110, 70, -1])
        expected = int(kept.sum()) if paper else int(kept.all(axis=2).sum())
        assert json.loads(capsys.readouterr().out)["network"]["inputs"] == expected

    def test_inspects_it(self, folder: Path, capsys: Any) -> None:
        assert main(["inspect", str(folder), *SPACING]) == 0
        told = capsys.readouterr().out
        assert "3 layer(s) of uint8" in told
        assert told.split("otsu: k > ")[1].splitlines()[0].count(",") == 2

    def test_refuses_three_limits_for_gray(self, tmp_path: Path, capsys: Any) -> None:
        gray = tmp_path / "gray"
        gray.mkdir()
        for k, plane in enumerate(ball()[..., 0]):
            Image.fromarray(plane).save(gray / f"{k:02}.png")
        arguments = ["reconstruct", str(gray), *SPACING, "-o", str(tmp_path / "m.stl"), "--quiet"]
        assert main([*arguments, "--lower", "1,2,3"]) == 2
        told = capsys.readouterr().err
        assert told.count("\n") == 1
        assert "the study is gray" in told
